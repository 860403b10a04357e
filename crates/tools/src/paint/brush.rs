use bspline::Aabb;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::number::{NonNegative, Point, Positive};

/// A brush drawn along a path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Brush {
    /// What is painted where the brush is full.
    pub value: NonNegative,
    /// Where its centre goes: one place, or the corners of a polyline.
    pub along: Vec<Point>,
    /// How far it reaches, a world length.
    pub radius: Positive,
    /// Part of the radius over which it fades linearly, 0 to 1: from its centre to its rim if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fade: Option<NonNegative>,
    /// Part of the way to the value that one stroke goes, above 0 to 1: all of it if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<Positive>,
}

impl Brush {
    /// The box that it reaches.
    ///
    /// # Errors
    /// A sentence, for a path without places, a fade or a rate beyond 1.
    pub(super) fn reach(&self) -> Result<Aabb, String> {
        for (name, part) in [("fade", self.fade.map(|f| f.0)), ("rate", self.rate.map(|r| r.0))] {
            if let Some(part) = part.filter(|part| *part > 1.0) {
                return Err(format!("{name} is {part}; it is at most 1"));
            }
        }
        let path = Aabb::about(self.along.iter().map(|p| p.0));
        let path = path.ok_or("the brush has no place; write at least one under along")?;
        Ok(path.widened(self.radius.0))
    }

    /// Part of the way to the value that it goes at a place, 0 to 1.
    pub(super) fn weight(&self, p: DVec3) -> f64 {
        let inside = 1.0 - distance(p, &self.along) / self.radius.0;
        let fade = self.fade.map_or(1.0, |f| f.0);
        let rate = self.rate.map_or(1.0, |r| r.0);
        match (inside <= 0.0, inside >= fade) {
            (true, _) => 0.0,
            (_, true) => rate,
            _ => rate * inside / fade,
        }
    }
}

/// From a place to a point or a polyline.
pub fn distance(p: DVec3, along: &[Point]) -> f64 {
    let points = along.iter().map(|p| p.0);
    let to_segment = |(a, b): (DVec3, DVec3)| {
        let ab = b - a;
        let t = if ab == DVec3::ZERO {
            0.0
        } else {
            ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0)
        };
        p.distance(a + t * ab)
    };
    let ends = points.clone().map(|a| p.distance(a));
    let segments = points.clone().zip(points.skip(1)).map(to_segment);
    ends.chain(segments).fold(f64::INFINITY, f64::min)
}
