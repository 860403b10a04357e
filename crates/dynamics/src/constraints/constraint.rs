use bspline::{Basis, Real};
use serde::{Deserialize, Serialize};

use crate::lattice::Lattice;

/// What a constraint speaks of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum On {
    /// The density at a point.
    Point {
        /// Place in world lengths from the first sample, along the axes of the lattice.
        at: [f64; 3],
        /// Density there of the field that the patch was cut from.
        field: f64,
    },
    /// A weighted sum of the densities of samples: a row of `L` [Hua04 eq. 14].
    Samples(Vec<(usize, f64)>),
}

/// How a constraint acts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Hold {
    /// A spring of stiffness `k`: it pulls with `σ²k` times what is missing, as the springs of the patch do.
    Spring(f64),
    /// An equation that every step fulfils.
    Hard,
}

/// A linear constraint on the densities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Constraint {
    /// Name in errors.
    pub label: String,
    /// Left side.
    pub on: On,
    /// Right side; the iso-value for a point that has to lie on the surface.
    pub density: f64,
    /// How it acts.
    pub hold: Hold,
}

/// Why constraints are refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConstraintError {
    /// A point outside the patch.
    #[error(
        "constraint {label}: {at} along axis {axis} lies outside the patch, which reaches from 0 to {length}"
    )]
    Outside {
        /// Which constraint.
        label: String,
        /// Which axis.
        axis: usize,
        /// Place along it.
        at: f64,
        /// Length of the patch along it.
        length: f64,
    },
    /// A sample that does not exist.
    #[error("constraint {label} names sample {index}; the patch has {count}, numbered from 0")]
    Sample {
        /// Which constraint.
        label: String,
        /// The index.
        index: usize,
        /// Samples of the patch.
        count: usize,
    },
    /// A number that is not finite.
    #[error("constraint {label}: {what} is {value}; it has to be finite")]
    NotFinite {
        /// Which constraint.
        label: String,
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A stiffness that is not positive.
    #[error(
        "constraint {label}: the stiffness is {value}; it has to be positive (leave the constraint out for 0)"
    )]
    Stiffness {
        /// Which constraint.
        label: String,
        /// The stiffness.
        value: f64,
    },
    /// A curve without length, or a distance between its samples that is not positive or too small.
    #[error(
        "curve {label} has {points} points and the length {length}, and is to be sampled every {spacing}; both have to \
         be positive, and at most {} samples are possible",
        MOST_SAMPLES
    )]
    Curve {
        /// Which curve.
        label: String,
        /// Points of the polyline.
        points: usize,
        /// Its length.
        length: f64,
        /// Distance of samples asked for.
        spacing: f64,
    },
    /// A lattice whose multigrid does not bear constraints.
    #[error(
        "a patch with as many samples as coefficients takes constraints up to {limit} coefficients, and this one has \
         {coefficients}; sample it more finely, or raise the direct limit of the solver"
    )]
    Multigrid {
        /// Free coefficients.
        coefficients: usize,
        /// Up to how many the matrix is factorized.
        limit: usize,
    },
    /// A hard constraint where nothing may move.
    #[error(
        "hard constraint {label} asks for a density that is {gap:.3e} away, where no coefficient may move; move it away \
         from the rim, or leave it out"
    )]
    Unreachable {
        /// Its name.
        label: String,
        /// What is missing.
        gap: f64,
    },
    /// Hard constraints that contradict each other.
    #[error(
        "hard constraints {} contradict each other: when the others hold, the last is off by a density of {gap:.3e}; \
         leave one out, correct its density, or use a spring", rows.join(", ")
    )]
    Inconsistent {
        /// Their names; the last is the one that follows from the others but for its density.
        rows: Vec<String>,
        /// Missing density of the last when the others hold.
        gap: f64,
    },
}

const MOST_SAMPLES: f64 = 1e5;

/// Constraints for a curve, at equal distances of at most `spacing` along a polyline; one that ends where it starts is
/// closed. The stiffness of springs is taken per length. `field` gives the density of the field the patch was cut from.
///
/// Coordinates are world lengths from the first sample of the patch. Hard constraints need about half a knot spacing.
///
/// # Errors
/// [`ConstraintError::Curve`].
pub fn curve(
    label: &str,
    polyline: &[[f64; 3]],
    spacing: f64,
    density: f64,
    hold: Hold,
    field: impl Fn([f64; 3]) -> f64,
) -> Result<Vec<Constraint>, ConstraintError> {
    let apart = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (b[k] - a[k]).powi(2)).sum::<f64>().sqrt();
    let lengths: Vec<f64> = polyline.windows(2).map(|w| apart(w[0], w[1])).collect();
    let length: f64 = lengths.iter().sum();
    let parts = (length / spacing).ceil();
    if !(length > 0.0 && spacing > 0.0 && parts <= MOST_SAMPLES) {
        return Err(ConstraintError::Curve {
            label: label.to_owned(),
            points: polyline.len(),
            length,
            spacing,
        });
    }
    let closed = polyline.first() == polyline.last();
    let last = parts as usize;
    let (mut segment, mut passed) = (0, 0.0);
    let samples = (0..if closed { last } else { last + 1 }).map(|i| {
        let s = length * (i as f64 / parts);
        while segment + 1 < lengths.len() && s > passed + lengths[segment] {
            passed += lengths[segment];
            segment += 1;
        }
        let t = if lengths[segment] > 0.0 {
            ((s - passed) / lengths[segment]).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let (a, b) = (polyline[segment], polyline[segment + 1]);
        let at = std::array::from_fn(|k| a[k] + t * (b[k] - a[k]));
        let at_end = !closed && (i == 0 || i == last);
        let share = length / parts * if at_end { 0.5 } else { 1.0 };
        Constraint {
            label: format!("{label}[{i}]"),
            on: On::Point { at, field: field(at) },
            density,
            hold: match hold {
                Hold::Spring(k) => Hold::Spring(k * share),
                Hold::Hard => Hold::Hard,
            },
        }
    });
    Ok(samples.collect())
}

/// `r·p = target` on the free coefficients.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// `(coefficient, weight)`, ascending.
    pub terms: Vec<(usize, f64)>,
    pub target: f64,
    /// Size of the row as if nothing were fixed, and of the densities that its target is known from.
    pub weight: f64,
    pub size: f64,
}

impl Row {
    /// The constraint on a lattice whose samples have the densities `base` where `p` is 0.
    pub fn new<T: Real>(c: &Constraint, lattice: &Lattice<T>, base: &[T]) -> Result<Self, ConstraintError> {
        let label = || c.label.clone();
        let finite = |what, value: f64| match value.is_finite() {
            true => Ok(value),
            false => Err(ConstraintError::NotFinite {
                label: label(),
                what,
                value,
            }),
        };
        finite("density", c.density)?;
        if let Hold::Spring(k) = c.hold
            && finite("stiffness", k)? <= 0.0
        {
            return Err(ConstraintError::Stiffness {
                label: label(),
                value: k,
            });
        }
        let [_, ny, nz] = lattice.coefficient_dims();
        let place = |i: usize, j: usize, k: usize| (i * ny + j) * nz + k;
        match &c.on {
            On::Point { at, field } => {
                finite("density of the field", *field)?;
                let mut axes = [const { Vec::new() }; 3];
                for (k, axis) in lattice.axes().iter().enumerate() {
                    let length = axis.spacing() * (axis.sample_count() - 1) as f64;
                    // Points computed to lie on the border may miss it by rounding.
                    let slack = 1e-9 * length;
                    if !(-slack..=length + slack).contains(&at[k]) {
                        let (label, at) = (label(), at[k]);
                        return Err(ConstraintError::Outside {
                            label,
                            axis: k,
                            at,
                            length,
                        });
                    }
                    let [start, end] = axis.knots().domain();
                    let t = (start + (end - start) * (at[k] / length)).clamp(start, end);
                    let basis: Basis<f64> = Basis::at(axis.knots(), t, 0);
                    let all = basis
                        .values()
                        .iter()
                        .enumerate()
                        .map(|(j, w)| (basis.first() + j, *w));
                    let free = all.filter_map(|(j, w)| Some((j.checked_sub(axis.first_free())?, w)));
                    axes[k] = free.filter(|(j, _)| *j < axis.free_count()).collect();
                }
                let mut terms = Vec::new();
                for (i, a) in &axes[0] {
                    for (j, b) in &axes[1] {
                        terms.extend(axes[2].iter().map(|(k, c)| (place(*i, *j, *k), a * b * c)));
                    }
                }
                Ok(Self {
                    terms,
                    target: c.density - field,
                    weight: 1.0,
                    size: c.density.abs() + field.abs(),
                })
            }
            On::Samples(weights) => {
                let [_, my, mz] = lattice.sample_dims();
                let a = lattice.axes().each_ref().map(|axis| axis.collocation());
                let mut dense = vec![0.0; lattice.coefficient_count()];
                let (mut target, mut size, mut weight) = (c.density, c.density.abs(), 0.0);
                for &(index, w) in weights {
                    finite("weight", w)?;
                    let Some(d) = base.get(index) else {
                        let (label, count) = (label(), base.len());
                        return Err(ConstraintError::Sample { label, index, count });
                    };
                    target -= w * d.as_f64();
                    size += (w * d.as_f64()).abs();
                    weight += w.abs();
                    let sample = [index / (my * mz), index / mz % my, index % mz];
                    let [(x, u), (y, v), (z, t)] = std::array::from_fn(|k| a[k].row(sample[k]));
                    for (i, u) in u.iter().enumerate() {
                        for (j, v) in v.iter().enumerate() {
                            for (k, t) in t.iter().enumerate() {
                                dense[place(x + i, y + j, z + k)] += w * u * v * t;
                            }
                        }
                    }
                }
                let terms = dense.into_iter().enumerate().filter(|(_, w)| *w != 0.0).collect();
                Ok(Self {
                    terms,
                    target,
                    weight,
                    size,
                })
            }
        }
    }

    /// Moves the target to that of a constraint that differs in nothing else.
    pub fn aim<T: Real>(&mut self, c: &Constraint, base: &[T]) {
        (self.target, self.size) = match &c.on {
            On::Point { field, .. } => (c.density - field, c.density.abs() + field.abs()),
            On::Samples(weights) => {
                let terms = weights.iter().map(|(i, w)| w * base[*i].as_f64());
                terms.fold((c.density, c.density.abs()), |(target, size), t| {
                    (target - t, size + t.abs())
                })
            }
        };
    }

    /// `r·p`.
    pub fn value<T: Real>(&self, p: &[T]) -> f64 {
        self.terms.iter().map(|(i, w)| w * p[*i].as_f64()).sum()
    }
}
