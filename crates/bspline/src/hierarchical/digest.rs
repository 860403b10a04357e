use std::collections::BTreeMap;

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::brick::{BrickKey, Corrections, LevelCorrections};
use super::node::{Node, crown, octant};
use super::{HierarchicalSpline, Lattice};
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
    let mut hash = begun(node.corrections.as_deref());
    for (octant, child) in node.children.iter().enumerate() {
        if let Some(child) = child.as_ref().filter(|c| c.count > 0) {
            hash.update([octant as u8]);
            hash.update(child.digest());
        }
    }
    hash.finalize().into()
}

/// The digest of a node as far as its own functions go.
fn begun<T: Real>(corrections: Option<&Corrections<T>>) -> Sha256 {
    let mut hash = Sha256::new();
    hash.update([u8::from(corrections.is_some())]);
    if let Some(c) = corrections {
        let mut bytes = Vec::with_capacity(64 + size_of_val(c.values()));
        c.mask().iter().for_each(|m| bytes.extend(m.to_le_bytes()));
        c.values().iter().for_each(|v| v.extend_le_bytes(&mut bytes));
        hash.update(&bytes);
    }
    hash
}

/// The digest of a brick and of all finer ones in its place, without a field; none if they have no functions. `levels`
/// begin with the brick's own.
pub fn digest_below<T: Real>(levels: &[LevelCorrections<T>], key: BrickKey) -> Option<[u8; 32]> {
    let (level, finer) = levels.split_first()?;
    let own = level.get(&key).filter(|c| c.count() > 0);
    let children: Vec<_> = (0..8)
        .filter_map(|octant| Some((octant as u8, digest_below(finer, key.child(octant))?)))
        .collect();
    if own.is_none() && children.is_empty() {
        return None;
    }
    let mut hash = begun(own.map(|c| &**c));
    for (octant, child) in children {
        hash.update([octant]);
        hash.update(child);
    }
    Some(hash.finalize().into())
}

impl<T: Real> HierarchicalSpline<T> {
    /// What [`Self::sha256`] is of a field that nobody holds, from the digests ([`digest_below`]) of its bricks of level 0.
    pub fn sha256_of_bricks(
        lattice: &Lattice,
        slope: f64,
        mut bricks: BTreeMap<BrickKey, [u8; 32]>,
    ) -> [u8; 32] {
        for _ in 0..crown(lattice) {
            let mut above: BTreeMap<BrickKey, Sha256> = BTreeMap::new();
            for (key, digest) in bricks {
                let hash = above.entry(key.parent()).or_insert_with(|| begun::<T>(None));
                // Keys are in order, and so are the octants of one parent.
                hash.update([octant(key.0, 0) as u8]);
                hash.update(digest);
            }
            bricks = (above.into_iter())
                .map(|(key, hash)| (key, hash.finalize().into()))
                .collect();
        }
        let root = bricks.into_values().next();
        let root = root.unwrap_or_else(|| begun::<T>(None).finalize().into());
        Self::identity(lattice, slope, &root)
    }

    /// SHA-256 of a box, its map, its slope, and the digest of the root.
    pub(super) fn identity(lattice: &Lattice, slope: f64, root: &[u8; 32]) -> [u8; 32] {
        let mut hash = Sha256::new();
        hash.update(b"isoclay-field-2");
        hash.update(T::NAME);
        for n in lattice.cells {
            hash.update(n.to_le_bytes());
        }
        for x in lattice.world_from_lattice.to_cols_array() {
            hash.update(x.to_le_bytes());
        }
        hash.update(slope.to_le_bytes());
        hash.update(root);
        hash.finalize().into()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DAffine3;

    use super::super::brick::BRICK;
    use super::*;

    /// Lattices whose root is a brick, or lies some halvings above; empty bricks, levels and fields.
    #[test]
    fn a_hash_from_bricks_is_that_of_the_field() {
        let mut seed = 3u64;
        let mut next = |n: u32| {
            seed = seed
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (seed >> 33) as u32 % n
        };
        for cells in [[5, 4, 3], [12, 8, 20], [40, 6, 70]] {
            let lattice = Lattice {
                cells,
                world_from_lattice: DAffine3::IDENTITY,
            };
            for count in [0, 1, 9, 300] {
                let levels: Vec<LevelCorrections<f32>> = (0..3)
                    .map(|level| {
                        let mut bricks: BTreeMap<BrickKey, Corrections<f32>> = BTreeMap::new();
                        bricks.insert(BrickKey([0; 3]), Corrections::empty());
                        for _ in 0..count {
                            let function = lattice.cells_at(level).map(|n| next(n + 3));
                            let brick = bricks.entry(BrickKey::of(function));
                            let slot = function.map(|s| s as usize % BRICK);
                            brick
                                .or_insert_with(Corrections::empty)
                                .set(slot, next(9) as f32 - 4.0);
                        }
                        bricks.into_iter().map(|(key, c)| (key, Arc::new(c))).collect()
                    })
                    .collect();
                let keys: Vec<BrickKey> = {
                    let last = cells.map(|n| (n + 2) / BRICK as u32);
                    let rows =
                        (0..=last[0]).flat_map(move |x| (0..=last[1]).map(move |y| (x, y, 0..=last[2])));
                    rows.flat_map(|(x, y, z)| z.map(move |z| BrickKey([x, y, z])))
                        .collect()
                };
                let bricks = keys
                    .into_iter()
                    .filter_map(|key| Some((key, digest_below(&levels, key)?)));
                let of_bricks = HierarchicalSpline::<f32>::sha256_of_bricks(&lattice, 0.5, bricks.collect());
                let field = HierarchicalSpline::from_corrections(lattice, 0.5, levels);
                assert_eq!(of_bricks, field.sha256(), "{cells:?}, {count}");
            }
        }
    }
}
