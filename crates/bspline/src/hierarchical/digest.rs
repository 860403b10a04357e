use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::node::Node;
use crate::Real;

/// Functions below a node from which on its children are hashed side by side.
const SIDE_BY_SIDE: u64 = 20_000;

impl<T: Real> Node<T> {
    /// SHA-256 over the functions here and below, however deep the tree above is: whether the node has functions, these,
    /// then the digests of the children that hold some, each behind its octant (`docs/format.md`).
    pub fn digest(&self) -> &[u8; 32] {
        self.digest.get_or_init(|| of(self))
    }
}

fn of<T: Real>(node: &Node<T>) -> [u8; 32] {
    if node.count >= SIDE_BY_SIDE {
        node.children.par_iter().flatten().for_each(|c| {
            c.digest();
        });
    }
    let mut hash = Sha256::new();
    hash.update([u8::from(node.corrections.is_some())]);
    if let Some(c) = &node.corrections {
        let mut bytes = Vec::with_capacity(64 + size_of_val(c.values()));
        c.mask().iter().for_each(|m| bytes.extend(m.to_le_bytes()));
        c.values().iter().for_each(|v| v.extend_le_bytes(&mut bytes));
        hash.update(&bytes);
    }
    for (octant, child) in node.children.iter().enumerate() {
        if let Some(child) = child.as_ref().filter(|c| c.count > 0) {
            hash.update([octant as u8]);
            hash.update(child.digest());
        }
    }
    hash.finalize().into()
}
