//! The fields of a header, before they are understood.

use std::collections::BTreeMap;

use crate::Fault;
use crate::error::excerpt;

/// Values by the names of their fields, in small letters without blanks.
#[derive(Debug, Default)]
pub(super) struct Fields {
    /// Line number and value.
    pub values: BTreeMap<String, (u64, String)>,
}

impl Fields {
    /// The value of a field; the names of a few have been written with and without a blank, which are the same here.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.values.get(name).map(|(_, v)| v.as_str())
    }

    pub fn required(&self, name: &'static str) -> Result<&str, Fault> {
        self.get(name).ok_or_else(|| Fault::Value {
            what: "a field of the header",
            value: format!("{name:?}, and missing"),
            remedy: "a NRRD header has type, dimension, sizes and encoding; is it whole?",
        })
    }

    /// A fault of the field called `name`.
    pub fn bad(&self, name: &str, remedy: &'static str) -> Fault {
        let (line, value) = self.values.get(name).cloned().unwrap_or_default();
        Fault::line(line, format!("{name} is {}", excerpt(value.as_bytes())), remedy)
    }

    /// Numbers between blanks.
    pub fn numbers<T: std::str::FromStr>(&self, name: &str) -> Result<Option<Vec<T>>, Fault> {
        let Some(value) = self.get(name) else {
            return Ok(None);
        };
        let numbers: Result<Vec<T>, _> = value.split_whitespace().map(str::parse).collect();
        numbers
            .map(Some)
            .map_err(|_| self.bad(name, "numbers with blanks between them are needed"))
    }
}
