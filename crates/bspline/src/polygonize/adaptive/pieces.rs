//! The parts of an adaptive mesh, one a block, which name the vertices that they share.

use glam::{DAffine3, DVec3};

use super::around::Around;
use super::grid::{NONE, cell_index};
use super::octree::{Octree, Place};
use super::polygons::{BlockTriangles, EXTRA, ExtraKey, Numbered};
use super::vertices::{BlockVertices, LOOP_BITS, PLACE_BITS, key_of};
use crate::polygonize::PolygonizeError;
use crate::polygonize::blocks::CELLS;

/// A vertex of the mesh: its block and number there.
pub(super) type At = (Place, usize);

/// Bits of a corner for the name of its vertex within its block.
const NAME_BITS: u32 = 9 + LOOP_BITS;

/// The triangles of a block.
///
/// A corner is [`EXTRA`] and the number of a further vertex, or the number of a neighbour, of those of the block before
/// those of its parent, and the name of a vertex in it: what does not change with other blocks' numbers of vertices.
#[derive(Default, PartialEq)]
pub(super) struct Piece {
    pub triangles: Vec<[u32; 3]>,
    pub extras: Vec<(ExtraKey, DVec3)>,
}

/// How a block's vertices and triangles have settled.
#[derive(Default)]
pub(super) struct Calm {
    pub positions: Vec<DVec3>,
    /// Triangles that are not as drawn, by number, with the keys of their vertices.
    pub turned: Vec<(u32, [u64; 3])>,
}

impl Calm {
    pub fn turned(&self, triangle: u32) -> Option<[u64; 3]> {
        let at = self.turned.binary_search_by_key(&triangle, |t| t.0).ok()?;
        Some(self.turned[at].1)
    }
}

/// The parts of a mesh, by level and slot of the octree.
pub(super) struct Parts {
    pub octree: Octree,
    pub vertices: Vec<Vec<BlockVertices>>,
    pub pieces: Vec<Vec<Piece>>,
    /// Empty for a mesh that does not settle.
    pub calm: Vec<Vec<Calm>>,
}

/// What pieces are drawn by, beside the octree.
pub(super) struct Pen<'a> {
    pub cells: [i32; 3],
    pub mirrored: bool,
    pub grid_from_world: &'a [DAffine3],
    pub open: bool,
}

/// A corner of a piece.
#[derive(Clone, Copy)]
pub(super) enum Corner {
    /// A vertex: the number of its block among those about the piece's, and its name.
    Of(usize, u16),
    /// A further vertex of the piece.
    Extra(usize),
}

pub(super) fn corner(code: u32) -> Corner {
    match code.checked_sub(EXTRA) {
        Some(n) => Corner::Extra(n as usize),
        None => Corner::Of(
            (code >> NAME_BITS) as usize,
            (code & ((1 << NAME_BITS) - 1)) as u16,
        ),
    }
}

/// Blocks about one that corners may lie in.
pub(super) const ABOUT: usize = 54;

impl Parts {
    pub fn new(depth: usize) -> Self {
        let levels = || 0..=depth;
        Self {
            octree: Octree::new(depth),
            vertices: levels().map(|_| Vec::new()).collect(),
            pieces: levels().map(|_| Vec::new()).collect(),
            calm: levels().map(|_| Vec::new()).collect(),
        }
    }

    pub fn vertices_of(&self, (level, slot): Place) -> &BlockVertices {
        &self.vertices[level][slot as usize]
    }

    pub fn piece_of(&self, (level, slot): Place) -> &Piece {
        &self.pieces[level][slot as usize]
    }

    pub fn calm_of(&self, (level, slot): Place) -> &Calm {
        &self.calm[level][slot as usize]
    }

    /// The block of that number about another one.
    pub fn about(&self, place: Place, number: usize) -> Option<Place> {
        let block = self.octree.block(place);
        let found = match number.checked_sub(27) {
            None => (place.0, block.neighbours[number]),
            Some(_) if block.parent == NONE => return None,
            Some(n) => {
                let above = (place.0 - 1, block.parent);
                (above.0, self.octree.block(above).neighbours[n])
            }
        };
        (found.1 != NONE).then_some(found)
    }

    /// Draws the triangles of a block anew.
    pub fn draw(&self, pen: &Pen, place: Place) -> Result<Piece, PolygonizeError> {
        let (level, _) = place;
        let tree = &self.octree.tree;
        let block = self.octree.block(place);
        let above: &[u32] = match block.parent {
            NONE => &[],
            n => &tree[level - 1][n as usize].neighbours,
        };
        let numbered = Numbered {
            vertices: &self.vertices,
            first: |at: usize, slot: usize| {
                let (offset, among) = if at == level {
                    (0, &block.neighbours[..])
                } else {
                    (27, above)
                };
                let number = among.iter().position(|n| *n == slot as u32);
                ((offset + number.expect("a neighbour")) as u32) << NAME_BITS
            },
            cells: pen.cells,
            mirrored: pen.mirrored,
            grid_from_world: pen.grid_from_world,
            depth: tree.len() - 1,
            open: pen.open,
        };
        let mut drawn = BlockTriangles::default();
        numbered.triangles(&Around::new(tree, level, block), &mut drawn)?;
        let BlockTriangles {
            mut triangles,
            extras,
        } = drawn;
        for code in triangles.as_flattened_mut() {
            if let Corner::Of(number, index) = corner(*code) {
                let holder = self.about(place, number).expect("it was numbered");
                let name = self.vertices_of(holder).names[usize::from(index)];
                *code = (number as u32) << NAME_BITS | u32::from(name);
            }
        }
        Ok(Piece { triangles, extras })
    }

    /// Where a vertex is, settled or not.
    pub fn position(&self, place: Place, number: usize) -> DVec3 {
        let calm = &self.calm_of(place).positions;
        *calm
            .get(number)
            .unwrap_or_else(|| &self.vertices_of(place).positions[number])
    }

    /// Key of a block's vertex: its place in the octree, whatever its number.
    pub fn key(&self, place: Place, number: usize) -> u64 {
        let (octree, name) = (&self.octree, self.vertices_of(place).names[number]);
        key_of(octree.tree.len() - 1, place.0, octree.block(place).key, name)
    }

    /// Block and number of the vertex with that key.
    pub fn find(&self, key: u64) -> Option<(Place, usize)> {
        let depth = self.octree.tree.len() - 1;
        let at: [i64; 3] = std::array::from_fn(|a| {
            let bits = key >> (LOOP_BITS + PLACE_BITS * (2 - a as u32)) & ((1 << PLACE_BITS) - 1);
            bits as i64 - (1 << depth)
        });
        let coarse = at.map(|x| ((x >> depth) >> 3) as i32);
        let mut place = (0, self.octree.slot(0, coarse)?);
        loop {
            let block = self.octree.block(place);
            let cell = at.map(|x| (x >> (depth - place.0)) as usize % CELLS);
            if !super::grid::holds(&block.split, cell) {
                let number = (key & ((1 << LOOP_BITS) - 1)) as u16;
                let name = (cell_index(cell) as u16) << LOOP_BITS | number;
                let is_its = key_of(depth, place.0, block.key, name) == key;
                let found = self.vertices_of(place).find(name).filter(|_| is_its)?;
                return Some((place, found));
            }
            let next = block.children[super::grid::octant_with(cell)];
            place = (place.0 + 1, (next != NONE).then_some(next)?);
        }
    }
}
