//! Fields as the journal has them, whatever they are made of.

use std::path::Path;

use formats::field::{FieldMeta, KNOTS_MAGIC};
use formats::{Fault, ReadLimits, field};
use tools::body::{Body, BodyDiff};

use crate::error::{damaged, fault};
use crate::{DocumentError, Object};

/// The bytes of a field and of what came with it.
pub(crate) fn encode(body: &Body, meta: &FieldMeta) -> Result<Vec<u8>, Fault> {
    match body {
        Body::Levels(field) => field::encode(field, meta),
        Body::Knots(field) => field::encode_knots(field, meta),
    }
}

/// The object of such bytes: its first ones say what its field is made of.
pub(crate) fn decode(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Object, DocumentError> {
    let wrong = |f| fault(path, f);
    if bytes.starts_with(&KNOTS_MAGIC) {
        let (field, meta) = field::decode_knots(bytes, limits).map_err(wrong)?;
        let body = Body::Knots(field);
        let lattice = body.lattice();
        let map = lattice.world_from_lattice;
        if !map.is_finite() || !map.inverse().is_finite() || lattice.cells.contains(&0) {
            return Err(damaged(
                path,
                "the box of a spline is too small, or too large, for numbers",
            ));
        }
        return Ok(Object::of(body, meta));
    }
    let loaded = field::decode(bytes, limits).map_err(wrong)?;
    Object::new(&loaded.field, loaded.meta).map_err(|e| damaged(path, e.to_string()))
}

/// The bytes of a difference.
pub(crate) fn encode_difference(diff: &BodyDiff) -> Result<Vec<u8>, Fault> {
    match diff {
        BodyDiff::Levels(diff) => field::encode_difference(diff),
        BodyDiff::Knots(diff) => field::encode_knots_difference(diff),
    }
}

/// A difference of a version of `body`.
pub(crate) fn decode_difference(bytes: &[u8], body: &Body, limits: &ReadLimits) -> Result<BodyDiff, Fault> {
    match body {
        Body::Levels(known) => field::decode_difference(bytes, known.lattice(), limits).map(BodyDiff::Levels),
        Body::Knots(_) => field::decode_knots_difference(bytes, limits).map(BodyDiff::Knots),
    }
}
