//! Where a brush goes, and the places of a part of its way.

use glam::DVec3;

use super::{MOST, wrong};
use crate::force::Path;
use crate::geometric::GeometricError;
use crate::number::Point;

/// Where a brush goes.
pub(super) enum Way {
    /// Nowhere.
    Place(DVec3),
    Path(Path),
}

impl Way {
    pub fn through(along: &[Point]) -> Result<Self, GeometricError> {
        let places = along.iter().map(|p| p.0);
        let Some(first) = places.clone().next() else {
            return wrong("along has no place; write at least one point".into());
        };
        Ok(match Path::through(places) {
            Ok(path) => Self::Path(path),
            // Points of a script are finite, so they are all one.
            Err(_) => Self::Place(first),
        })
    }

    /// Middles of equal pieces of a part of it, told by shares of its length.
    pub fn part(&self, [from, to]: [f64; 2], apart: f64) -> Result<Vec<DVec3>, GeometricError> {
        let path = match self {
            Self::Place(at) => return Ok(vec![*at]),
            Self::Path(path) => path,
        };
        let count = ((to - from) * path.length() / apart).ceil().max(1.0);
        if count > f64::from(MOST) {
            return wrong(format!(
                "a step would go over {count} places; take a wider brush, or go a shorter way"
            ));
        }
        let share = |n: u32| from + (to - from) * (f64::from(n) + 0.5) / count;
        Ok((0..count as u32)
            .map(|n| path.at(share(n) * path.length()))
            .collect())
    }
}
