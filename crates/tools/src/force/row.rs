use bspline::{Field, HierarchicalSpline, Real};
use dynamics::region::Region;
use glam::DVec3;

use super::quadrature::Node;

/// The four cubic B-splines of uniform knots that are not 0 at `t` in their cell.
fn basis(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
        t * t * t / 6.0,
    ]
}

/// The free coefficients of a region, as functions of the world.
pub struct Functions<'a, T> {
    field: &'a HierarchicalSpline<T>,
    /// Knot intervals per cell of the coarsest level.
    scale: DVec3,
    first: DVec3,
    dims: [usize; 3],
}

impl<'a, T: Real> Functions<'a, T> {
    /// Those of a region that was cut from `field`.
    pub fn of(field: &'a HierarchicalSpline<T>, region: &Region<T>) -> Self {
        let cells = region.cells();
        let stride = DVec3::from_array(region.stride().map(f64::from));
        Self {
            field,
            scale: (1u64 << cells.level) as f64 / stride,
            first: DVec3::from_array(cells.first.map(f64::from)) / stride,
            dims: region.patch().lattice().coefficient_dims(),
        }
    }

    /// The first function on each axis of those that are not 0 at `p`, and their weights.
    #[inline]
    fn near(&self, p: DVec3) -> Option<([i64; 3], [[f64; 4]; 3])> {
        let local = self.field.lattice_from_world().transform_point3(p) * self.scale - self.first;
        let mut first = [0i64; 3];
        let mut weights = [[0.0; 4]; 3];
        for a in 0..3 {
            let cell = local[a].floor();
            if !(cell >= 0.0 && cell < self.dims[a] as f64 + 3.0) {
                return None;
            }
            first[a] = cell as i64 - 3;
            weights[a] = basis(local[a] - cell);
        }
        Some((first, weights))
    }

    /// Calls `take` with the number and the weight of each function that is not 0 at `p`.
    #[inline]
    fn each(&self, p: DVec3, mut take: impl FnMut(usize, f64)) {
        let Some((first, weights)) = self.near(p) else {
            return;
        };
        let at = |a: usize, i: usize| {
            usize::try_from(first[a] + i as i64)
                .ok()
                .filter(|n| *n < self.dims[a])
        };
        for (i, wx) in weights[0].iter().enumerate() {
            let Some(x) = at(0, i) else { continue };
            for (j, wy) in weights[1].iter().enumerate() {
                let Some(y) = at(1, j) else { continue };
                let row = (x * self.dims[1] + y) * self.dims[2];
                for (k, wz) in weights[2].iter().enumerate() {
                    if let Some(z) = at(2, k) {
                        take(row + z, wx * wy * wz);
                    }
                }
            }
        }
    }

    /// Sum of the weights at a place.
    pub fn weight(&self, at: DVec3) -> f64 {
        let mut sum = 0.0;
        self.each(at, |_, w| sum += w);
        sum
    }

    /// The field with changes `p` of the free coefficients.
    pub fn value(&self, p: &[T], at: DVec3) -> f64 {
        let mut sum = self.field.value(at);
        self.each(at, |i, w| sum += w * p[i].as_f64());
        sum
    }
}

/// What a change of the free coefficients is worth to the mean of the field over a path: weights on the box of coefficients
/// about it.
#[derive(Clone, Debug)]
pub struct Row {
    dims: [usize; 3],
    first: [usize; 3],
    count: [usize; 3],
    weights: Vec<f64>,
}

impl Row {
    /// The mean over the nodes of an integral.
    pub fn mean<T: Real>(functions: &Functions<T>, nodes: &[Node], at: impl Fn(f64) -> DVec3) -> Self {
        let whole: f64 = nodes.iter().map(|n| n.weight).sum();
        let of = |n: &Node| Some((functions.near(at(n.at))?, n.weight / whole));
        let near: Vec<_> = nodes.iter().filter_map(of).collect();
        let dims = functions.dims;
        let inside = |a: usize, i: i64| i.clamp(0, dims[a] as i64) as usize;
        let firsts = |a: usize| near.iter().map(move |((first, _), _)| first[a]);
        let first = [0, 1, 2].map(|a| inside(a, firsts(a).min().unwrap_or(0)));
        let end = [0, 1, 2].map(|a| inside(a, firsts(a).max().map_or(0, |i| i + 4)));
        let count: [usize; 3] = std::array::from_fn(|a| end[a].saturating_sub(first[a]));
        let mut weights = vec![0.0; count.iter().product()];
        for ((from, [wx, wy, wz]), share) in &near {
            // Those of the four that are in the box.
            let part = |a: usize| {
                let range = inside(a, from[a])..inside(a, from[a] + 4);
                range.map(move |i| (i - first[a], (i as i64 - from[a]) as usize))
            };
            for (x, i) in part(0) {
                for (y, j) in part(1) {
                    let row = (x * count[1] + y) * count[2];
                    let factor = wx[i] * wy[j] * share;
                    for (z, k) in part(2) {
                        weights[row + z] += factor * wz[k];
                    }
                }
            }
        }
        Self {
            dims,
            first,
            count,
            weights,
        }
    }

    /// `Σ wᵢpᵢ`.
    pub fn times<T: Real>(&self, p: &[T]) -> f64 {
        let [_, my, mz] = self.count;
        let rows = self.weights.chunks_exact(mz.max(1)).enumerate();
        let sums = rows.map(|(row, weights)| {
            let (x, y) = (self.first[0] + row / my, self.first[1] + row % my);
            let from = (x * self.dims[1] + y) * self.dims[2] + self.first[2];
            let terms = weights.iter().zip(&p[from..]);
            terms.map(|(w, p)| w * p.as_f64()).sum::<f64>()
        });
        sums.sum()
    }
}
