//! A number or a formula.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use super::formula::Formula;
use crate::number::NonNegative;

/// The same everywhere, or by a formula.
#[derive(Clone, Debug)]
pub enum Amount {
    /// The same everywhere.
    Constant(f64),
    /// By position and density.
    Formula(Box<Formula>),
}

impl<'de> Deserialize<'de> for Amount {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;
        impl Visitor<'_> for Read {
            type Value = Amount;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or a formula in quotes")
            }

            fn visit_f64<E: de::Error>(self, v: f64) -> Result<Amount, E> {
                let value = NonNegative::try_from(v).map_err(E::custom)?;
                Ok(Amount::Constant(value.0))
            }

            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Amount, E> {
                self.visit_f64(v as f64)
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<Amount, E> {
                let formula = Formula::parse(v).map_err(E::custom)?;
                Ok(Amount::Formula(Box::new(formula)))
            }
        }
        deserializer.deserialize_any(Read)
    }
}
