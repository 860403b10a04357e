//! Overlapping blocks of coefficients, each solved exactly: the additive Schwarz method, where material is painted.

use std::ops::Range;

use bspline::Real;
use bspline::vectorized;

use super::galerkin::Galerkin;

/// Blocks of `size³` coefficients whose corners lie `stride` apart, those in which the diagonal of the matrix varies.
#[derive(Clone, Debug)]
pub struct Schwarz<T> {
    dims: [usize; 3],
    blocks: Vec<Block>,
    /// Inverses, rows padded to [`LANES`].
    inverses: Vec<T>,
    local: [Vec<T>; 2],
}

#[derive(Clone, Copy, Debug)]
struct Block {
    start: [usize; 3],
    len: [usize; 3],
    at: usize,
}

impl Block {
    fn count(self) -> usize {
        self.len.iter().product()
    }

    fn place(self, e: usize) -> [usize; 3] {
        let [_, ly, lz] = self.len;
        let [i, j, k] = self.start;
        [i + e / (ly * lz), j + e / lz % ly, k + e % lz]
    }
}

const LANES: usize = 8;

impl<T: Real> Schwarz<T> {
    /// Inverts the blocks of the matrix that `galerkin` has summed in which `variation`, one number per coefficient,
    /// has a largest value more than `contrast` times the smallest. Of blocks made before, with the coefficients whose sums
    /// have changed since, by their range along x and y, those beside these are taken over.
    pub fn new(
        galerkin: &Galerkin,
        size: usize,
        stride: usize,
        variation: &[f64],
        contrast: f64,
        before: Option<(&Self, [Range<usize>; 2])>,
    ) -> Self {
        let dims = galerkin.dims();
        let len = dims.map(|n| size.min(n));
        let starts = |a: usize| {
            let last = dims[a] - len[a];
            (0..=last.div_ceil(stride)).map(move |c| (c * stride).min(last))
        };
        let mut out = Self {
            dims,
            blocks: Vec::new(),
            inverses: Vec::new(),
            local: [Vec::new(), Vec::new()],
        };
        let n: usize = len.iter().product();
        let pad = n.next_multiple_of(LANES);
        let mut h = vec![0.0; n * pad];
        for i in starts(0) {
            for j in starts(1) {
                for k in starts(2) {
                    let at = out.inverses.len();
                    let block = Block {
                        start: [i, j, k],
                        len,
                        at,
                    };
                    let values = (0..n).map(|e| {
                        let [x, y, z] = block.place(e);
                        variation[(x * dims[1] + y) * dims[2] + z]
                    });
                    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
                    if high <= contrast * low {
                        continue;
                    }
                    out.blocks.push(block);
                    if let Some(kept) = before
                        .as_ref()
                        .and_then(|(old, changed)| old.kept(block, changed))
                    {
                        out.inverses.extend_from_slice(&kept[..n * pad]);
                        continue;
                    }
                    for a in 0..n {
                        for b in 0..=a {
                            let v = galerkin.element(block.place(a), block.place(b));
                            h[a * pad + b] = v;
                            h[b * pad + a] = v;
                        }
                    }
                    invert(&mut h, n, pad);
                    out.inverses.extend(h.iter().map(|&v| T::from_f64(v)));
                }
            }
        }
        out.local = [vec![T::zero(); pad], vec![T::zero(); pad]];
        out
    }

    /// The inverse of a block that is among these, if nothing in it has changed.
    fn kept(&self, block: Block, changed: &[Range<usize>; 2]) -> Option<&[T]> {
        let beside =
            |k: usize| block.start[k] + block.len[k] <= changed[k].start || changed[k].end <= block.start[k];
        let index = self.blocks.binary_search_by_key(&block.start, |b| b.start).ok()?;
        (beside(0) || beside(1)).then(|| &self.inverses[self.blocks[index].at..])
    }

    /// Number of blocks.
    pub fn block_count(&self) -> usize {
        self.blocks.len()
    }

    /// `z = Σ R H_block⁻¹ Rᵀ r`.
    pub fn apply(&mut self, r: &[T], z: &mut [T]) {
        let [_, ny, nz] = self.dims;
        z.fill(T::zero());
        let [local, out] = &mut self.local;
        for block in &self.blocks {
            let [lx, ly, lz] = block.len;
            let n = block.count();
            let pad = n.next_multiple_of(LANES);
            let [x, y, z0] = block.start;
            let row = |i: usize, j: usize| ((x + i) * ny + y + j) * nz + z0;
            for i in 0..lx {
                for j in 0..ly {
                    let at = (i * ly + j) * lz;
                    local[at..at + lz].copy_from_slice(&r[row(i, j)..row(i, j) + lz]);
                }
            }
            let inverse = &self.inverses[block.at..block.at + n * pad];
            vectorized(
                #[inline(always)]
                || symmetric_product(inverse, &local[..n], &mut out[..pad]),
            );
            for i in 0..lx {
                for j in 0..ly {
                    let at = (i * ly + j) * lz;
                    for k in 0..lz {
                        z[row(i, j) + k] += out[at + k];
                    }
                }
            }
        }
    }
}

/// `out = M v`, rows of the symmetric `M` as long as `out`.
#[inline(always)]
fn symmetric_product<T: Real>(m: &[T], v: &[T], out: &mut [T]) {
    let pad = out.len();
    out.fill(T::zero());
    let whole = v.len() / 4 * 4;
    for a in (0..whole).step_by(4) {
        let row = |r: usize| &m[(a + r) * pad..(a + r + 1) * pad];
        let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
        for k in 0..pad {
            out[k] += (v[a] * r0[k] + v[a + 1] * r1[k]) + (v[a + 2] * r2[k] + v[a + 3] * r3[k]);
        }
    }
    for a in whole..v.len() {
        for (o, m) in out.iter_mut().zip(&m[a * pad..(a + 1) * pad]) {
            *o += v[a] * *m;
        }
    }
}

/// Inverts a symmetric positive definite matrix in place, Gauss and Jordan without pivots; padding becomes zero.
fn invert(h: &mut [f64], n: usize, pad: usize) {
    for row in h.chunks_exact_mut(pad) {
        row[n..].fill(0.0);
    }
    let mut pivot_row = vec![0.0; pad];
    vectorized(
        #[inline(always)]
        || {
            for p in 0..n {
                let inverse = 1.0 / h[p * pad + p];
                for (o, v) in pivot_row.iter_mut().zip(&h[p * pad..(p + 1) * pad]) {
                    *o = v * inverse;
                }
                pivot_row[p] = inverse;
                for (i, row) in h.chunks_exact_mut(pad).enumerate() {
                    if i == p {
                        row.copy_from_slice(&pivot_row);
                        continue;
                    }
                    let factor = row[p];
                    row[p] = 0.0;
                    for (v, q) in row.iter_mut().zip(&pivot_row) {
                        *v -= factor * q;
                    }
                }
            }
        },
    );
}
