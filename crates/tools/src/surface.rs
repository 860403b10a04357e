//! Where the surface of an object is: at which density.

use serde::{Deserialize, Serialize};

use crate::canvas::Canvas;
use crate::malleable::Malleable;
use crate::number::Finite;

/// Says which density is the surface of the object, without a change of its field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// The iso-value, in the unit of the field's densities.
    pub iso: Finite,
}

impl Surface {
    /// The iso-value of a canvas after it.
    ///
    /// # Errors
    /// A sentence, if the field cannot have that density.
    pub fn apply<F: Malleable>(&self, canvas: &Canvas<F>) -> Result<f64, String> {
        let iso = self.iso.0;
        let range = canvas.field.bounds(&canvas.field.whole());
        if !(range.lo..=range.hi).contains(&iso) {
            return Err(format!(
                "surface: iso is {iso}; densities run from {:.6} to {:.6}, choose one between them",
                range.lo, range.hi
            ));
        }
        Ok(iso)
    }
}
