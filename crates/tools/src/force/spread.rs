use bspline::{Real, vectorized};
use dynamics::lattice::{OnBox, SampleBox};
use dynamics::matter::Quantity;
use dynamics::region::Region;
use glam::DVec3;

use super::filter::Shape;
use super::path::Path;

/// Gauss–Legendre nodes of a piece of a path, and their weights.
const PIECE: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Places of a path, and of what is before and behind it, whose matter counts as its own.
const LINE: usize = 9;

/// How a path's force is shared out over the samples near it: shares that add up to 1.
#[derive(Clone, Debug)]
pub struct Spread {
    pub at: SampleBox,
    pub shares: Vec<f64>,
    /// Stiffness of what it moves: the harmonic mean over the shares.
    pub stiffness: f64,
}

/// A part of a path whose force is spread.
pub struct Part<'a> {
    pub path: &'a Path,
    /// Arc lengths of its ends.
    pub from: f64,
    pub to: f64,
}

impl Part<'_> {
    /// Places with the weights that stand for it, a radius apart at most.
    fn places(&self, radius: f64) -> Vec<(DVec3, f64, DVec3)> {
        let length = self.to - self.from;
        if length <= 1e-9 * radius {
            return vec![(self.path.at(self.to), 1.0, self.path.direction(self.to))];
        }
        let count = (length / radius).ceil().max(1.0);
        let width = length / count;
        let piece = |n: usize| {
            PIECE.map(|(share, weight)| {
                let s = self.from + (n as f64 + share) * width;
                (self.path.at(s), weight, self.path.direction(s))
            })
        };
        (0..count as usize).flat_map(piece).collect()
    }

    /// Places from a radius behind it to a radius beyond.
    fn line(&self, radius: f64) -> impl Iterator<Item = DVec3> {
        let length = self.to - self.from + 2.0 * radius;
        (0..LINE).map(move |i| {
            let share = (i as f64 + 0.5) / LINE as f64;
            self.path.at(self.from - radius + share * length)
        })
    }
}

impl Spread {
    /// The shares of the samples of a region; none where no sample is near.
    ///
    /// # Errors
    /// What a formula says.
    pub fn new<T: Real>(region: &Region<T>, part: &Part, shape: &Shape, radius: f64) -> Result<Self, String> {
        let lattice = region.patch().lattice();
        let places = part.places(radius);
        let reach = shape.reach() * radius;
        let at = places.iter().fold(SampleBox::default(), |all, (p, ..)| {
            all.joined(region.samples_near(*p, reach))
        });
        let (mut shares, mut sum) = (vec![0.0; at.len()], 0.0);
        let [_, ny, nz] = at.count;
        for (p, weight, direction) in &places {
            let near = region.samples_near(*p, reach);
            let local = region.local(*p);
            let way =
                |a: usize, i: usize| ((near.first[a] + i) as f64 * lattice.spacing()[a] - local[a]) / radius;
            let rows = |x: usize, y: usize| {
                let [x, y] = [near.first[0] + x - at.first[0], near.first[1] + y - at.first[1]];
                (x * ny + y) * nz + near.first[2] - at.first[2]
            };
            if let Shape::Gaussian = shape {
                let one = |a: usize| -> Vec<f64> {
                    (0..near.count[a])
                        .map(|i| libm::exp(-0.5 * way(a, i).powi(2)))
                        .collect()
                };
                let [gx, gy, gz] = [one(0), one(1), one(2)];
                sum += weight
                    * [&gx, &gy, &gz]
                        .map(|g| g.iter().sum::<f64>())
                        .iter()
                        .product::<f64>();
                vectorized(
                    #[inline(always)]
                    || {
                        for (x, gx) in gx.iter().enumerate() {
                            for (y, gy) in gy.iter().enumerate() {
                                add(&mut shares[rows(x, y)..], weight * gx * gy, &gz);
                            }
                        }
                    },
                );
                continue;
            }
            // Formulas and cylinders are asked in the axes of the world.
            let axes = axes(region);
            for x in 0..near.count[0] {
                for y in 0..near.count[1] {
                    let row = rows(x, y);
                    for z in 0..near.count[2] {
                        let w = way(0, x) * axes[0] + way(1, y) * axes[1] + way(2, z) * axes[2];
                        let share = weight * shape.at(w, *direction)?;
                        shares[row + z] += share;
                        sum += share;
                    }
                }
            }
        }
        if !(sum > 0.0 && sum.is_finite()) {
            return Ok(Self {
                at: SampleBox::default(),
                shares: Vec::new(),
                stiffness: 1.0,
            });
        }
        let unit = 1.0 / sum;
        shares.iter_mut().for_each(|s| *s *= unit);
        let stiffness = match &region.patch().matter().stiffness {
            Quantity::Constant(all) => *all,
            Quantity::PerSample(each) => {
                let own = part.line(radius).map(|p| read(region, each, p));
                let own = own.sum::<f64>() / LINE as f64;
                let near: Vec<f64> = at.indices(lattice.sample_dims()).map(|i| each[i]).collect();
                yielding(&mut shares, &near, own)
            }
        };
        Ok(Self {
            at,
            shares,
            stiffness,
        })
    }
}

/// `to += factor·what`, of the first numbers.
#[inline(always)]
fn add(to: &mut [f64], factor: f64, what: &[f64]) {
    for (to, what) in to[..what.len()].iter_mut().zip(what) {
        *to += factor * what;
    }
}

/// Takes from the shares of what is softer than a path's own matter, in which it lies, and gives the stiffness of what is moved: what
/// moves a stiff solid by a little would carry soft matter beside it far beyond, where it tears off.
fn yielding(shares: &mut [f64], near: &[f64], own: f64) -> f64 {
    let less = |k: f64| if k < own { k / own } else { 1.0 };
    let sum: f64 = shares.iter().zip(near).map(|(s, k)| s * less(*k)).sum();
    if sum <= 0.0 {
        return 1.0;
    }
    let mut gives = 0.0;
    for (share, k) in shares.iter_mut().zip(near) {
        *share *= less(*k) / sum;
        if *share > 0.0 {
            gives += *share / k;
        }
    }
    1.0 / gives
}

/// A quantity at a place, linear between the samples of a region.
fn read<T: Real>(region: &Region<T>, each: &[f64], p: DVec3) -> f64 {
    let lattice = region.patch().lattice();
    let (dims, local) = (lattice.sample_dims(), region.local(p));
    let at: [(usize, f64); 3] = std::array::from_fn(|a| {
        let x = (local[a] / lattice.spacing()[a]).clamp(0.0, (dims[a] - 1) as f64);
        let below = (x as usize).min(dims[a] - 2);
        (below, x - below as f64)
    });
    let corner = |n: usize| {
        let upper = std::array::from_fn::<_, 3, _>(|a| n >> a & 1);
        let i = (0..3).fold(0, |i, a| i * dims[a] + at[a].0 + upper[a]);
        let weight = |a: usize| if upper[a] == 1 { at[a].1 } else { 1.0 - at[a].1 };
        each[i] * weight(0) * weight(1) * weight(2)
    };
    (0..8).map(corner).sum()
}

/// Unit vectors of the axes of a region's samples.
pub fn axes<T: Real>(region: &Region<T>) -> [DVec3; 3] {
    let origin = region.sample_position([0; 3]);
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|ijk| (region.sample_position(ijk) - origin).normalize())
}

/// Forces of several spreads on the box about them all.
pub struct Load<T> {
    at: SampleBox,
    values: Vec<T>,
}

impl<T: Real> Load<T> {
    /// `Σ factor·shares`.
    pub fn of<'a>(spreads: impl Iterator<Item = (&'a Spread, f64)> + Clone) -> Self {
        let acting = spreads.filter(|(_, factor)| *factor != 0.0);
        let at = acting
            .clone()
            .fold(SampleBox::default(), |all, (s, _)| all.joined(s.at));
        let mut sums = vec![0.0; at.len()];
        let [_, ny, nz] = at.count;
        for (spread, factor) in acting {
            let [mx, my, mz] = spread.at.count;
            let from: [usize; 3] = std::array::from_fn(|a| spread.at.first[a].saturating_sub(at.first[a]));
            vectorized(
                #[inline(always)]
                || {
                    for x in 0..mx {
                        for y in 0..my {
                            let row = ((from[0] + x) * ny + from[1] + y) * nz + from[2];
                            add(
                                &mut sums[row..],
                                factor,
                                &spread.shares[(x * my + y) * mz..][..mz],
                            );
                        }
                    }
                },
            );
        }
        Self {
            at,
            values: sums.into_iter().map(T::from_f64).collect(),
        }
    }

    pub fn on_box(&self) -> OnBox<'_, T> {
        OnBox {
            at: self.at,
            values: &self.values,
        }
    }
}
