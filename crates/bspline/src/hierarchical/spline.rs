use std::fmt;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::brick::{BRICK, BRICK_LEN, DenseCorrections, HALO_LEN};
use super::functions::{EditError, check_functions};
use super::kernel::CellPoint;
use super::node::{Node, octant};
use super::{BrickKey, Corrections, Lattice, LevelCorrections, build, kernel};
use crate::Real;
use crate::placed_box::PlacedBox;

/// A field of dyadic cubic B-splines, C² everywhere inside its box.
///
/// Each level stores corrections to the prolonged coarser level, and the totals of the two, so that a point
/// is evaluated from the 64 coefficients of one level however deep the hierarchy is.
/// Outside the box, `f(clamp x) - g·|x - clamp x|` (clamped in lattice coordinates, world distance, `g` the
/// [slope](Self::slope)).
///
/// The bricks form a tree whose nodes are shared between versions, so that a copy costs nothing and an edit the paths
/// to what it changes.
#[derive(Clone)]
pub struct HierarchicalSpline<T> {
    pub(super) lattice: Lattice,
    pub(super) place: PlacedBox,
    pub(super) root: Arc<Node<T>>,
}

impl<T> fmt::Debug for HierarchicalSpline<T> {
    /// What it is, without its millions of coefficients.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HierarchicalSpline")
            .field("lattice", &self.lattice)
            .field("slope", &self.place.slope)
            .field("levels", &self.root.level_count)
            .field("coefficients", &self.root.count)
            .finish_non_exhaustive()
    }
}

/// A point of the box, found: which brick evaluates it, which cell of that brick, where in the cell.
pub(super) struct Place<'a, T> {
    pub brick: &'a Node<T>,
    pub cell: [usize; 3],
    pub t: [T; 3],
}

impl<T: Real> HierarchicalSpline<T> {
    /// Builds the totals of every level from the stored corrections, coarsest level first.
    ///
    /// `slope > 0` is the fall of the field per world length outside the box.
    ///
    /// # Panics
    /// Where [`Self::try_from_corrections`] has an error; if the box has no cells, or the lattice's map cannot be
    /// inverted.
    pub fn from_corrections(lattice: Lattice, slope: f64, levels: Vec<LevelCorrections<T>>) -> Self {
        match Self::try_from_corrections(lattice, slope, levels) {
            Ok(field) => field,
            Err(error) => panic!("{error}"),
        }
    }

    /// [`Self::from_corrections`] of numbers that nobody has checked.
    ///
    /// # Errors
    /// [`EditError::Level`], [`EditError::Function`], [`EditError::NotFinite`] for an active function that the lattice
    /// does not have, or whose coefficient is no number.
    ///
    /// # Panics
    /// If the box has no cells, or the lattice's map cannot be inverted.
    pub fn try_from_corrections(
        lattice: Lattice,
        slope: f64,
        levels: Vec<LevelCorrections<T>>,
    ) -> Result<Self, EditError> {
        assert!(
            lattice.cells.iter().all(|&n| n > 0),
            "a box has at least one cell on each axis"
        );
        let lattice_from_world = lattice.world_from_lattice.inverse();
        assert!(
            lattice_from_world.is_finite(),
            "the map from lattice to world can be inverted"
        );
        for (level, bricks) in levels.iter().enumerate() {
            for (key, functions) in bricks {
                check_functions(&lattice, level, *key, functions)?;
            }
        }
        Ok(Self {
            lattice,
            place: PlacedBox {
                min: DVec3::ZERO,
                max: lattice.extent(),
                world_from_local: lattice.world_from_lattice,
                local_from_world: lattice_from_world,
                slope,
            },
            root: build::tree(&lattice, levels),
        })
    }

    /// A field of level 0 alone, whose coefficients are the values of `f` at their knots, world coordinates: Schoenberg's
    /// approximation, exact where `f` is linear, which stays between the least and the largest of the values \[Schoenberg67\].
    ///
    /// # Errors
    /// [`EditError::NotFinite`] for a value that is none.
    ///
    /// # Panics
    /// As [`Self::try_from_corrections`].
    pub fn schoenberg(lattice: Lattice, slope: f64, f: impl Fn(DVec3) -> f64) -> Result<Self, EditError> {
        let bricks = lattice.cells.map(|n| (n + 2) / BRICK as u32 + 1);
        let keys = (0..bricks[0]).flat_map(move |x| {
            (0..bricks[1]).flat_map(move |y| (0..bricks[2]).map(move |z| BrickKey([x, y, z])))
        });
        let level = keys.map(|key| {
            let mut functions = DenseCorrections::empty();
            for slot in 0..BRICK_LEN {
                let at = [slot / (BRICK * BRICK), slot / BRICK % BRICK, slot % BRICK];
                let number: [u32; 3] = std::array::from_fn(|a| BRICK as u32 * key.0[a] + at[a] as u32);
                if (0..3).all(|a| number[a] < lattice.cells[a] + 3) {
                    let knot = DVec3::from_array(number.map(f64::from)) - 1.0;
                    functions.set(
                        at,
                        T::from_f64(f(lattice.world_from_lattice.transform_point3(knot))),
                    );
                }
            }
            (key, Arc::new(functions.pack()))
        });
        Self::try_from_corrections(lattice, slope, vec![level.collect()])
    }

    /// Bricks of `level` that hold active functions, in key order. Takes time in proportion to their number.
    pub fn corrections(&self, level: usize) -> LevelCorrections<T> {
        let mut found = Vec::new();
        self.root.walk(&mut |node| {
            if node.level as usize == level {
                found.extend(node.corrections.clone().map(|c| (node.key, c)));
            }
            i64::from(node.level) < level as i64 && usize::from(node.level_count) > level
        });
        found.into_iter().collect()
    }

    /// Grids the field stands on.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// World to lattice coordinates.
    pub fn lattice_from_world(&self) -> &DAffine3 {
        &self.place.local_from_world
    }

    /// The field with another map from its lattice to the world: the very same coefficients elsewhere, turned or mirrored.
    ///
    /// # Panics
    /// If the map cannot be inverted.
    pub fn placed(&self, world_from_lattice: DAffine3) -> Self {
        let lattice_from_world = world_from_lattice.inverse();
        assert!(
            lattice_from_world.is_finite(),
            "the map from lattice to world can be inverted"
        );
        let mut field = self.clone();
        field.lattice.world_from_lattice = world_from_lattice;
        field.place.world_from_local = world_from_lattice;
        field.place.local_from_world = lattice_from_world;
        field
    }

    /// The active functions of a brick, if there are any.
    pub fn brick_corrections(&self, level: usize, key: BrickKey) -> Option<&Arc<Corrections<T>>> {
        self.find(level, key)?.corrections.as_ref()
    }

    /// Fall of the field per world length outside the box, `> 0`.
    pub fn slope(&self) -> f64 {
        self.place.slope
    }

    /// Number of levels down to the finest with an active function, at least 1.
    pub fn level_count(&self) -> usize {
        usize::from(self.root.level_count).max(1)
    }

    /// Active functions over all levels.
    pub fn coefficient_count(&self) -> usize {
        self.root.count as usize
    }

    /// Active functions of each level. Takes time in proportion to all bricks.
    pub fn coefficient_counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.level_count()];
        self.root.walk(&mut |node| {
            if let Some(c) = &node.corrections {
                counts[node.level as usize] += c.count();
            }
            node.count > 0
        });
        counts
    }

    /// Bricks of totals over all levels.
    pub fn brick_count(&self) -> usize {
        self.root.brick_count as usize
    }

    /// Bytes of the totals that evaluation reads.
    pub fn totals_bytes(&self) -> usize {
        self.brick_count() * HALO_LEN * size_of::<T>()
    }

    /// SHA-256 of what the field is: precision, box, map, slope, and the active functions with their coefficients, as a
    /// tree of digests. Neither time, compression nor provenance enter (`docs/format.md`).
    ///
    /// The first time takes as long as hashing all coefficients; of a version made by an edit, as the edit.
    pub fn sha256(&self) -> [u8; 32] {
        Self::identity(&self.lattice, self.place.slope, self.root.digest())
    }

    /// Bound on what rounding can do to one evaluation of the value inside the box.
    ///
    /// 4 + 4 + 4 products and sums, and the rounding of the weights, against the largest coefficient.
    pub fn rounding_bound(&self) -> f64 {
        let [lo, hi] = self.root.hull.map(|c| c.as_f64().abs());
        64.0 * T::UNIT_ROUND_OFF * lo.max(hi)
    }

    /// Node of brick `key` of `level`, if there is one.
    pub(super) fn find(&self, level: usize, key: BrickKey) -> Option<&Node<T>> {
        let level = i8::try_from(level).ok()?;
        let depth = level as u32 + u32::from(self.root.level.unsigned_abs());
        let is_spanned = key.0.into_iter().all(|k| u64::from(k) >> depth == 0);
        is_spanned.then(|| self.root.find(level, key))?
    }

    /// Least world length of a knot interval of the finest level.
    pub fn finest_spacing(&self) -> f64 {
        self.lattice.spacing(self.level_count() - 1).min_element()
    }

    /// Where lattice point `q`, inside the box, is evaluated: in the finest brick that covers it.
    #[inline]
    pub(super) fn place(&self, q: DVec3) -> Place<'_, T> {
        self.place_after(None, q)
    }

    /// [`Self::place`], without the way down from the coarsest level if `q` lies in the same brick as `last`.
    #[inline]
    pub(super) fn place_after<'a>(&'a self, last: Option<&Place<'a, T>>, q: DVec3) -> Place<'a, T> {
        let finest = self.level_count() - 1;
        let cell = finest_cell(&self.lattice, finest, q);
        let brick = match last {
            Some(last) if is_finest_over(last.brick, finest, cell) => last.brick,
            _ => finest_over(&self.root, finest, cell),
        };
        Place::new(brick, finest, cell, q)
    }
}

impl HierarchicalSpline<f64> {
    /// In single precision, coefficients rounded to the nearest.
    ///
    /// # Errors
    /// [`EditError::NotFinite`] for a coefficient beyond single precision.
    pub fn to_single(&self) -> Result<HierarchicalSpline<f32>, EditError> {
        let level = |level| {
            let rounded = |functions: &Corrections<f64>| {
                let values = functions.values().iter().map(|&v| v as f32);
                Arc::new(Corrections::new(*functions.mask(), values.collect()))
            };
            let bricks = self.corrections(level).into_iter();
            bricks
                .map(|(key, functions)| (key, rounded(&functions)))
                .collect()
        };
        let levels = (0..self.level_count()).map(level).collect();
        HierarchicalSpline::try_from_corrections(self.lattice, self.slope(), levels)
    }
}

impl<'a, T: Real> Place<'a, T> {
    /// Point `q` in `cell` of level `finest`, which `brick` evaluates.
    #[inline]
    pub fn new(brick: &'a Node<T>, finest: usize, cell: [u32; 3], q: DVec3) -> Self {
        let shift = finest - brick.level as usize;
        let scale = brick.scale();
        Self {
            brick,
            cell: cell.map(|c| (c >> shift) as usize % BRICK),
            t: std::array::from_fn(|a| T::from_f64(q[a] * scale - (cell[a] >> shift) as f64)),
        }
    }

    /// Value and gradient by world coordinates, before the fall outside.
    #[inline]
    pub fn value_gradient(&self, place: &PlacedBox) -> (f64, DVec3) {
        let (totals, cell, t) = self.cell_point();
        self.in_world(place, kernel::value_gradient(totals, cell, t))
    }

    /// What the kernels ask.
    #[inline]
    pub fn cell_point(&self) -> CellPoint<'a, T> {
        (self.brick.own_totals(), self.cell, self.t)
    }

    /// Value and gradient by cell coordinates to those by world coordinates.
    #[inline]
    pub fn in_world(&self, place: &PlacedBox, (value, g): (T, [T; 3])) -> (f64, DVec3) {
        (value.as_f64(), self.world_gradient(place, g))
    }

    /// Gradient by cell coordinates to gradient by world coordinates.
    #[inline]
    pub fn world_gradient(&self, place: &PlacedBox, g: [T; 3]) -> DVec3 {
        let g = DVec3::new(g[0].as_f64(), g[1].as_f64(), g[2].as_f64()) * self.brick.scale();
        place.local_from_world.matrix3.transpose() * g
    }
}

/// The cell of level `finest` that holds a point of the box.
#[inline]
pub(super) fn finest_cell(lattice: &Lattice, finest: usize, q: DVec3) -> [u32; 3] {
    let limit = lattice.cells_at(finest);
    let scaled = q * (1u64 << finest) as f64;
    std::array::from_fn(|a| (scaled[a] as u32).min(limit[a] - 1))
}

/// Whether a brick is the one that evaluates a cell of level `finest`.
#[inline]
pub(super) fn is_finest_over<T: Real>(brick: &Node<T>, finest: usize, cell: [u32; 3]) -> bool {
    let shift = finest - brick.level as usize;
    let key = cell.map(|c| c >> shift >> BRICK.ilog2());
    if key != brick.key.0 {
        return false;
    }
    shift == 0 || brick.children[octant_of(cell, shift - 1)].is_none()
}

/// The finest brick over a cell of level `finest`. Where the box has cells every node has totals.
#[inline]
pub(super) fn finest_over<T: Real>(root: &Node<T>, finest: usize, cell: [u32; 3]) -> &Node<T> {
    let mut node = root;
    let mut shift = (finest as i32 - i32::from(root.level)) as usize;
    while shift > 0 {
        shift -= 1;
        match node.children[octant_of(cell, shift)].as_deref() {
            Some(child) => node = child,
            None => break,
        }
    }
    node
}

/// Which child of a node holds a cell of the finest level, `shift` levels above it.
#[inline]
fn octant_of(cell: [u32; 3], shift: usize) -> usize {
    octant(cell, shift + BRICK.ilog2() as usize)
}
