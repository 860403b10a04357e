//! The kernels of the winding field, smoothed over a width ε.
//!
//! With `d = y − x`, `ρ² = |d|² + ε²` and `m = a n` the area-weighted normal of a point `y`,
//!
//! - `w(x) = (1/4π) Σ d·m / ρ³` is 1 inside and 0 outside a closed surface [Barill18 eq. 4, at ε = 0],
//! - `−∇w(x) = (1/4π) Σ m/ρ³ − 3 (d·m) d/ρ⁵`, along the outward normal on it,
//! - `(1/4π) Σ s (x − y)/ρ³`, gathered at `x`, is the adjoint of the first.

use bspline::vectorized;

/// Targets that are summed at once.
pub(crate) const LANES: usize = 8;
const FOUR_PI_INV: f32 = 0.079_577_47;

/// A point, or the mean of a node, that acts on targets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<S> {
    pub position: [f32; 3],
    pub strength: S,
}

/// What a point carries, and summed what a node of a tree does.
pub(crate) trait Strength: Copy + Send + Sync {
    const NONE: Self;
    fn add(&mut self, other: &Self);
}

impl<const N: usize> Strength for [f32; N] {
    const NONE: Self = [0.0; N];

    fn add(&mut self, other: &Self) {
        for (a, b) in self.iter_mut().zip(other) {
            *a += b;
        }
    }
}

/// What a point does to a target.
pub(crate) trait Kernel: Sync {
    /// What a point carries.
    type Strength: Strength;
    /// What a target gets.
    type Output: Copy + Default + Send;

    /// Sums over `sources` at up to [`LANES`] targets.
    fn sum(&self, sources: &[Source<Self::Strength>], targets: &[Target], out: &mut [Self::Output]);
}

/// Where a field is asked for, and how smooth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target {
    pub position: [f32; 3],
    /// ε of the kernels.
    pub width: f32,
}

/// `w` of area-weighted normals.
pub(crate) struct Winding;

/// `−∇w` of area-weighted normals.
pub(crate) struct Gradient;

/// The adjoint of [`Winding`].
pub(crate) struct Adjoint;

/// Sums `N` figures a target over the sources, lane by lane, so that the compiler fills vector registers.
#[inline(always)]
fn lanes<S: Copy, const N: usize>(
    sources: &[Source<S>],
    targets: &[Target],
    term: impl Fn([f32; 3], f32, S) -> [f32; N],
) -> [[f32; LANES]; N] {
    vectorized(
        #[inline(always)]
        || {
            let (mut at, mut square) = ([[0.0f32; LANES]; 3], [0.0f32; LANES]);
            for l in 0..LANES {
                let t = targets[l.min(targets.len() - 1)];
                square[l] = t.width * t.width;
                for k in 0..3 {
                    at[k][l] = t.position[k];
                }
            }
            let mut sum = [[0.0f32; LANES]; N];
            for s in sources {
                for l in 0..LANES {
                    let d = [0, 1, 2].map(|k| s.position[k] - at[k][l]);
                    let rho2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + square[l];
                    let t = term(d, rho2, s.strength);
                    for n in 0..N {
                        sum[n][l] += t[n];
                    }
                }
            }
            sum
        },
    )
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Kernel for Winding {
    type Strength = [f32; 3];
    type Output = f32;

    fn sum(&self, sources: &[Source<[f32; 3]>], targets: &[Target], out: &mut [f32]) {
        let [w] = lanes(
            sources,
            targets,
            #[inline(always)]
            |d, rho2, m| [dot(d, m) / (rho2 * rho2.sqrt())],
        );
        for (out, w) in out.iter_mut().zip(w) {
            *out = w * FOUR_PI_INV;
        }
    }
}

impl Kernel for Gradient {
    type Strength = [f32; 3];
    type Output = [f32; 3];

    fn sum(&self, sources: &[Source<[f32; 3]>], targets: &[Target], out: &mut [[f32; 3]]) {
        let g = lanes(
            sources,
            targets,
            #[inline(always)]
            |d, rho2, m| {
                let inverse = 1.0 / (rho2 * rho2.sqrt());
                let along = 3.0 * dot(d, m) / rho2;
                [0, 1, 2].map(|k| (m[k] - along * d[k]) * inverse)
            },
        );
        for (l, out) in out.iter_mut().enumerate() {
            *out = [0, 1, 2].map(|k| g[k][l] * FOUR_PI_INV);
        }
    }
}

impl Kernel for Adjoint {
    type Strength = [f32; 1];
    type Output = [f32; 3];

    fn sum(&self, sources: &[Source<[f32; 1]>], targets: &[Target], out: &mut [[f32; 3]]) {
        let g = lanes(
            sources,
            targets,
            #[inline(always)]
            |d, rho2, [s]| {
                let f = -s / (rho2 * rho2.sqrt());
                [0, 1, 2].map(|k| f * d[k])
            },
        );
        for (l, out) in out.iter_mut().enumerate() {
            *out = [0, 1, 2].map(|k| g[k][l] * FOUR_PI_INV);
        }
    }
}
