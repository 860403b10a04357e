//! Numbers that a script may say.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A number that is finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64")]
pub struct Finite(pub f64);

/// A number above 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64")]
pub struct Positive(pub f64);

/// A number that is 0 or above.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64")]
pub struct NonNegative(pub f64);

/// A place or a displacement in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "[Finite; 3]", into = "[f64; 3]")]
pub struct Point(pub DVec3);

impl TryFrom<f64> for Finite {
    type Error = String;

    fn try_from(v: f64) -> Result<Self, String> {
        if v.is_finite() {
            Ok(Self(v))
        } else {
            Err(format!("{v} is not finite; write a finite number"))
        }
    }
}

impl TryFrom<f64> for Positive {
    type Error = String;

    fn try_from(v: f64) -> Result<Self, String> {
        if v.is_finite() && v > 0.0 {
            Ok(Self(v))
        } else {
            Err(format!("{v} is not positive; write a finite number above 0"))
        }
    }
}

impl TryFrom<f64> for NonNegative {
    type Error = String;

    fn try_from(v: f64) -> Result<Self, String> {
        if v.is_finite() && v >= 0.0 {
            Ok(Self(v))
        } else {
            Err(format!(
                "{v} is negative or not finite; write 0 or a finite number above it"
            ))
        }
    }
}

impl From<[Finite; 3]> for Point {
    fn from(p: [Finite; 3]) -> Self {
        Self(DVec3::from_array(p.map(|c| c.0)))
    }
}

impl From<Point> for [f64; 3] {
    fn from(p: Point) -> Self {
        p.0.to_array()
    }
}
