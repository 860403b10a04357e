//! Numbers that a script may say.

use std::fmt;

use glam::DVec3;
use serde::de::{self, Deserializer, Visitor};
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

/// One finite number for all, or one for each.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Numbers(pub Vec<Finite>);

impl Numbers {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;
        impl<'de> Visitor<'de> for Read {
            type Value = Numbers;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or a list of them")
            }

            fn visit_f64<E: de::Error>(self, v: f64) -> Result<Numbers, E> {
                Ok(Numbers(vec![Finite::try_from(v).map_err(E::custom)?]))
            }

            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Numbers, E> {
                self.visit_f64(v as f64)
            }

            fn visit_u64<E: de::Error>(self, v: u64) -> Result<Numbers, E> {
                self.visit_f64(v as f64)
            }

            fn visit_seq<A: de::SeqAccess<'de>>(self, seq: A) -> Result<Numbers, A::Error> {
                Vec::deserialize(de::value::SeqAccessDeserializer::new(seq)).map(Numbers)
            }
        }
        deserializer.deserialize_any(Read)
    }
}

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
