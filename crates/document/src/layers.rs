//! Layers of paint as the journal has them: each as the difference from a layer on which nothing is painted.

use std::path::Path;

use bspline::hierarchical::{BrickDiff, Lattice};
use formats::field::{decode_difference, encode_difference};
use serde::{Deserialize, Serialize};
use tools::paint::{Layer, Layers, Substance};

use crate::bulk::{Bulk, put};
use crate::error::{damaged, fault};
use crate::{DocumentError, Object};

/// A layer, or a difference of two, in JSON; its bytes follow elsewhere.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LayerHead {
    pub layer: Substance,
    /// Level of the object's lattice whose knots are its nodes.
    pub level: usize,
    pub bytes: u64,
}

/// Writes layers of an object on `lattice` behind `bytes`.
pub(crate) fn write(
    layers: &Layers,
    lattice: &Lattice,
    path: &Path,
    bytes: &mut Vec<u8>,
) -> Result<Vec<LayerHead>, DocumentError> {
    let painted = layers.iter().filter(|(_, layer)| !layer.is_empty());
    let heads = painted.map(|(substance, layer)| {
        let empty = Layer::empty(lattice, layer.level());
        let difference = empty.tree().difference(layer.tree());
        let difference = difference.map_err(|e| damaged(path, e.to_string()))?;
        write_difference(*substance, layer.level(), &difference, path, bytes)
    });
    heads.collect()
}

pub(crate) fn write_difference(
    layer: Substance,
    level: usize,
    difference: &BrickDiff<f32>,
    path: &Path,
    bytes: &mut Vec<u8>,
) -> Result<LayerHead, DocumentError> {
    let own = encode_difference(difference).map_err(|f| fault(path, f))?;
    let bytes = put(own, bytes);
    Ok(LayerHead { layer, level, bytes })
}

/// Reads the layers of an object that was read before.
pub(crate) fn read(object: Object, heads: &[LayerHead], bulk: &mut Bulk) -> Result<Object, DocumentError> {
    let lattice = &object.field.lattice();
    let layers = heads.iter().map(|head| {
        let difference = read_difference(head, bulk, lattice)?;
        let empty = Layer::empty(lattice, head.level);
        let layer = followed(&empty, &difference).map_err(|why| damaged(bulk.path, why))?;
        Ok::<_, DocumentError>((head.layer, layer))
    });
    Ok(Object {
        layers: layers.collect::<Result<_, _>>()?,
        ..object
    })
}

pub(crate) fn read_difference(
    head: &LayerHead,
    bulk: &mut Bulk,
    lattice: &Lattice,
) -> Result<BrickDiff<f32>, DocumentError> {
    if head.level >= bspline::hierarchical::MAX_LEVELS {
        return Err(damaged(bulk.path, format!("a layer is on level {}", head.level)));
    }
    let empty = Layer::empty(lattice, head.level);
    decode_difference(bulk.take(head.bytes)?, empty.tree().lattice(), bulk.limits)
        .map_err(|f| fault(bulk.path, f))
}

/// The layer at the other end of a difference.
pub(crate) fn followed(layer: &Layer, difference: &BrickDiff<f32>) -> Result<Layer, String> {
    let tree = layer.tree().applied(difference).map_err(|e| e.to_string())?;
    layer.with_tree(tree).map_err(|e| e.to_string())
}
