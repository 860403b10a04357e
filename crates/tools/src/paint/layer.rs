use bspline::hierarchical::{BlockEdit, Change, EditError, Lattice, LevelCorrections, MAX_LEVELS, shifted};
use bspline::{Aabb, HierarchicalSpline};
use glam::{DAffine3, DMat3, DVec3};

/// Cells of a layer's coarsest level along its longest axis, at most.
const COARSEST: u32 = 8;

/// Places beside those asked for that are read to save looking them up one by one.
const SPARE: usize = 64;

/// Numbers at the nodes of one level of a lattice, linear between them, 0 where nothing was painted.
///
/// They are kept in a tree of bricks, as the coefficients of a field are, so that versions share what is equal and differ by
/// bricks; but they are read as they stand, not as coefficients: what was painted at a node is there to the bit.
#[derive(Clone, Debug)]
pub struct Layer {
    tree: HierarchicalSpline<f32>,
    /// Level of the tree that holds the numbers.
    depth: usize,
    /// Level of the object's lattice that has the same nodes.
    level: usize,
}

/// Why a layer cannot be.
#[derive(Debug, thiserror::Error)]
pub enum LayerError {
    /// The tree refuses a number.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The tree has numbers on several levels, or lies elsewhere.
    #[error("a layer of paint does not fit its object")]
    Foreign,
}

/// Levels that a layer's tree has above those of `lattice`, so that an empty one costs nothing.
fn coarser(lattice: &Lattice, level: usize) -> usize {
    let longest = lattice.cells.into_iter().max().unwrap_or(1);
    let enough = (0..MAX_LEVELS).find(|n| longest.div_ceil(1 << n) <= COARSEST);
    enough.unwrap_or(MAX_LEVELS).min(MAX_LEVELS - 1 - level)
}

/// Where the coarsest level of a layer lies that has so many levels above those of a lattice.
fn coarse_map(world_from_lattice: DAffine3, coarser: usize) -> DAffine3 {
    let step = DMat3::from_diagonal(DVec3::splat((1u64 << coarser) as f64));
    world_from_lattice * DAffine3::from_mat3(step)
}

impl Layer {
    /// Nothing painted over the box of `lattice`; nodes are as far apart as the knots of its `level`.
    pub fn empty(lattice: &Lattice, level: usize) -> Self {
        let coarser = coarser(lattice, level);
        let coarse = Lattice {
            world_from_lattice: coarse_map(lattice.world_from_lattice, coarser),
            cells: lattice.cells.map(|n| n.div_ceil(1 << coarser)),
        };
        let tree = HierarchicalSpline::from_corrections(coarse, 1.0, Vec::new());
        Self {
            tree,
            depth: level + coarser,
            level,
        }
    }

    /// The layer over a box with `before` and `behind` more cells of the object's coarsest level than `lattice` has. None where the numbers
    /// do not fit.
    pub fn grown(&self, lattice: &Lattice, before: [u32; 3], behind: [u32; 3]) -> Option<Self> {
        let larger = Self::empty(&lattice.grown(before, behind), self.level);
        let numbers = self.tree.corrections(self.depth);
        let mut levels = vec![LevelCorrections::new(); larger.depth + 1];
        levels[larger.depth] = shifted(&numbers, before.map(|n| n << self.level));
        let tree = HierarchicalSpline::try_from_corrections(*larger.tree.lattice(), 1.0, levels).ok()?;
        Some(Self { tree, ..larger })
    }

    /// The layer of an object whose lattice lies elsewhere: the very same numbers.
    pub fn placed(&self, world_from_lattice: DAffine3) -> Self {
        let map = coarse_map(world_from_lattice, self.depth - self.level);
        Self {
            tree: self.tree.placed(map),
            ..*self
        }
    }

    /// The bricks that hold the numbers.
    pub fn tree(&self) -> &HierarchicalSpline<f32> {
        &self.tree
    }

    /// The layer with other bricks.
    ///
    /// # Errors
    /// [`LayerError::Foreign`] if they are on another lattice or hold numbers on another level.
    pub fn with_tree(&self, tree: HierarchicalSpline<f32>) -> Result<Self, LayerError> {
        let counts = tree.coefficient_counts();
        let elsewhere = counts
            .iter()
            .enumerate()
            .any(|(level, n)| level != self.depth && *n > 0);
        if tree.lattice() != self.tree.lattice() || elsewhere {
            return Err(LayerError::Foreign);
        }
        Ok(Self { tree, ..*self })
    }

    /// Level of the object's lattice whose knots are as far apart as the nodes.
    pub fn level(&self) -> usize {
        self.level
    }

    /// Whether nothing was ever painted.
    pub fn is_empty(&self) -> bool {
        self.tree.coefficient_count() == 0
    }

    /// Nodes in a world box.
    pub fn nodes_in(&self, b: &Aabb) -> u64 {
        let [from, to] = self.nodes(b);
        (0..3)
            .map(|a| u64::from((to[a] + 1).saturating_sub(from[a])))
            .product()
    }

    /// The number at a place; beyond the box that of the nearest place in it.
    pub fn at(&self, p: DVec3) -> f64 {
        self.values(&[p])[0]
    }

    /// The numbers at places.
    pub fn values(&self, places: &[DVec3]) -> Vec<f64> {
        if self.is_empty() || places.is_empty() {
            return vec![0.0; places.len()];
        }
        let cells: Vec<_> = places.iter().map(|p| self.cell(*p)).collect();
        let fold = |f: fn(u32, u32) -> u32, start: u32| {
            let all = cells.iter().map(|(cell, _)| *cell);
            all.fold([start; 3], |x, y| std::array::from_fn(|a| f(x[a], y[a])))
        };
        let [lo, hi] = [fold(u32::min, u32::MAX), fold(u32::max, 0)];
        let count: [usize; 3] = std::array::from_fn(|a| (hi[a] - lo[a]) as usize + 2);
        if count.iter().product::<usize>() > SPARE * (places.len() + SPARE) {
            // Two halves, so that places far apart do not make all between them be read.
            if places.len() > 1 {
                let (a, b) = places.split_at(places.len() / 2);
                return [self.values(a), self.values(b)].concat();
            }
        }
        let block = self.block(lo, count);
        let number = |cell: [u32; 3], corner: usize| {
            let at: [usize; 3] = std::array::from_fn(|a| (cell[a] - lo[a]) as usize + (corner >> a & 1));
            f64::from(block[(at[0] * count[1] + at[1]) * count[2] + at[2]])
        };
        cells
            .iter()
            .map(|(cell, share)| {
                let corners = (0..8).map(|corner| {
                    let weight = |a: usize| {
                        if corner >> a & 1 == 1 {
                            share[a]
                        } else {
                            1.0 - share[a]
                        }
                    };
                    weight(0) * weight(1) * weight(2) * number(*cell, corner)
                });
                corners.sum()
            })
            .collect()
    }

    /// The layer with new numbers at nodes in a world box: those that `paint` gives for the node's place and its number.
    ///
    /// # Errors
    /// Those of `paint`; [`LayerError`] for a number that is beyond single precision.
    pub fn painted<E: From<LayerError>>(
        &self,
        within: &Aabb,
        mut paint: impl FnMut(DVec3, f64) -> Result<Option<f64>, E>,
    ) -> Result<Self, E> {
        let [from, to] = self.nodes(within);
        let count: [usize; 3] = std::array::from_fn(|a| (to[a] + 1).saturating_sub(from[a]) as usize);
        if count.contains(&0) {
            return Ok(self.clone());
        }
        let old = self.block(from, count);
        let world_from_node = self.world_from_node();
        let mut edits: Vec<BlockEdit<f32>> = Vec::new();
        for (row, numbers) in old.chunks_exact(count[2]).enumerate() {
            let [x, y] = [
                from[0] + (row / count[1]) as u32,
                from[1] + (row % count[1]) as u32,
            ];
            let mut follows = false;
            for (z, number) in (from[2]..).zip(numbers) {
                let place = DVec3::new(x.into(), y.into(), z.into());
                let new = paint(world_from_node.transform_point3(place), f64::from(*number))?;
                let new = new.map(|v| v as f32).filter(|v| v != number);
                match (&mut edits[..], new) {
                    (
                        [
                            ..,
                            BlockEdit {
                                shape,
                                change: Change::Set(run),
                                ..
                            },
                        ],
                        Some(new),
                    ) if follows => {
                        run.push(new);
                        shape[2] += 1;
                    }
                    (_, Some(new)) => edits.push(BlockEdit {
                        level: self.depth,
                        // The function whose peak is at the node.
                        first: [x + 1, y + 1, z + 1],
                        shape: [1; 3],
                        change: Change::Set(vec![new]),
                    }),
                    (_, None) => {}
                }
                follows = new.is_some();
            }
        }
        let tree = self.tree.edited_blocks(&edits).map_err(LayerError::from)?;
        Ok(Self { tree, ..*self })
    }

    /// The layer with the numbers in a world box brought from elsewhere: `back` gives the place that a node's number comes from.
    ///
    /// # Errors
    /// [`LayerError`]; none for finite places.
    pub fn carried(&self, within: &Aabb, back: impl Fn(DVec3) -> DVec3) -> Result<Self, LayerError> {
        let mut places = Vec::new();
        self.painted(within, |p, _| {
            places.push(back(p));
            Ok::<_, LayerError>(None)
        })?;
        let mut values = self.values(&places).into_iter();
        self.painted(within, |_, _| Ok(values.next()))
    }

    /// Numbers of a block of nodes, last axis fastest.
    fn block(&self, first: [u32; 3], count: [usize; 3]) -> Vec<f32> {
        let numbers = self
            .tree
            .level_coefficients(self.depth, first.map(|n| n + 1), count);
        numbers.expect("nodes lie in the lattice")
    }

    fn world_from_node(&self) -> DAffine3 {
        let step = DMat3::from_diagonal(DVec3::splat(0.5f64.powi(self.depth as i32)));
        self.tree.lattice().world_from_lattice * DAffine3::from_mat3(step)
    }

    /// First and last node of a world box.
    fn nodes(&self, b: &Aabb) -> [[u32; 3]; 2] {
        let b = b.transformed(&self.world_from_node().inverse());
        let last = DVec3::from_array(self.tree.lattice().cells_at(self.depth).map(f64::from));
        // What lies on a node but for rounding is meant to be on it.
        let slack = 1e-9 * last.max_element();
        let node = |p: DVec3| p.clamp(DVec3::ZERO, last).to_array().map(|v| v as u32);
        [node((b.min - slack).ceil()), node((b.max + slack).floor())]
    }

    /// The cell of a place, and where in it the place lies.
    fn cell(&self, p: DVec3) -> ([u32; 3], [f64; 3]) {
        let p = self.world_from_node().inverse().transform_point3(p).to_array();
        let cells = self.tree.lattice().cells_at(self.depth);
        let at: [f64; 3] = std::array::from_fn(|a| p[a].clamp(0.0, f64::from(cells[a])));
        let cell: [u32; 3] = std::array::from_fn(|a| (at[a] as u32).min(cells[a] - 1));
        (cell, std::array::from_fn(|a| at[a] - f64::from(cell[a])))
    }
}
