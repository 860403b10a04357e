use bspline::Real;
use bspline::vectorized;

use super::neighbours::Direction;
use crate::lattice::SampleBox;

/// A number per sample, or the same for all.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Weights<T> {
    /// The same everywhere.
    Constant(T),
    /// One per sample, z fastest. Of springs: that of the spring that starts at the sample; where the lattice ends
    /// and there is no such spring, the number is not read.
    Each(Vec<T>),
}

impl<T: Real> Weights<T> {
    /// The weight of sample `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> T {
        match self {
            Self::Constant(w) => *w,
            Self::Each(w) => w[i],
        }
    }

    /// The weights times a factor, in another precision.
    pub fn scaled<U: Real>(&self, factor: f64) -> Weights<U> {
        let f = |w: &T| U::from_f64(w.as_f64() * factor);
        match self {
            Self::Constant(w) => Weights::Constant(f(w)),
            Self::Each(w) => Weights::Each(w.iter().map(f).collect()),
        }
    }

    /// Least and largest weight.
    pub(crate) fn range(&self) -> (f64, f64) {
        match self {
            Self::Constant(w) => (w.as_f64(), w.as_f64()),
            Self::Each(w) => w
                .iter()
                .map(|w| w.as_f64())
                .fold((f64::INFINITY, 0.0), |(low, high), w| (low.min(w), high.max(w))),
        }
    }

    /// Row `row` of `length` weights; `constant` holds as many equal ones.
    #[inline(always)]
    fn row<'a>(&'a self, row: usize, length: usize, constant: &'a [T]) -> &'a [T] {
        match self {
            Self::Constant(_) => constant,
            Self::Each(w) => &w[row * length..(row + 1) * length],
        }
    }
}

/// All springs of one direction.
#[derive(Clone, Debug, PartialEq)]
pub struct SpringWeights<T> {
    /// From the sample with the weight to the other.
    pub direction: Direction,
    /// Force on the density per difference of density.
    pub weights: Weights<T>,
}

impl<T: Real> SpringWeights<T> {
    /// The same in another precision.
    pub(crate) fn convert<U: Real>(&self) -> SpringWeights<U> {
        SpringWeights {
            direction: self.direction,
            weights: self.weights.scaled(1.0),
        }
    }
}

/// A matrix on the samples, `S = diag(mass) + Σ_springs w (e_i − e_j)(e_i − e_j)ᵀ`, that is never formed.
///
/// As the matrix of a time step: `M + aΔt D + bΔt² σ² Bᵀ diag(kτ) B`.
#[derive(Clone, Debug, PartialEq)]
pub struct StepMatrix<T> {
    dims: [usize; 3],
    /// The diagonal part.
    pub mass: Weights<T>,
    /// The springs; those along the axes come first.
    pub springs: Vec<SpringWeights<T>>,
    /// Rows of equal weights: the mass, then one per direction.
    constant_rows: Vec<T>,
}

impl<T: Real> StepMatrix<T> {
    /// On `dims` samples.
    ///
    /// # Panics
    /// If a list of weights has another length, or the first three directions are not those of the axes.
    pub fn new(dims: [usize; 3], mass: Weights<T>, springs: Vec<SpringWeights<T>>) -> Self {
        let count: usize = dims.iter().product();
        let axes: Vec<_> = springs.iter().take(3).map(|s| s.direction.axis()).collect();
        assert_eq!(axes, [Some(0), Some(1), Some(2)], "springs along the axes first");
        for w in springs.iter().map(|s| &s.weights).chain([&mass]) {
            if let Weights::Each(w) = w {
                assert_eq!(w.len(), count, "a weight per sample of {dims:?}");
            }
        }
        let mut out = Self {
            dims,
            mass,
            springs,
            constant_rows: Vec::new(),
        };
        out.constant_rows = vec![T::zero(); (out.springs.len() + 1) * dims[2]];
        out.refresh();
        out
    }

    /// Takes over the weights on a box of samples.
    pub(crate) fn copy_on(&mut self, from: &Self, at: SampleBox) {
        let (dims, count) = (self.dims, self.dims.iter().product());
        let to = [&mut self.mass]
            .into_iter()
            .chain(self.springs.iter_mut().map(|s| &mut s.weights));
        let from = [&from.mass]
            .into_iter()
            .chain(from.springs.iter().map(|s| &s.weights));
        for (to, from) in to.zip(from) {
            if to == from {
                continue;
            }
            if let Weights::Constant(w) = to {
                *to = Weights::Each(vec![*w; count]);
            }
            if let Weights::Each(list) = to {
                for i in at.indices(dims) {
                    list[i] = from.at(i);
                }
            }
        }
    }

    /// To be called after a constant weight was changed in place.
    pub fn refresh(&mut self) {
        let weights = [&self.mass]
            .into_iter()
            .chain(self.springs.iter().map(|s| &s.weights));
        for (row, w) in self.constant_rows.chunks_exact_mut(self.dims[2]).zip(weights) {
            if let Weights::Constant(w) = w {
                row.fill(*w);
            }
        }
    }

    /// Whether all weights are constant.
    pub fn is_uniform(&self) -> bool {
        let constant = |w: &Weights<T>| matches!(w, Weights::Constant(_));
        constant(&self.mass) && self.springs.iter().all(|s| constant(&s.weights))
    }

    /// Samples along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// The same matrix in another precision.
    pub fn convert<U: Real>(&self) -> StepMatrix<U> {
        let springs = self.springs.iter().map(SpringWeights::convert);
        StepMatrix::new(self.dims, self.mass.scaled(1.0), springs.collect())
    }

    /// `out = S d`.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn apply(&self, d: &[T], out: &mut [T]) {
        let [mx, my, mz] = self.dims;
        assert_eq!(d.len(), mx * my * mz, "samples");
        assert_eq!(out.len(), d.len(), "samples");
        vectorized(
            #[inline(always)]
            || {
                for i in 0..mx {
                    for j in 0..my {
                        let row = i * my + j;
                        let out = &mut out[row * mz..(row + 1) * mz];
                        self.across_rows(d, i, j, out);
                        self.along_row(&d[row * mz..(row + 1) * mz], row, out);
                        for (n, s) in self.springs.iter().enumerate().skip(3) {
                            self.diagonal(s, n, d, i, j, out);
                        }
                    }
                }
            },
        );
    }

    /// Row `row` of the weights of direction `n`.
    #[inline(always)]
    fn weight_row(&self, n: usize, row: usize) -> &[T] {
        let mz = self.dims[2];
        self.springs[n]
            .weights
            .row(row, mz, &self.constant_rows[(n + 1) * mz..(n + 2) * mz])
    }

    /// The mass and the springs along x and y of one row of samples.
    #[inline(always)]
    fn across_rows(&self, d: &[T], i: usize, j: usize, out: &mut [T]) {
        let [mx, my, mz] = self.dims;
        let row = i * my + j;
        let line = |r: usize| &d[r * mz..(r + 1) * mz];
        let mass = &self.mass.row(row, mz, &self.constant_rows[..mz])[..mz];
        // At the ends the row itself stands for the missing neighbour: no difference, no force.
        let west = if i > 0 { row - my } else { row };
        let east = if i + 1 < mx { row + my } else { row };
        let south = if j > 0 { row - 1 } else { row };
        let north = if j + 1 < my { row + 1 } else { row };
        let (c, w, e, s, n) = (line(row), line(west), line(east), line(south), line(north));
        let (kw, ke) = (&self.weight_row(0, west)[..mz], &self.weight_row(0, row)[..mz]);
        let (ks, kn) = (&self.weight_row(1, south)[..mz], &self.weight_row(1, row)[..mz]);
        let out = &mut out[..mz];
        for k in 0..mz {
            let along_x = kw[k] * (c[k] - w[k]) + ke[k] * (c[k] - e[k]);
            let along_y = ks[k] * (c[k] - s[k]) + kn[k] * (c[k] - n[k]);
            out[k] = mass[k] * c[k] + (along_x + along_y);
        }
    }

    /// The springs along z of one row of samples.
    #[inline(always)]
    fn along_row(&self, c: &[T], row: usize, out: &mut [T]) {
        let last = c.len() - 1;
        if last == 0 {
            return;
        }
        let k = self.weight_row(2, row);
        out[0] += k[0] * (c[0] - c[1]);
        {
            let (below, here, above) = (&c[..last - 1], &c[1..last], &c[2..]);
            let (kb, ka) = (&k[..last - 1], &k[1..last]);
            let out = &mut out[1..last];
            for z in 0..out.len() {
                out[z] += kb[z] * (here[z] - below[z]) + ka[z] * (here[z] - above[z]);
            }
        }
        out[last] += k[last - 1] * (c[last] - c[last - 1]);
    }

    /// The springs of any direction, at both ends, of one row of samples.
    #[inline(always)]
    fn diagonal(&self, springs: &SpringWeights<T>, n: usize, d: &[T], i: usize, j: usize, out: &mut [T]) {
        let [mx, my, mz] = self.dims;
        let [dx, dy, dz] = springs.direction.step;
        let row = i * my + j;
        let c = &d[row * mz..(row + 1) * mz];
        let other = |sign: isize| {
            let (i, j) = (i.wrapping_add_signed(sign * dx), j.wrapping_add_signed(sign * dy));
            (i < mx && j < my).then(|| i * my + j)
        };
        // Of samples z of this row and z + shift of the other.
        let overlap = |shift: isize| {
            let here = (-shift).max(0) as usize;
            let there = shift.max(0) as usize;
            (here, there, mz - here - there)
        };
        if let Some(r) = other(1) {
            let (here, there, count) = overlap(dz);
            let q = &d[r * mz + there..][..count];
            let k = &self.weight_row(n, row)[here..here + count];
            let (c, out) = (&c[here..here + count], &mut out[here..here + count]);
            for z in 0..count {
                out[z] += k[z] * (c[z] - q[z]);
            }
        }
        if let Some(r) = other(-1) {
            let (here, there, count) = overlap(-dz);
            let q = &d[r * mz + there..][..count];
            let k = &self.weight_row(n, r)[there..there + count];
            let (c, out) = (&c[here..here + count], &mut out[here..here + count]);
            for z in 0..count {
                out[z] += k[z] * (c[z] - q[z]);
            }
        }
    }

    /// Calls `f(sample, other sample, weight, direction index)` for every spring, directions one after the other.
    pub fn for_each_spring(&self, mut f: impl FnMut(usize, usize, T, usize)) {
        let [mx, my, mz] = self.dims;
        for (n, s) in self.springs.iter().enumerate() {
            let [dx, dy, dz] = s.direction.step;
            let across = |v: usize, step: isize, m: usize| {
                let v = v.wrapping_add_signed(step);
                (v < m).then_some(v)
            };
            for i in 0..mx {
                let Some(i2) = across(i, dx, mx) else { continue };
                for j in 0..my {
                    let Some(j2) = across(j, dy, my) else { continue };
                    for k in 0..mz {
                        let Some(k2) = across(k, dz, mz) else { continue };
                        let (a, b) = ((i * my + j) * mz + k, (i2 * my + j2) * mz + k2);
                        f(a, b, s.weights.at(a), n);
                    }
                }
            }
        }
    }
}
