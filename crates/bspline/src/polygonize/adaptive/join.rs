//! A mesh from the parts of its blocks, whole or one block's.

use std::collections::BTreeMap;

use super::live::{AdaptiveBlock, AdaptiveBlockMesh};
use super::octree::Place;
use super::pieces::{Corner, corner};
use super::polygons::EXTRA;
use super::{AdaptiveMesh, AdaptiveReport, add_extras, drop_unused, order_of, report_of};
use crate::polygonize::{Mesh, PolygonizeError};

impl AdaptiveBlockMesh {
    /// The whole mesh; asks the field nothing, and takes time in proportion to the mesh.
    ///
    /// # Errors
    /// [`PolygonizeError::TooManyVertices`].
    pub fn mesh(&self) -> Result<(AdaptiveMesh, AdaptiveReport), PolygonizeError> {
        let (parts, depth) = (&self.parts, self.options.depth);
        let mut order: Vec<(u64, Place)> = parts
            .octree
            .places()
            .map(|place| (order_of(parts.octree.block(place).key, place.0, depth), place))
            .collect();
        order.sort_unstable();
        let mut first: Vec<Vec<u32>> = parts.vertices.iter().map(|v| vec![0; v.len()]).collect();
        let mut made = AdaptiveMesh::default();
        for &(_, place) in &order {
            let own = parts.vertices_of(place);
            first[place.0][place.1 as usize] = made.keys.len() as u32;
            let numbers = 0..own.names.len();
            made.mesh
                .positions
                .extend(numbers.clone().map(|n| parts.position(place, n)));
            made.keys.extend(numbers.map(|n| parts.key(place, n)));
            made.fixed.extend_from_slice(&own.fixed);
            if made.keys.len() >= EXTRA as usize {
                let vertices = made.keys.len() as u64;
                return Err(PolygonizeError::TooManyVertices { vertices });
            }
        }
        let mut report = report_of(&parts.octree.tree, &self.options, self.error);
        report.blocks = parts.octree.len() as u64;
        report.nan_nodes = order
            .iter()
            .map(|(_, p)| u64::from(parts.octree.block(*p).sample.nan_nodes))
            .sum();
        let extras: Vec<_> = order
            .iter()
            .map(|(_, place)| (place.0, &parts.piece_of(*place).extras[..]))
            .collect();
        let before = made.keys.len();
        let extras = add_extras(&self.grids, &extras, &mut made);
        report.extra_vertices = (made.keys.len() - before) as u64;
        let number = |((level, slot), n): (Place, usize)| first[level][slot as usize] + n as u32;
        for (&(_, place), own) in order.iter().zip(&extras) {
            self.each_triangle(place, &mut |corners| {
                let triangle = corners.map(|c| match c {
                    Vertex::Of(place, n) => number((place, n)),
                    Vertex::Extra(n) => own[n],
                });
                made.mesh.triangles.push(triangle);
            });
        }
        if self.options.open {
            drop_unused(&mut made);
        }
        Ok((made, report))
    }

    /// The triangles of one block as a mesh of its own, with copies of the vertices that it shares with others, to the
    /// bit: what is drawn of it. `None` if the block has no triangles. Together the pieces are [`Self::mesh`].
    pub fn piece(&self, block: AdaptiveBlock) -> Option<Mesh> {
        let parts = &self.parts;
        let slot =
            (block.level <= self.options.depth).then(|| parts.octree.slot(block.level, block.block))??;
        let place = (block.level, slot);
        let mut mesh = Mesh::default();
        let mut numbers: BTreeMap<Vertex, u32> = BTreeMap::new();
        self.each_triangle(place, &mut |corners| {
            let triangle = corners.map(|c| {
                *numbers.entry(c).or_insert_with(|| {
                    mesh.positions.push(match c {
                        Vertex::Of(place, n) => parts.position(place, n),
                        Vertex::Extra(n) => self.grids.world(place.0, parts.piece_of(place).extras[n].1),
                    });
                    mesh.positions.len() as u32 - 1
                })
            });
            mesh.triangles.push(triangle);
        });
        (!mesh.triangles.is_empty()).then_some(mesh)
    }

    /// Blocks with triangles, in the order of these in [`Self::mesh`].
    pub fn blocks(&self) -> Vec<AdaptiveBlock> {
        let (parts, depth) = (&self.parts, self.options.depth);
        let full = parts
            .octree
            .places()
            .filter(|p| !parts.piece_of(*p).triangles.is_empty());
        let named = full.map(|place| AdaptiveBlock {
            level: place.0,
            block: parts.octree.block(place).key,
        });
        let mut blocks: Vec<AdaptiveBlock> = named.collect();
        blocks.sort_unstable_by_key(|b| (order_of(b.block, b.level, depth), b.level));
        blocks
    }

    /// Blocks of 8³ cells over all levels.
    pub fn block_count(&self) -> usize {
        self.parts.octree.len()
    }

    /// The triangles of a block, settled or not.
    fn each_triangle(&self, place: Place, take: &mut dyn FnMut([Vertex; 3])) {
        const DRAWN: &str = "what was drawn is there";
        let parts = &self.parts;
        let mut turned = parts.calm_of(place).turned.iter().peekable();
        for (n, t) in parts.piece_of(place).triangles.iter().enumerate() {
            take(match turned.next_if(|(at, _)| *at as usize == n) {
                Some((_, keys)) => keys.map(|key| {
                    let (place, n) = parts.find(key).expect(DRAWN);
                    Vertex::Of(place, n)
                }),
                None => t.map(|code| match corner(code) {
                    Corner::Extra(n) => Vertex::Extra(n),
                    Corner::Of(about, name) => {
                        let holder = parts.about(place, about).expect(DRAWN);
                        Vertex::Of(holder, parts.vertices_of(holder).find(name).expect(DRAWN))
                    }
                }),
            });
        }
    }
}

/// A corner of a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Vertex {
    /// A block's vertex of that number.
    Of(Place, usize),
    /// A further vertex of the piece.
    Extra(usize),
}
