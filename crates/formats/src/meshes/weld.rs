//! Corners at the same place made one vertex.

use std::collections::HashMap;

use glam::DVec3;

use crate::Fault;
use crate::limits::{Budget, Counted};

/// Bytes of an entry of the table, at the load that it grows at.
const ENTRY: usize = 2 * (size_of::<([u64; 3], u32)>() + 1);

/// Numbers positions; equal bits get equal numbers, and both zeros are one.
pub(super) struct Welder {
    pub positions: Counted<DVec3>,
    // Looked up, never walked, so that its random keys (files cannot be made to collide) change no result.
    number: HashMap<[u64; 3], u32>,
}

impl Welder {
    pub fn new() -> Self {
        Self {
            positions: Counted::new("vertices"),
            number: HashMap::new(),
        }
    }

    /// The number of the vertex at `p`, a new one if there is none yet.
    pub fn vertex(&mut self, p: DVec3, budget: &mut Budget) -> Result<u32, Fault> {
        let key = (p + DVec3::ZERO).to_array().map(f64::to_bits);
        if let Some(v) = self.number.get(&key) {
            return Ok(*v);
        }
        if self.number.len() == self.number.capacity() {
            let grow = self.number.len().max(256);
            budget.reserve("the table of vertices", grow as u64, ENTRY)?;
            self.number.reserve(grow);
        }
        let v = self.positions.items.len() as u32;
        self.number.insert(key, v);
        self.positions.push(p, budget)?;
        Ok(v)
    }
}
