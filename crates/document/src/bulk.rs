use std::path::Path;

use formats::ReadLimits;

use crate::body;
use crate::error::damaged;
use crate::{DocumentError, Object, Properties};

/// The second part of a record, read from its start in pieces that the first part tells the lengths of.
pub(crate) struct Bulk<'a> {
    pub rest: &'a [u8],
    /// For messages.
    pub path: &'a Path,
    pub limits: &'a ReadLimits,
}

impl<'a> Bulk<'a> {
    /// The next so many bytes.
    pub fn take(&mut self, count: u64) -> Result<&'a [u8], DocumentError> {
        let own = usize::try_from(count)
            .ok()
            .and_then(|n| self.rest.split_at_checked(n));
        let (own, rest) = own.ok_or_else(|| damaged(self.path, "a record is shorter than it says"))?;
        self.rest = rest;
        Ok(own)
    }

    /// The object whose field takes so many bytes, without its layers.
    pub fn object(&mut self, count: u64, properties: &Properties) -> Result<Object, DocumentError> {
        let path = self.path;
        let object = body::decode(self.take(count)?, path, self.limits)?;
        Ok(Object {
            properties: properties.clone(),
            ..object
        })
    }
}

/// Appends a part, and tells its length. The first is taken over as it is: that of a large scan takes hundreds of megabytes.
pub(crate) fn put(part: Vec<u8>, bytes: &mut Vec<u8>) -> u64 {
    let length = part.len() as u64;
    match bytes.is_empty() {
        true => *bytes = part,
        false => bytes.extend_from_slice(&part),
    }
    length
}
