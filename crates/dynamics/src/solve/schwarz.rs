//! Overlapping blocks of coefficients, each solved exactly: the additive Schwarz method.

use bspline::Real;
use nalgebra::DMatrix;
use pulp::Arch;

use super::galerkin::Galerkin;

/// Blocks of `size³` coefficients whose corners lie `stride` apart.
#[derive(Clone, Debug)]
pub struct Schwarz<T> {
    dims: [usize; 3],
    blocks: Vec<Block>,
    /// Inverses, rows padded.
    inverses: Vec<T>,
    local: [Vec<T>; 2],
}

#[derive(Clone, Debug)]
struct Block {
    start: [usize; 3],
    len: [usize; 3],
    at: usize,
}

const LANES: usize = 8;

impl<T: Real> Schwarz<T> {
    /// Inverts the blocks of the matrix that `galerkin` has summed.
    pub fn new(galerkin: &Galerkin, size: usize, stride: usize) -> Self {
        let dims = galerkin.dims();
        let starts = |n: usize| {
            let last = n.saturating_sub(size);
            let count = last.div_ceil(stride) + 1;
            (0..count).map(move |c| (c * stride).min(last)).collect::<Vec<_>>()
        };
        let s = dims.map(starts);
        let mut out = Self {
            dims,
            blocks: Vec::new(),
            inverses: Vec::new(),
            local: [vec![T::zero(); size.pow(3).next_multiple_of(LANES)], vec![T::zero(); size.pow(3).next_multiple_of(LANES)]],
        };
        for &i in &s[0] {
            for &j in &s[1] {
                for &k in &s[2] {
                    let start = [i, j, k];
                    let len: [usize; 3] = std::array::from_fn(|a| size.min(dims[a]));
                    let n: usize = len.iter().product();
                    let place = |e: usize| [start[0] + e / (len[1] * len[2]), start[1] + e / len[2] % len[1], start[2] + e % len[2]];
                    let h = DMatrix::from_fn(n, n, |a, b| galerkin.element(place(a), place(b)));
                    let inverse = h.cholesky().expect("blocks of a positive definite matrix").inverse();
                    let pad = n.next_multiple_of(LANES);
                    let at = out.inverses.len();
                    out.inverses.resize(at + n * pad, T::zero());
                    for a in 0..n {
                        for b in 0..n {
                            out.inverses[at + a * pad + b] = T::from_f64(inverse[(a, b)]);
                        }
                    }
                    out.blocks.push(Block { start, len, at });
                }
            }
        }
        out
    }

    /// `z = Σ R H_block⁻¹ Rᵀ r`.
    pub fn apply(&mut self, r: &[T], z: &mut [T]) {
        let [_, ny, nz] = self.dims;
        z.fill(T::zero());
        let [local, out] = &mut self.local;
        for block in &self.blocks {
            let [lx, ly, lz] = block.len;
            let n = lx * ly * lz;
            let pad = n.next_multiple_of(LANES);
            let row = |i: usize, j: usize| ((block.start[0] + i) * ny + block.start[1] + j) * nz + block.start[2];
            for i in 0..lx {
                for j in 0..ly {
                    let at = (i * ly + j) * lz;
                    local[at..at + lz].copy_from_slice(&r[row(i, j)..row(i, j) + lz]);
                }
            }
            let inverse = &self.inverses[block.at..block.at + n * pad];
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    let out = &mut out[..pad];
                    out.fill(T::zero());
                    for (a, line) in inverse.chunks_exact(pad).enumerate() {
                        let v = local[a];
                        for (o, l) in out.iter_mut().zip(line) {
                            *o += v * *l;
                        }
                    }
                },
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
