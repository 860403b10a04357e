use glam::DVec3;

use super::octree::Place;
use super::pieces::{At, Parts};

/// What has settled otherwise than before.
#[derive(Default)]
pub(super) struct Splice {
    pub positions: Vec<(At, DVec3)>,
    /// Triangles by block and number, with the keys of their corners if they are not as drawn; those of a block
    /// follow each other.
    pub triangles: Vec<(Place, u32, Option<[u64; 3]>)>,
    pub changed: Vec<Place>,
}

impl Splice {
    /// Writes it into the parts; gives the blocks that it is in.
    pub fn put(self, parts: &mut Parts) -> Vec<Place> {
        for (((level, slot), number), to) in self.positions {
            parts.calm[level][slot as usize].positions[number] = to;
        }
        for part in self.triangles.chunk_by(|a, b| a.0 == b.0) {
            let (level, slot) = part[0].0;
            let turned = &mut parts.calm[level][slot as usize].turned;
            turned.retain(|(number, _)| part.binary_search_by_key(number, |(_, n, _)| *n).is_err());
            turned.extend(part.iter().filter_map(|(_, n, to)| Some((*n, (*to)?))));
            turned.sort_unstable();
        }
        self.changed
    }
}
