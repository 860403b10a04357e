//! Coarse solids, seen while a fit goes on or finer triangles are made.

use std::path::Path;
use std::sync::Arc;

use bspline::Aabb;
use document::State;

use super::orders::{News, Sheet, Thing};
use crate::view::{Budget, Shape, Solid};

/// What is told of objects that are only looked at.
///
/// # Errors
/// That the surface of one cannot be shown.
pub fn news(path: &Path, state: &State) -> Result<Vec<News>, String> {
    let names = state.objects().keys();
    let things: Vec<Thing> = names.filter_map(|name| Thing::of(state, name)).collect();
    let boxes = things
        .iter()
        .map(|thing| thing.own_box.transformed(&thing.world_from_object));
    let origin = boxes.reduce(Aabb::hull).ok_or("it has no surface")?.center();
    let mut told = Vec::new();
    let mut bounds = Vec::new();
    let shares = Budget::PROCESSOR.shared(state.objects());
    for thing in &things {
        let (object, iso, placed) = (&thing.object, thing.iso, thing.world_from_object);
        let share = shares[&thing.name];
        let mut shape = Shape::preview(object, iso, placed, share).map_err(|e| e.to_string())?;
        bounds.extend(shape.bounding_box());
        told.push(News::Patches(shape.all(&thing.name, origin)));
        let solid = Solid::of(object, iso, placed);
        told.extend(solid.map(|solid| News::Solid(thing.name.clone(), Box::new(solid))));
    }
    let all = bounds.into_iter().reduce(Aabb::hull);
    let scene = News::scene(origin, all, things[0].is_volume, false);
    told.push(News::Sheet(Arc::new(Sheet {
        path: path.into(),
        is_untitled: true,
        objects: things,
        chosen: 0,
        history: Vec::new(),
        done: 0,
    })));
    Ok([scene].into_iter().chain(told).collect())
}
