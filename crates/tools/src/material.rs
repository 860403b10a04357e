//! What an object is by itself.

use serde::{Deserialize, Serialize};

use crate::force::Solid;

/// What an object is, where a stroke says nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// What stays when a force tool is let go.
    pub solid: Solid,
}
