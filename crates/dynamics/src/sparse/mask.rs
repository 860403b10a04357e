use std::collections::VecDeque;

use bspline::Real;
use serde::{Deserialize, Serialize};

use crate::lattice::{Lattice, Rim, SampleBox, TensorWorkspace};
use crate::springs::Neighbours;

/// Share of the weights of a sample's functions that has to be held for the sample to hang on something.
const HELD: f64 = 1e-9;

/// Which samples of a lattice take part, and which of its coefficients may move for that: how a patch becomes no box.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    inside: Vec<bool>,
    rim: Rim,
    /// Numbers of the coefficients that move, and of those that do not, ascending.
    moving: Vec<usize>,
    held: Vec<usize>,
    parts: Vec<MaskPart>,
    /// Of each sample the one inside whose matter it has: itself, or one of the nearest along the axes.
    nearest: Vec<u32>,
}

/// Samples of a mask that springs join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaskPart {
    /// How many there are.
    pub samples: usize,
    /// The first of them.
    pub first: usize,
    /// Whether nothing holds it but its mass: no function that reaches one of its samples is held.
    pub floats: bool,
}

/// Why a mask is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MaskError {
    /// Not one flag per sample.
    #[error("the mask has {found} flags; the patch has {needed} samples")]
    Length {
        /// Flags given.
        found: usize,
        /// Samples of the patch.
        needed: usize,
    },
    /// No sample inside.
    #[error("no sample lies inside the mask; move it, enlarge it, or sample more finely")]
    Empty,
    /// No coefficient that may move.
    #[error(
        "none of {coefficients} coefficients may move: the {samples} samples inside the mask hold no whole function (with a fixed \
         rim), or only such as the border of the box holds; make the mask thicker, move it away from the border, use a finer \
         level, or let the rim of the mask go free"
    )]
    Held {
        /// Samples inside.
        samples: usize,
        /// Free coefficients of the box.
        coefficients: usize,
    },
    /// A lattice whose unknowns are its samples.
    #[error("a patch with as many samples as coefficients takes no mask; sample it more finely")]
    Square,
}

impl Mask {
    /// The samples where `inside` is true.
    ///
    /// With [`Rim::Fixed`] the coefficients move all of whose samples lie inside: the change vanishes, with all its
    /// continuous derivatives, where the mask ends, as at the rim of a box. With [`Rim::Free`] those that reach a sample
    /// inside, so that the matter inside ends freely; that outside is as the nearest inside but
    /// [`OUTSIDE`](super::OUTSIDE) as heavy and stiff, and follows.
    ///
    /// # Errors
    /// [`MaskError`].
    pub fn new<T: Real>(
        lattice: &Lattice<T>,
        inside: Vec<bool>,
        rim: Rim,
        neighbours: Neighbours,
    ) -> Result<Self, MaskError> {
        let needed = lattice.sample_count();
        if inside.len() != needed {
            let found = inside.len();
            return Err(MaskError::Length { found, needed });
        }
        if lattice.is_square() {
            return Err(MaskError::Square);
        }
        let samples = inside.iter().filter(|i| **i).count();
        if samples == 0 {
            return Err(MaskError::Empty);
        }
        let (reached, all) = reached_samples(lattice, &inside);
        let moves = |c: &usize| match rim {
            Rim::Free => reached[*c] > 0,
            Rim::Fixed => reached[*c] == all[*c],
        };
        let coefficients = lattice.coefficient_count();
        let (moving, held): (Vec<usize>, Vec<usize>) = (0..coefficients).partition(moves);
        if moving.is_empty() {
            return Err(MaskError::Held {
                samples,
                coefficients,
            });
        }
        let parts = parts(lattice, &inside, &moving, neighbours);
        Ok(Self {
            nearest: nearest(lattice.sample_dims(), &inside),
            inside,
            rim,
            moving,
            held,
            parts,
        })
    }

    /// Whether each sample lies inside.
    pub fn inside(&self) -> &[bool] {
        &self.inside
    }

    /// Of each sample the one inside whose matter it has: itself, or one of the nearest along the axes.
    pub fn nearest(&self, sample: usize) -> usize {
        self.nearest[sample] as usize
    }

    /// What the coefficients at its border do.
    pub fn rim(&self) -> Rim {
        self.rim
    }

    /// Numbers of the coefficients that move, ascending.
    pub fn moving(&self) -> &[usize] {
        &self.moving
    }

    /// Its parts, in the order of their first samples. Each moves on its own, but where functions reach into two.
    pub fn parts(&self) -> &[MaskPart] {
        &self.parts
    }

    /// The least box with all samples inside, on a lattice of `dims` samples.
    pub fn bounds(&self, dims: [usize; 3]) -> SampleBox {
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        for i in (0..self.inside.len()).filter(|i| self.inside[*i]) {
            let at = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
            low = std::array::from_fn(|a| low[a].min(at[a]));
            high = std::array::from_fn(|a| high[a].max(at[a]));
        }
        SampleBox {
            first: low,
            count: std::array::from_fn(|a| high[a] - low[a] + 1),
        }
    }

    /// Of a quantity of the samples what it is under the mask: `share` of the nearest inside, where a sample is outside.
    pub(crate) fn extend(&self, list: &mut [f64], share: f64) {
        // Sources lie inside and keep their values.
        for i in 0..list.len() {
            if !self.inside[i] {
                list[i] = share * list[self.nearest[i] as usize];
            }
        }
    }

    /// Lets what belongs to coefficients that are held be 0.
    pub(crate) fn hold<T: Real>(&self, list: &mut [T]) {
        for &c in &self.held {
            list[c] = T::zero();
        }
    }

    /// Lets what belongs to samples outside be 0.
    pub(crate) fn cut<T: Real>(&self, list: &mut [T]) {
        for (v, inside) in list.iter_mut().zip(&self.inside) {
            if !inside {
                *v = T::zero();
            }
        }
    }
}

/// Samples inside that are nearest, counted in steps along the axes; of several the one met first.
fn nearest(dims: [usize; 3], inside: &[bool]) -> Vec<u32> {
    let mut source = vec![u32::MAX; inside.len()];
    let mut queue: VecDeque<usize> = (0..inside.len()).filter(|i| inside[*i]).collect();
    for &i in &queue {
        source[i] = i as u32;
    }
    while let Some(i) = queue.pop_front() {
        let at = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
        for (a, step) in [dims[1] * dims[2], dims[2], 1].into_iter().enumerate() {
            let below = (at[a] > 0).then(|| i - step);
            let above = (at[a] + 1 < dims[a]).then(|| i + step);
            for j in [below, above].into_iter().flatten() {
                if source[j] == u32::MAX {
                    source[j] = source[i];
                    queue.push_back(j);
                }
            }
        }
    }
    source
}

/// How many samples inside, and how many at all, each coefficient reaches.
fn reached_samples<T: Real>(lattice: &Lattice<T>, inside: &[bool]) -> (Vec<u32>, Vec<u32>) {
    let ranges = lattice.axes().each_ref().map(|axis| {
        let functions = axis.collocation().transposed();
        let range = |c: usize| {
            let (first, weights) = functions.row(c);
            first..first + weights.len()
        };
        (0..functions.rows()).map(range).collect::<Vec<_>>()
    });
    let [mx, my, mz] = lattice.sample_dims();
    let [nx, ny, nz] = lattice.coefficient_dims();
    let along_z = |row: usize, c: usize| {
        let range = ranges[2][c].clone();
        inside[row * mz..][range].iter().filter(|i| **i).count() as u32
    };
    let rows: Vec<u32> = (0..mx * my)
        .flat_map(|row| (0..nz).map(move |c| (row, c)))
        .map(|(row, c)| along_z(row, c))
        .collect();
    let mut planes = vec![0; mx * ny * nz];
    for x in 0..mx {
        for (y, range) in ranges[1].iter().enumerate() {
            for z in 0..nz {
                planes[(x * ny + y) * nz + z] = range.clone().map(|s| rows[(x * my + s) * nz + z]).sum();
            }
        }
    }
    let (mut reached, mut all) = (Vec::new(), Vec::new());
    for x in 0..nx {
        let xs = ranges[0][x].clone();
        for y in 0..ny {
            for z in 0..nz {
                reached.push(xs.clone().map(|s| planes[(s * ny + y) * nz + z]).sum());
                all.push((xs.len() * ranges[1][y].len() * ranges[2][z].len()) as u32);
            }
        }
    }
    (reached, all)
}

/// Samples that springs join, by a flood from the first of each.
fn parts<T: Real>(
    lattice: &Lattice<T>,
    inside: &[bool],
    moving: &[usize],
    neighbours: Neighbours,
) -> Vec<MaskPart> {
    let lattice = lattice.in_double();
    let mut ones = vec![0.0; lattice.coefficient_count()];
    moving.iter().for_each(|&c| ones[c] = 1.0);
    let mut shares = vec![0.0; inside.len()];
    lattice.sample(&ones, &mut shares, &mut TensorWorkspace::new());
    let dims = lattice.sample_dims();
    let steps: Vec<[isize; 3]> = neighbours.directions().into_iter().map(|d| d.step).collect();
    let mut seen = vec![false; inside.len()];
    let mut parts = Vec::new();
    let mut open = Vec::new();
    for first in 0..inside.len() {
        if !inside[first] || seen[first] {
            continue;
        }
        let mut part = MaskPart {
            samples: 0,
            first,
            floats: true,
        };
        seen[first] = true;
        open.push(first);
        while let Some(i) = open.pop() {
            part.samples += 1;
            part.floats &= shares[i] > 1.0 - HELD;
            let at = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
            for step in steps.iter().flat_map(|s| [*s, s.map(|s| -s)]) {
                let to: [usize; 3] = std::array::from_fn(|a| at[a].wrapping_add_signed(step[a]));
                if (0..3).all(|a| to[a] < dims[a]) {
                    let j = (to[0] * dims[1] + to[1]) * dims[2] + to[2];
                    if inside[j] && !seen[j] {
                        seen[j] = true;
                        open.push(j);
                    }
                }
            }
        }
        parts.push(part);
    }
    parts
}

/// A mask as it is written down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct MaskRecord {
    rim: Rim,
    /// Samples outside, then inside, and so on in turns.
    runs: Vec<usize>,
}

impl MaskRecord {
    pub fn of(mask: &Mask) -> Self {
        let (mut runs, mut now) = (vec![0], false);
        for &inside in &mask.inside {
            if inside != now {
                runs.push(0);
                now = inside;
            }
            *runs.last_mut().expect("there is a first run") += 1;
        }
        Self { rim: mask.rim, runs }
    }

    /// # Errors
    /// [`MaskError`] of a damaged record.
    pub fn mask<T: Real>(&self, lattice: &Lattice<T>, neighbours: Neighbours) -> Result<Mask, MaskError> {
        let needed = lattice.sample_count();
        let found = self.runs.iter().fold(0usize, |sum, n| sum.saturating_add(*n));
        if found != needed {
            return Err(MaskError::Length { found, needed });
        }
        let runs = self.runs.iter().enumerate();
        let inside = runs.flat_map(|(i, n)| std::iter::repeat_n(i % 2 == 1, *n));
        Mask::new(lattice, inside.collect(), self.rim, neighbours)
    }
}
