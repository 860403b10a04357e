//! Elements of `H = AᵀSA`, by sums over one axis after the other.
//!
//! An element is a sum over the samples of products of three numbers, one per axis: gathering the weights of the
//! samples with the matrices of *pairs* of 1-D functions gives all elements at once, at the cost of a few sampling
//! operations per coefficient instead of 64² products per sample.

use std::ops::Range;

use bspline::Real;

use super::band_cholesky::{BandCholesky, NotPositive};
use crate::lattice::{Banded, Lattice, SampleBox, TensorProduct, TensorWorkspace};
use crate::springs::{StepMatrix, Weights};

/// First share, in units of rounding, that a diagonal is raised by, and the ratio of one try to the next.
const RAISED: f64 = 16.0;

/// How the two factors of a pair are taken from the rows of a collocation matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pair {
    /// Both from the row of the sample.
    Same,
    /// Both from the difference of the row and the next.
    Difference,
    /// The first from the row, the second from the one `step` further.
    To(isize),
    /// The first from the one `step` further, the second from the row.
    From(isize),
}

/// The matrix whose row `e` gathers pair `e = (c, o)`, `o` from `low` to `high`, of functions `c` and `c + o`.
fn pairs(a: &Banded<f64>, pair: Pair, low: isize, high: isize) -> Banded<f64> {
    let differences = a.differences();
    let other = |s: usize, step: isize| {
        let s = s.wrapping_add_signed(step);
        if s < a.rows() { a.row(s) } else { (0, &[][..]) }
    };
    let width = (high - low + 1) as usize;
    let rows = (0..a.rows()).map(|s| {
        let ((f, u), (g, v)) = match pair {
            Pair::Same => (a.row(s), a.row(s)),
            Pair::Difference => (differences.row(s), differences.row(s)),
            Pair::To(step) => (a.row(s), other(s, step)),
            Pair::From(step) => (other(s, step), a.row(s)),
        };
        let mut out = Vec::new();
        for (i, x) in u.iter().enumerate() {
            for (j, y) in v.iter().enumerate() {
                let (c, o) = (f + i, (g + j) as isize - (f + i) as isize);
                if (low..=high).contains(&o) {
                    out.push((c * width + (o - low) as usize, x * y));
                }
            }
        }
        out
    });
    Banded::from_rows(a.columns() * width, rows).transposed()
}

/// Largest distance of two functions that a spring joins, on one axis.
fn reach(a: &Banded<f64>) -> usize {
    let end = |i: usize| a.row(i).0 + a.row(i).1.len();
    let rows = (0..a.rows()).map(|i| {
        let j = (i + 1).min(a.rows() - 1);
        let (low, high) = (a.row(i).0.min(a.row(j).0), end(i).max(end(j)));
        let filled = !a.row(i).1.is_empty() && !a.row(j).1.is_empty();
        if filled {
            high - low - 1
        } else {
            a.row(i).1.len().max(a.row(j).1.len()).saturating_sub(1)
        }
    });
    rows.max().unwrap_or(0)
}

/// Which pairs are wanted.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    /// Each function with itself.
    Diagonal,
    /// Each function with all that it shares a spring with, one of the two orders.
    Half,
}

/// The plan of an assembly on one lattice, made once.
#[derive(Clone, Debug)]
pub struct Galerkin {
    dims: [usize; 3],
    reach: [usize; 3],
    /// Number of pairs on each axis.
    pair_dims: [usize; 3],
    mass: TensorProduct<f64>,
    /// For each direction the products that a spring's weight goes through.
    springs: Vec<Vec<TensorProduct<f64>>>,
    steps: Vec<[isize; 3]>,
    sums: Vec<f64>,
    term: Vec<f64>,
    weights: Vec<f64>,
    workspace: TensorWorkspace<f64>,
}

impl Galerkin {
    /// For all elements.
    pub fn new<T: Real>(lattice: &Lattice<T>, steps: &[[isize; 3]]) -> Self {
        Self::plan(lattice, steps, Wanted::Half)
    }

    /// For the diagonal.
    pub fn diagonal<T: Real>(lattice: &Lattice<T>, steps: &[[isize; 3]]) -> Self {
        Self::plan(lattice, steps, Wanted::Diagonal)
    }

    fn plan<T: Real>(lattice: &Lattice<T>, steps: &[[isize; 3]], wanted: Wanted) -> Self {
        let a: [Banded<f64>; 3] = std::array::from_fn(|k| lattice.axes()[k].collocation());
        let reach: [usize; 3] = std::array::from_fn(|k| match wanted {
            Wanted::Diagonal => 0,
            Wanted::Half => reach(&a[k]),
        });
        let product = |kinds: [Pair; 3]| {
            let p: [Banded<f64>; 3] = std::array::from_fn(|k| {
                let high = reach[k] as isize;
                pairs(&a[k], kinds[k], if k == 0 { 0 } else { -high }, high)
            });
            TensorProduct::new(p.each_ref())
        };
        let springs = steps.iter().map(|step| {
            let axis = step.iter().position(|&s| s != 0).expect("a spring has a length");
            if step.iter().filter(|&&s| s != 0).count() == 1 {
                let mut kinds = [Pair::Same; 3];
                kinds[axis] = Pair::Difference;
                vec![product(kinds)]
            } else {
                vec![product(step.map(Pair::To)), product(step.map(Pair::From))]
            }
        });
        let springs: Vec<Vec<_>> = springs.collect();
        let mass = product([Pair::Same; 3]);
        let pair_dims = mass.output_dims();
        let count = pair_dims.iter().product();
        Self {
            dims: lattice.coefficient_dims(),
            reach,
            pair_dims,
            mass,
            springs,
            steps: steps.to_vec(),
            sums: vec![0.0; count],
            term: vec![0.0; count],
            weights: vec![0.0; lattice.sample_count()],
            workspace: TensorWorkspace::new(),
        }
    }

    /// Half-bandwidth of `H` with the coefficients in order.
    pub fn band(&self) -> usize {
        let ([_, ny, nz], [rx, ry, rz]) = (self.dims, self.reach);
        let n: usize = self.dims.iter().product();
        ((rx * ny + ry) * nz + rz).min(n - 1)
    }

    /// Largest distance along each axis of two coefficients that share a spring.
    pub(crate) fn reach(&self) -> [usize; 3] {
        self.reach
    }

    /// The factor of the rows and columns of some coefficients, whose numbers ascend.
    ///
    /// # Errors
    /// [`NotPositive`].
    pub(crate) fn factorize_part<T: Real>(
        &mut self,
        s: &StepMatrix<T>,
        numbers: &[usize],
        into: &mut BandCholesky<T>,
    ) -> Result<(), NotPositive> {
        self.accumulate(s);
        let [_, ny, nz] = self.dims;
        let place = |i: usize| [i / nz / ny, i / nz % ny, i % nz];
        let (galerkin, band) = (&*self, into.band());
        factorize_raised(into, 0, |raised, _, into| {
            into.clear();
            for (row, &i) in numbers.iter().enumerate() {
                for column in row.saturating_sub(band)..=row {
                    let v = galerkin.element(place(numbers[column]), place(i));
                    into.set(row, column, if row == column { v * (1.0 + raised) } else { v });
                }
            }
        })?;
        Ok(())
    }

    /// Coefficients along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Element of the matrix that was summed last; 0 outside the reach of the springs.
    pub fn element(&self, a: [usize; 3], b: [usize; 3]) -> f64 {
        let (a, b) = if a <= b { (a, b) } else { (b, a) };
        let [_, py, pz] = self.pair_dims;
        let [rx, ry, rz] = self.reach;
        let [ox, oy, oz] = std::array::from_fn(|k| b[k] as isize - a[k] as isize);
        if ox > rx as isize || oy.unsigned_abs() > ry || oz.unsigned_abs() > rz {
            return 0.0;
        }
        let x = a[0] * (rx + 1) + ox as usize;
        let y = a[1] * (2 * ry + 1) + (oy + ry as isize) as usize;
        let z = a[2] * (2 * rz + 1) + (oz + rz as isize) as usize;
        self.sums[(x * py + y) * pz + z]
    }

    /// Sums of all pairs.
    pub fn accumulate<T: Real>(&mut self, s: &StepMatrix<T>) {
        for part in 0..self.parts() {
            self.accumulate_part(s, part, [0..self.pair_dims[0], 0..self.pair_dims[1]]);
        }
    }

    /// Sums anew what weights on a box of samples are part of, all others being as they were: the bits of
    /// [`accumulate`](Self::accumulate). Returns the first coefficient that has changed.
    pub fn accumulate_on<T: Real>(&mut self, s: &StepMatrix<T>, at: SampleBox) -> usize {
        let pairs = self.pairs_touched(at);
        if pairs.iter().any(Range::is_empty) {
            return self.dims.iter().product();
        }
        for part in 0..self.parts() {
            self.accumulate_part(s, part, pairs.clone());
        }
        let [_, ny, nz] = self.dims;
        self.touched(at)[0].start * ny * nz
    }

    /// Coefficients along x and y whose sums the weights on a box of samples are part of.
    pub fn touched(&self, at: SampleBox) -> [Range<usize>; 2] {
        let [x, y] = self.pairs_touched(at);
        let [rx, ry, _] = self.reach;
        // Of a pair the first along x is the lesser; along y either may be.
        let x = x.start / (rx + 1)..(x.end.div_ceil(rx + 1) + rx).min(self.dims[0]);
        let y =
            (y.start / (2 * ry + 1)).saturating_sub(ry)..(y.end.div_ceil(2 * ry + 1) + ry).min(self.dims[1]);
        [x, y]
    }

    fn pairs_touched(&self, at: SampleBox) -> [Range<usize>; 2] {
        // Diagonal springs act like mass at both of their ends.
        let ends = usize::from(self.springs.len() > 3);
        let samples = [0, 1].map(|k| at.first[k].saturating_sub(ends)..at.first[k] + at.count[k] + ends);
        let products = self.springs.iter().flatten().chain([&self.mass]);
        let reached = products.map(|p| p.reached(samples.clone()));
        let join = |a: Range<usize>, b: Range<usize>| match (a.is_empty(), b.is_empty()) {
            (true, _) => b,
            (_, true) => a,
            _ => a.start.min(b.start)..a.end.max(b.end),
        };
        let joined = reached.reduce(|[ax, ay], [bx, by]| [join(ax, bx), join(ay, by)]);
        joined.unwrap_or([0..0, 0..0])
    }

    /// Into how many parts the sum falls: the mass, and the springs of each direction.
    pub fn parts(&self) -> usize {
        1 + self.springs.len()
    }

    /// One of the parts, in their order, of the sums of a box of pairs.
    pub fn accumulate_part<T: Real>(&mut self, s: &StepMatrix<T>, part: usize, pairs: [Range<usize>; 2]) {
        let steps = s.springs.iter().map(|s| &s.direction.step);
        assert!(steps.eq(&self.steps), "springs as planned");
        let plane = s.dims()[1] * s.dims()[2];
        let Some(direction) = part.checked_sub(1) else {
            let read = self.mass.read_by(pairs[0].clone());
            fill(&mut self.weights, &s.mass, read.start * plane..read.end * plane);
            // A diagonal spring w (a - a')(a - a')ᵀ is w (aaᵀ + a'a'ᵀ), which acts like mass at its ends, less its cross
            // terms; one along an axis is taken as the difference itself, since that one is a tensor product.
            if s.springs.len() > 3 {
                let weights = &mut self.weights;
                s.for_each_spring(|i, j, w, n| {
                    if n >= 3 {
                        weights[i] += w.as_f64();
                        weights[j] += w.as_f64();
                    }
                });
            }
            self.mass
                .apply_on(pairs, &self.weights, &mut self.sums, &mut self.workspace);
            return;
        };
        let springs = &s.springs[direction];
        for product in &self.springs[direction] {
            let read = product.read_by(pairs[0].clone());
            fill(
                &mut self.weights,
                &springs.weights,
                read.start * plane..read.end * plane,
            );
        }
        let sign = if springs.direction.axis().is_some() {
            1.0
        } else {
            -1.0
        };
        let [_, py, pz] = self.pair_dims;
        for product in &self.springs[direction] {
            product.apply_on(pairs.clone(), &self.weights, &mut self.term, &mut self.workspace);
            for x in pairs[0].clone() {
                let plane = (x * py + pairs[1].start) * pz..(x * py + pairs[1].end) * pz;
                for (sum, t) in self.sums[plane.clone()].iter_mut().zip(&self.term[plane]) {
                    *sum += sign * t;
                }
            }
        }
    }

    /// Makes a band of the right size the factor of `AᵀSA`.
    ///
    /// With about as many coefficients as samples some of them move hardly any sample, and the matrix may not be positive
    /// definite to rounding. Then its diagonal is raised by a few units of rounding, or the least multiple of them that
    /// helps: the factor is a preconditioner, and what it lacks the iteration adds.
    ///
    /// # Errors
    /// [`NotPositive`] if raising it by a hundredth does not help.
    pub fn factorize<T: Real>(
        &mut self,
        s: &StepMatrix<T>,
        into: &mut BandCholesky<T>,
    ) -> Result<(), NotPositive> {
        self.accumulate(s);
        self.factorize_sums(into, 0).map(|_| ())
    }

    /// The same of the sums that are there, which have changed from coefficient `first` on since `into` was made of them:
    /// its rows before stay. Returns the share that the diagonal was raised by; the rows of a factor that was raised are no
    /// use to another.
    ///
    /// # Errors
    /// As [`factorize`](Self::factorize).
    pub fn factorize_sums<T: Real>(
        &self,
        into: &mut BandCholesky<T>,
        first: usize,
    ) -> Result<f64, NotPositive> {
        factorize_raised(into, first, |raised, from, into| self.write(raised, from, into))
    }

    /// Writes `AᵀSA` into a band of the right size.
    #[cfg(feature = "study")]
    pub fn assemble<T: Real>(&mut self, s: &StepMatrix<T>, into: &mut BandCholesky<T>) {
        for part in 0..=self.parts() {
            self.assemble_part(s, part, into);
        }
    }

    /// One part of this work, to be done in order: all but the last add to the sums, the last writes them.
    pub fn assemble_part<T: Real>(&mut self, s: &StepMatrix<T>, part: usize, into: &mut BandCholesky<T>) {
        if part < self.parts() {
            self.accumulate_part(s, part, [0..self.pair_dims[0], 0..self.pair_dims[1]]);
        } else {
            self.write(0.0, 0, into);
        }
    }

    /// Its rows from `first_row` on, the diagonal larger by the share `raised`.
    fn write<T: Real>(&self, raised: f64, first_row: usize, into: &mut BandCholesky<T>) {
        into.clear_from(first_row);
        let [nx, ny, nz] = self.dims;
        let [_, py, pz] = self.pair_dims;
        let [rx, ry, rz] = self.reach;
        let number = |i: usize, j: usize, k: usize| (i * ny + j) * nz + k;
        let first_plane = first_row / (ny * nz);
        for i in first_plane.saturating_sub(rx)..nx {
            for ox in first_plane.saturating_sub(i)..=rx.min(nx - 1 - i) {
                let plane = (i * (rx + 1) + ox) * py * pz;
                for j in 0..ny {
                    // The other function is the later one.
                    let from = if ox == 0 { j } else { j.saturating_sub(ry) };
                    for j2 in from..(j + ry + 1).min(ny) {
                        let row = plane + (j * (2 * ry + 1) + j2 + ry - j) * pz;
                        for k in 0..nz {
                            let from = if ox == 0 && j2 == j {
                                k
                            } else {
                                k.saturating_sub(rz)
                            };
                            for k2 in from..(k + rz + 1).min(nz) {
                                let v = self.sums[row + k * (2 * rz + 1) + k2 + rz - k];
                                let (to, from) = (number(i + ox, j2, k2), number(i, j, k));
                                if to < first_row {
                                    continue;
                                }
                                into.set(to, from, if to == from { v * (1.0 + raised) } else { v });
                            }
                        }
                    }
                }
            }
        }
    }

    /// The diagonal of `AᵀSA`, of a plan for the diagonal.
    #[cfg(feature = "study")]
    pub fn diagonal_of<T: Real>(&mut self, s: &StepMatrix<T>) -> &[f64] {
        self.accumulate(s);
        &self.sums
    }

    /// The sums that are there: of a plan for the diagonal, the diagonal.
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }
}

/// The factor of the matrix whose rows from some row on `write` writes with their diagonal larger by a share, returned: by none,
/// or by as little as makes it positive definite in the working precision. Rows before `first` have their factor already.
fn factorize_raised<T: Real>(
    into: &mut BandCholesky<T>,
    first: usize,
    write: impl Fn(f64, usize, &mut BandCholesky<T>),
) -> Result<f64, NotPositive> {
    let (mut raised, mut from) = (0.0, into.slice_of(first));
    loop {
        write(raised, from, into);
        match into.factorize_from(from) {
            Err(_) if raised < 1e-2 => {
                raised = if raised == 0.0 {
                    RAISED * T::UNIT_ROUND_OFF
                } else {
                    RAISED * raised
                };
                from = 0;
            }
            done => return done.map(|()| raised),
        }
    }
}

/// Writes the weights of a stretch of samples.
fn fill<T: Real>(out: &mut [f64], weights: &Weights<T>, at: Range<usize>) {
    match weights {
        Weights::Constant(w) => out[at].fill(w.as_f64()),
        Weights::Each(w) => {
            for (o, w) in out[at.clone()].iter_mut().zip(&w[at]) {
                *o = w.as_f64();
            }
        }
    }
}
