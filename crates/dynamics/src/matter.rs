//! Fields of matter: mass, damping and stiffness per volume, and the scale of rest lengths.
//!
//! Everything is given per volume, `m = μV`, `c = γV`, `k = κV/h²` for a spring along an axis of spacing `h`, where `V`
//! is the volume of a sample, so that the same matter sampled more finely moves alike.

use bspline::Real;
use serde::{Deserialize, Serialize};

use crate::lattice::Lattice;
use crate::springs::{Direction, Neighbours, SpringWeights, Weights};
use crate::units::InUnits;

/// One quantity over the samples of a patch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Quantity {
    /// The same everywhere.
    Constant(f64),
    /// One value per sample, z fastest.
    PerSample(Vec<f64>),
}

impl Quantity {
    /// Value at sample `i`.
    pub fn at(&self, i: usize) -> f64 {
        match self {
            Self::Constant(v) => *v,
            Self::PerSample(v) => v[i],
        }
    }

    /// The values, one per sample, to be painted in place; a constant becomes `samples` equal values.
    pub fn paint(&mut self, samples: usize) -> &mut [f64] {
        if let Self::Constant(v) = self {
            *self = Self::PerSample(vec![*v; samples]);
        }
        match self {
            Self::PerSample(v) => v,
            Self::Constant(_) => unreachable!("made a list above"),
        }
    }

    fn weights<T: Real>(&self, factor: f64) -> Weights<T> {
        match self {
            Self::Constant(v) => Weights::Constant(T::from_f64(v * factor)),
            Self::PerSample(v) => Weights::Each(v.iter().map(|v| T::from_f64(v * factor)).collect()),
        }
    }

    pub(crate) fn check(
        &self,
        what: &'static str,
        samples: usize,
        may_vanish: bool,
    ) -> Result<(), MatterError> {
        match self {
            Self::Constant(v) if !is_matter(*v, may_vanish) => Err(MatterError::Value {
                what,
                index: 0,
                value: *v,
            }),
            Self::PerSample(v) => check_each(what, v, samples, may_vanish),
            Self::Constant(_) => Ok(()),
        }
    }
}

fn is_matter(v: f64, may_vanish: bool) -> bool {
    v.is_finite() && (v > 0.0 || (may_vanish && v == 0.0))
}

/// The check of a list.
pub(crate) fn check_each(
    what: &'static str,
    list: &[f64],
    needed: usize,
    may_vanish: bool,
) -> Result<(), MatterError> {
    if list.len() != needed {
        return Err(MatterError::Length {
            what,
            found: list.len(),
            needed,
        });
    }
    match list.iter().position(|v| !is_matter(*v, may_vanish)) {
        Some(index) => Err(MatterError::Value {
            what,
            index,
            value: list[index],
        }),
        None => Ok(()),
    }
}

/// Why matter is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MatterError {
    /// A value that no matter has.
    #[error(
        "{what} is {value} at sample {index}; it has to be finite and positive \
         (stiffness, damping and ground may be 0)"
    )]
    Value {
        /// Which quantity.
        what: &'static str,
        /// At which sample; 0 of a constant.
        index: usize,
        /// The value.
        value: f64,
    },
    /// Numbers of single samples that the precision cannot hold.
    #[error(
        "the {what} of single samples lies between {least:.1e} and {largest:.1e}, which {precision} cannot hold side by \
         side; paint with less contrast, or measure lengths in another unit"
    )]
    Range {
        /// Which quantity.
        what: &'static str,
        /// The least.
        least: f64,
        /// The largest.
        largest: f64,
        /// Name of the precision.
        precision: &'static str,
    },
    /// A list of the wrong length.
    #[error("{what} has {found} values; the patch needs {needed}")]
    Length {
        /// Which quantity.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Values needed.
        needed: usize,
    },
}

/// What a patch is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Matter {
    /// Stiffness κ per volume (the source paper's ρ).
    pub stiffness: Quantity,
    /// Mass μ per volume.
    pub mass: Quantity,
    /// Damping γ per volume.
    pub damping: Quantity,
    /// Stiffness per volume of springs that tie each density to its rest value; what holds a patch without a rim.
    pub ground: Quantity,
    /// Stiffness of single springs relative to `stiffness`, per direction and starting sample, if they differ.
    pub spring_factors: Option<Vec<Vec<f64>>>,
}

impl Default for Matter {
    fn default() -> Self {
        Self {
            stiffness: Quantity::Constant(1.0),
            mass: Quantity::Constant(1.0),
            damping: Quantity::Constant(0.0),
            ground: Quantity::Constant(0.0),
            spring_factors: None,
        }
    }
}

/// Matter on a lattice: numbers per sample and spring.
#[derive(Clone, Debug, PartialEq)]
pub struct Lumped<T> {
    /// `m = μV`.
    pub mass: Weights<T>,
    /// `c = γV`.
    pub damping: Weights<T>,
    /// Ground stiffness times `V`.
    pub ground: Weights<T>,
    /// `k` of each spring.
    pub springs: Vec<SpringWeights<T>>,
}

/// Mass, damping and ground stiffness of the samples, each in a unit of its own.
#[derive(Clone, Debug)]
pub(crate) struct ScaledMatter<T> {
    pub mass: InUnits<T>,
    pub damping: InUnits<T>,
    pub ground: InUnits<T>,
}

impl Matter {
    /// The numbers on a lattice.
    ///
    /// # Errors
    /// [`MatterError`].
    pub fn lumped<T: Real>(
        &self,
        lattice: &Lattice<T>,
        neighbours: Neighbours,
    ) -> Result<Lumped<T>, MatterError> {
        self.lumped_on(lattice, neighbours)
    }

    /// The numbers in units of their own, so that all magnitudes fit the precision; with the springs.
    ///
    /// # Errors
    /// [`MatterError`].
    pub(crate) fn in_units<T: Real>(
        &self,
        lattice: &Lattice<T>,
        neighbours: Neighbours,
    ) -> Result<(ScaledMatter<T>, Vec<SpringWeights<f64>>), MatterError> {
        let lumped: Lumped<f64> = self.lumped_on(lattice, neighbours)?;
        let scaled = ScaledMatter {
            mass: InUnits::new(&lumped.mass),
            damping: InUnits::new(&lumped.damping),
            ground: InUnits::new(&lumped.ground),
        };
        let check = |what, (least, largest): (f64, f64), fits: bool| {
            if fits && largest.is_finite() {
                return Ok(());
            }
            Err(MatterError::Range {
                what,
                least,
                largest,
                precision: match T::NAME {
                    "f32" => "single precision",
                    _ => "double precision",
                },
            })
        };
        let least = scaled.mass.weights.range().0;
        check("mass", lumped.mass.range(), least > 0.0)?;
        check("damping", lumped.damping.range(), true)?;
        check("ground stiffness", lumped.ground.range(), true)?;
        for s in &lumped.springs {
            check("stiffness", s.weights.range(), true)?;
        }
        Ok((scaled, lumped.springs))
    }

    /// Stiffness of the springs of direction `n` by the sample where they begin, its number and its place. Half of a spring lies in the volume of each of
    /// its samples: it has the harmonic mean of their stiffness. Where the lattice ends and there is no spring it is that of the
    /// sample, so that each number depends on what is near it only.
    pub(crate) fn spring_weight<U: Real>(
        &self,
        lattice: &Lattice<U>,
        n: usize,
        direction: Direction,
    ) -> impl Fn(usize, [usize; 3]) -> f64 + '_ {
        // Along an axis of spacing h: κV/h². Diagonals are for cubic lattices, where all spacings agree.
        let axis = direction.step.iter().position(|&s| s != 0).unwrap_or(0);
        let (spacing, dims) = (lattice.spacing(), lattice.sample_dims());
        let factor = direction.share * lattice.sample_volume() / (spacing[axis] * spacing[axis]);
        let own = self.spring_factors.as_ref().map(|f| &f[n]);
        let [dx, dy, dz] = direction.step;
        let offset = (dx * dims[1] as isize + dy) * dims[2] as isize + dz;
        move |i, at| {
            let own = own.map_or(1.0, |f| f[i]);
            let mean = match &self.stiffness {
                Quantity::Constant(v) if self.spring_factors.is_none() => return v * factor,
                stiffness => {
                    let ends = |a: usize| at[a].wrapping_add_signed(direction.step[a]) < dims[a];
                    let j = if (0..3).all(ends) {
                        i.wrapping_add_signed(offset)
                    } else {
                        i
                    };
                    let (a, b) = (stiffness.at(i), stiffness.at(j));
                    if a + b > 0.0 { 2.0 * a * (b / (a + b)) } else { 0.0 }
                }
            };
            mean * factor * own
        }
    }

    fn lumped_on<T: Real, U: Real>(
        &self,
        lattice: &Lattice<U>,
        neighbours: Neighbours,
    ) -> Result<Lumped<T>, MatterError> {
        let samples = lattice.sample_count();
        self.stiffness.check("stiffness", samples, true)?;
        self.mass.check("mass", samples, false)?;
        self.damping.check("damping", samples, true)?;
        self.ground.check("ground stiffness", samples, true)?;
        let directions = neighbours.directions();
        if let Some(factors) = &self.spring_factors {
            if factors.len() != directions.len() {
                return Err(MatterError::Length {
                    what: "list of spring directions",
                    found: factors.len(),
                    needed: directions.len(),
                });
            }
            for f in factors {
                Quantity::PerSample(f.clone()).check("spring stiffness", samples, true)?;
            }
        }
        let springs = directions.into_iter().enumerate().map(|(n, direction)| {
            let weight = self.spring_weight(lattice, n, direction);
            let weights = match (&self.stiffness, &self.spring_factors) {
                (Quantity::Constant(_), None) => Weights::Constant(T::from_f64(weight(0, [0; 3]))),
                _ => {
                    let all = lattice.all_samples().places(lattice.sample_dims());
                    Weights::Each(all.map(|(i, at)| T::from_f64(weight(i, at))).collect())
                }
            };
            SpringWeights { direction, weights }
        });
        let volume = lattice.sample_volume();
        Ok(Lumped {
            mass: self.mass.weights(volume),
            damping: self.damping.weights(volume),
            ground: self.ground.weights(volume),
            springs: springs.collect(),
        })
    }
}
