//! Sessions: what is to be done to a document, stroke after stroke.

use serde::{Deserialize, Serialize};

use crate::geometric::{Geometric, Operation};

/// What a session file says.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// In their order.
    pub stroke: Vec<Stroke>,
}

/// One use of a tool: exactly one of the tools is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Object that it works on; needed where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// Takes a solid out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub carve: Option<Geometric>,
    /// Adds a solid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub add: Option<Geometric>,
}

impl Stroke {
    /// The tool.
    ///
    /// # Errors
    /// A sentence, if there is none or more than one.
    pub fn tool(&self) -> Result<(Operation, &Geometric), String> {
        match (&self.carve, &self.add) {
            (Some(tool), None) => Ok((Operation::Carve, tool)),
            (None, Some(tool)) => Ok((Operation::Add, tool)),
            (None, None) => Err("no tool is given; write carve or add".into()),
            (Some(_), Some(_)) => Err("carve and add are given; write a stroke for each".into()),
        }
    }
}
