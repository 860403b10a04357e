//! Elements of `H = AᵀSA`, by sums over one axis after the other.
//!
//! An element is a sum over the samples of products of three numbers, one per axis: gathering the weights of the
//! samples with the matrices of *pairs* of 1-D functions gives all elements at once, at the cost of a few sampling
//! operations per coefficient instead of 64² products per sample.

use bspline::Real;

use super::band_cholesky::{BandCholesky, NotPositive};
use crate::lattice::{Banded, Lattice, TensorProduct, TensorWorkspace};
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
        factorize_raised(into, |raised, into| {
            into.clear();
            for (row, &i) in numbers.iter().enumerate() {
                for column in row.saturating_sub(band)..=row {
                    let v = galerkin.element(place(numbers[column]), place(i));
                    into.set(row, column, if row == column { v * (1.0 + raised) } else { v });
                }
            }
        })
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
        let steps = s.springs.iter().map(|s| &s.direction.step);
        assert!(steps.eq(&self.steps), "springs as planned");
        fill(&mut self.weights, &s.mass);
        // A diagonal spring w (a - a')(a - a')ᵀ is w (aaᵀ + a'a'ᵀ), which acts like mass at its ends, less its cross
        // terms; one along an axis is taken as the difference itself, since that one is a tensor product.
        let weights = &mut self.weights;
        s.for_each_spring(|i, j, w, n| {
            if n >= 3 {
                weights[i] += w.as_f64();
                weights[j] += w.as_f64();
            }
        });
        self.mass
            .apply(&self.weights, &mut self.sums, &mut self.workspace);
        for (products, springs) in self.springs.iter().zip(&s.springs) {
            fill(&mut self.weights, &springs.weights);
            let sign = if springs.direction.axis().is_some() {
                1.0
            } else {
                -1.0
            };
            for product in products {
                product.apply(&self.weights, &mut self.term, &mut self.workspace);
                for (sum, t) in self.sums.iter_mut().zip(&self.term) {
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
        let galerkin = &*self;
        factorize_raised(into, |raised, into| galerkin.write(raised, into))
    }

    /// Writes `AᵀSA` into a band of the right size.
    pub fn assemble<T: Real>(&mut self, s: &StepMatrix<T>, into: &mut BandCholesky<T>) {
        self.accumulate(s);
        self.write(0.0, into);
    }

    /// Writes the matrix that was summed last, its diagonal larger by the share `raised`.
    fn write<T: Real>(&self, raised: f64, into: &mut BandCholesky<T>) {
        into.clear();
        let [nx, ny, nz] = self.dims;
        let [_, py, pz] = self.pair_dims;
        let [rx, ry, rz] = self.reach;
        let number = |i: usize, j: usize, k: usize| (i * ny + j) * nz + k;
        for i in 0..nx {
            for ox in 0..=rx.min(nx - 1 - i) {
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
                                into.set(to, from, if to == from { v * (1.0 + raised) } else { v });
                            }
                        }
                    }
                }
            }
        }
    }

    /// The diagonal of `AᵀSA`, of a plan for the diagonal.
    pub fn diagonal_of<T: Real>(&mut self, s: &StepMatrix<T>) -> &[f64] {
        self.accumulate(s);
        &self.sums
    }
}

/// The factor of the matrix that `write` writes with its diagonal larger by a share: by none, or by as little as makes it
/// positive definite in the working precision.
fn factorize_raised<T: Real>(
    into: &mut BandCholesky<T>,
    write: impl Fn(f64, &mut BandCholesky<T>),
) -> Result<(), NotPositive> {
    let mut raised = 0.0;
    loop {
        write(raised, into);
        match into.factorize() {
            Err(_) if raised < 1e-2 => {
                raised = if raised == 0.0 {
                    RAISED * T::UNIT_ROUND_OFF
                } else {
                    RAISED * raised
                };
            }
            done => return done,
        }
    }
}

fn fill<T: Real>(out: &mut [f64], weights: &Weights<T>) {
    match weights {
        Weights::Constant(w) => out.fill(w.as_f64()),
        Weights::Each(w) => {
            for (o, w) in out.iter_mut().zip(w) {
                *o = w.as_f64();
            }
        }
    }
}
