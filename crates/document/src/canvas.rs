//! Objects as tools see them, and what tools leave of them.

use glam::DAffine3;
use tools::body::Body;
use tools::canvas::{Canvas, Placement};
use tools::others::Others;

use crate::{CommandError, Object, State};

/// An object as a tool sees it, with all others beside it.
pub fn canvas(state: &State, name: &str) -> Result<Canvas<Body>, CommandError> {
    let object = state.object(name)?;
    let iso = object.iso();
    Ok(Canvas {
        detail: object.detail(),
        density: object.density(),
        field: object.field.clone(),
        iso: iso.ok_or_else(|| CommandError::NoSurface(name.into()))?,
        layers: object.layers.clone(),
        holds: object.properties.holds.clone(),
        placement: placement(state, object)?,
        material: object.properties.material,
        others: others(state, name)?,
        copies: Vec::new(),
    })
}

/// The state with what a tool left of an object, and with the copies that it made of it.
pub fn left(state: &State, name: &str, canvas: Canvas<Body>) -> Result<State, CommandError> {
    let object = state.object(name)?;
    let mut next = state.clone();
    for copy in canvas.copies {
        if state.object(&copy).is_ok() {
            return Err(CommandError::Taken(copy));
        }
        next = next.with(&copy, object.clone())?;
    }
    let mut shaped = object.clone().with_shape(canvas.field, canvas.layers);
    shaped.properties.holds = canvas.holds;
    shaped.properties.set_placement(canvas.placement.map);
    shaped.properties.parent = canvas.placement.parent;
    shaped.properties.material = canvas.material;
    shaped.properties.iso = Some(canvas.iso).filter(|iso| shaped.meta.iso != Some(*iso));
    Ok(next.with(name, shaped)?)
}

/// Where an object lies, in its parent's world and in that.
fn placement(state: &State, object: &Object) -> Result<Placement, CommandError> {
    let parent = object.properties.parent.clone();
    Ok(Placement {
        map: object.properties.parent_from_object(),
        shared_from_parent: match &parent {
            Some(name) => state.placement(name)?,
            None => DAffine3::IDENTITY,
        },
        parent,
    })
}

/// All objects that have a surface, as they lie to the one of a name.
pub fn others(state: &State, name: &str) -> Result<Others, CommandError> {
    let own = state.placement(name)?;
    let mut others = Others::default();
    for (other, object) in state.objects() {
        if let Some(iso) = object.iso() {
            // Of what lies alike no rounding.
            let placement = state.placement(other)?;
            let map = match placement == own {
                true => DAffine3::IDENTITY,
                false => own.inverse() * placement,
            };
            let put = others.put(other, &object.field, iso, map, object.density().is_some());
            put.map_err(|e| CommandError::Script(format!("object {other:?} cannot be used: {e}")))?;
        }
    }
    Ok(others)
}
