//! A coarse solid, seen while the whole fit goes on.

use std::path::Path;
use std::sync::Arc;

use document::{Object, State};

use super::orders::{News, Sheet, Thing};
use crate::view::{Shape, Solid};

/// What is told of an object that is only looked at.
///
/// # Errors
/// That its surface cannot be shown.
pub fn news(scan: &Path, name: &str, object: Object) -> Result<Vec<News>, String> {
    let state = State::new().with(name, object).map_err(|e| e.to_string())?;
    let object = state.object(name).map_err(|e| e.to_string())?;
    let thing = Thing::of(&state, name).ok_or("it has no surface")?;
    let mut shape = Shape::preview(object, thing.iso, thing.world_from_object).map_err(|e| e.to_string())?;
    let origin = thing.own_box.center();
    let scene = News::scene(origin, shape.bounding_box(), thing.is_volume, false);
    let (thing_iso, placed) = (thing.iso, thing.world_from_object);
    let sheet = Sheet {
        path: scan.into(),
        is_untitled: true,
        objects: vec![thing],
        chosen: 0,
        history: Vec::new(),
        done: 0,
    };
    let patches = News::Patches(shape.all(name, origin));
    let solid = Solid::of(object, thing_iso, placed).map(|solid| News::Solid(name.into(), Box::new(solid)));
    let all = [scene, patches].into_iter().chain(solid);
    Ok(all.chain([News::Sheet(Arc::new(sheet))]).collect())
}
