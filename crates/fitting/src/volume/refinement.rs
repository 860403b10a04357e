//! Totals of a level row by row, and the transpose: the coarse share of fine rows.

use bspline::Real;
use bspline::vectorized;
use rayon::prelude::*;

use super::active::ActiveSet;
use super::domain::{Domain, SLAB};
use super::rows::{Phases, refine_rows, restrict_rows};

/// Rows of `C_ℓ = prolonged C_{ℓ-1} + corrections`, one plane after the other, never stored whole.
pub(crate) struct TotalRows<'a, T> {
    phases: Phases,
    coarse: &'a [T],
    coarse_size: [usize; 3],
    active: &'a ActiveSet,
    packed: &'a [T],
    z: usize,
    /// The coarse planes refined along z.
    plane: Vec<T>,
    /// One row of it refined along y.
    row: Vec<T>,
}

impl<'a, T: Real> TotalRows<'a, T> {
    /// `coarse` holds the totals of `level - 1`, x fastest; `packed` the corrections over `active` of `level`.
    pub fn new(
        domain: &Domain<T>,
        level: usize,
        coarse: &'a [T],
        active: &'a ActiveSet,
        packed: &'a [T],
    ) -> Self {
        let coarse_size = domain.functions(level - 1);
        assert_eq!(coarse.len(), coarse_size.iter().product::<usize>());
        assert_eq!(packed.len(), active.len());
        Self {
            phases: domain.phases(level),
            coarse,
            coarse_size,
            active,
            packed,
            z: 0,
            plane: vec![T::zero(); coarse_size[0] * coarse_size[1]],
            row: vec![T::zero(); coarse_size[0]],
        }
    }

    /// Moves to plane `z` of the level.
    #[inline(always)]
    pub fn start_plane(&mut self, z: usize) {
        self.z = z;
        let len = self.plane.len();
        let coarse = self.coarse;
        refine_rows(z, |c| &coarse[c * len..(c + 1) * len], &mut self.plane);
    }

    /// Row `y` of the plane, in phases.
    #[inline(always)]
    pub fn row(&mut self, y: usize, out: &mut [T]) {
        let nx = self.coarse_size[0];
        let plane = &self.plane;
        refine_rows(y, |c| &plane[c * nx..(c + 1) * nx], &mut self.row);
        self.phases.refine(&self.row, out);
        let range = self.active.row(y, self.z);
        for (&x, &c) in self.active.x(range.clone()).iter().zip(&self.packed[range]) {
            out[self.phases.slot(x as usize)] += c;
        }
    }
}

/// Collects fine rows of a slab onto the coarser level.
pub(crate) struct Restriction<T> {
    phases: Phases,
    size: [usize; 3],
    row: Vec<T>,
    plane: Vec<T>,
    first: usize,
    slab: Vec<T>,
}

impl<T: Real> Restriction<T> {
    /// For planes `z0..z1` of `level`.
    pub fn new(domain: &Domain<T>, level: usize, z0: usize, z1: usize) -> Self {
        let size = domain.functions(level - 1);
        let plane = size[0] * size[1];
        let first = z0 / 2;
        let planes = z1 / 2 + 2 - first;
        Self {
            phases: domain.phases(level),
            size,
            row: vec![T::zero(); size[0]],
            plane: vec![T::zero(); plane],
            first,
            slab: vec![T::zero(); plane * planes],
        }
    }

    /// Takes row `y`, in phases, of the current plane.
    #[inline(always)]
    pub fn add_row(&mut self, y: usize, row: &[T]) {
        self.phases.restrict(row, &mut self.row);
        restrict_rows(y, &self.row, &mut self.plane, 0, self.size[0]);
    }

    /// Closes plane `z`.
    #[inline(always)]
    pub fn end_plane(&mut self, z: usize) {
        restrict_rows(z, &self.plane, &mut self.slab, self.first, self.plane.len());
        self.plane.fill(T::zero());
    }

    /// Sums the slabs, in their order, into a dense vector of the coarser level.
    pub fn merge(slabs: impl IntoIterator<Item = Self>, out: &mut [T]) {
        out.fill(T::zero());
        for s in slabs {
            let start = s.first * s.plane.len();
            let end = (start + s.slab.len()).min(out.len());
            for (o, &v) in out[start..end].iter_mut().zip(&s.slab) {
                *o += v;
            }
        }
    }
}

/// Totals of every level above the finest from the packed corrections; entry `ℓ` is level `ℓ`, x fastest.
pub(crate) fn coarse_totals<T: Real>(
    domain: &Domain<T>,
    active: &[ActiveSet],
    packed: &[Vec<T>],
) -> Vec<Vec<T>> {
    let mut totals: Vec<Vec<T>> = Vec::with_capacity(domain.finest());
    let mut base = vec![T::zero(); domain.function_count(0)];
    active[0].scatter_add(&packed[0], &mut base);
    totals.push(base);
    for level in 1..domain.finest() {
        let fine = prolong(domain, level, &totals[level - 1], &active[level], &packed[level]);
        totals.push(fine);
    }
    totals
}

/// Dense totals of `level` from those of `level - 1` and its own corrections.
pub(crate) fn prolong<T: Real>(
    domain: &Domain<T>,
    level: usize,
    coarse: &[T],
    active: &ActiveSet,
    packed: &[T],
) -> Vec<T> {
    let [nx, ny, _] = domain.functions(level);
    let phases = domain.phases(level);
    let mut fine = vec![T::zero(); domain.function_count(level)];
    fine.par_chunks_mut(nx * ny * SLAB)
        .enumerate()
        .for_each(|(i, slab)| {
            vectorized(
                #[inline(always)]
                || {
                    let mut rows = TotalRows::new(domain, level, coarse, active, packed);
                    let mut buffer = vec![T::zero(); phases.len()];
                    for (z, plane) in slab.chunks_mut(nx * ny).enumerate() {
                        rows.start_plane(i * SLAB + z);
                        for (y, row) in plane.chunks_mut(nx).enumerate() {
                            rows.row(y, &mut buffer);
                            phases.join_functions(&buffer, row);
                        }
                    }
                },
            );
        });
    fine
}

/// The transpose of [`prolong`] on the coarse part: a dense vector of `level` collected onto `level - 1`.
pub(crate) fn restrict<T: Real>(domain: &Domain<T>, level: usize, fine: &[T]) -> Vec<T> {
    let [nx, ny, _] = domain.functions(level);
    let phases = domain.phases(level);
    let slabs: Vec<Restriction<T>> = fine
        .par_chunks(nx * ny * SLAB)
        .enumerate()
        .map(|(i, slab)| {
            vectorized(
                #[inline(always)]
                || {
                    let z0 = i * SLAB;
                    let mut sum = Restriction::new(domain, level, z0, z0 + slab.len() / (nx * ny));
                    let mut buffer = vec![T::zero(); phases.len()];
                    for (z, plane) in slab.chunks(nx * ny).enumerate() {
                        for (y, row) in plane.chunks(nx).enumerate() {
                            phases.split_functions(row, &mut buffer);
                            sum.add_row(y, &buffer);
                        }
                        sum.end_plane(z0 + z);
                    }
                    sum
                },
            )
        })
        .collect();
    let mut coarse = vec![T::zero(); domain.function_count(level - 1)];
    Restriction::merge(slabs, &mut coarse);
    coarse
}
