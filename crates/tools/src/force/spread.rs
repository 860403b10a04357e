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

/// Numbers that are worked on at once: rows of shares are filled up with zeros to a multiple of it.
const LANES: usize = 4;

/// How a path's force is shared out over the samples near it: shares that add up to 1.
#[derive(Clone, Debug)]
pub struct Spread {
    at: SampleBox,
    /// Row by row along z.
    shares: Vec<f64>,
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
        let [nx, ny, nz] = [at.count[0], at.count[1], filled_up(at.count[2])];
        let (mut shares, mut sum) = (vec![0.0; nx * ny * nz], 0.0);
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
        let mut spread = Self {
            at,
            shares,
            stiffness: 1.0,
        };
        match &region.patch().matter().stiffness {
            Quantity::Constant(all) => {
                let unit = 1.0 / sum;
                spread.shares.iter_mut().for_each(|s| *s *= unit);
                spread.stiffness = *all;
            }
            Quantity::PerSample(each) => {
                let own = part.line(radius).map(|p| read(region, each, p));
                let own = own.sum::<f64>() / LINE as f64;
                spread.yield_to(each, lattice.sample_dims(), own, sum);
            }
        }
        Ok(spread)
    }

    /// Whether no sample is near.
    pub fn is_empty(&self) -> bool {
        self.shares.is_empty()
    }

    /// Takes from the shares, which add up to `sum`, of what is softer than a path's own matter, in which it lies, and finds the
    /// stiffness of what is moved: what moves a stiff solid by a little would carry soft matter beside it far beyond, where it
    /// tears off.
    fn yield_to(&mut self, each: &[f64], dims: [usize; 3], own: f64, sum: f64) {
        // In units of its own matter, of which nothing is softer if it is nothing.
        let (unit, border) = if own > 0.0 { (own, 1.0) } else { (1.0, 0.0) };
        let per_unit = 1.0 / unit;
        let less = move |k: f64| if k < border { k } else { 1.0 };
        let [_, my, mz] = self.at.count;
        let width = filled_up(mz);
        let first = self.at.first;
        let near = |row: usize| {
            let (x, y) = (first[0] + row / my, first[1] + row % my);
            &each[(x * dims[1] + y) * dims[2] + first[2]..][..mz]
        };
        // Sums of what stays, and of that over its stiffness, for each z.
        let mut sums = [vec![0.0; mz], vec![0.0; mz]];
        let [stays, gives] = &mut sums;
        let shares = &mut self.shares;
        vectorized(
            #[inline(always)]
            || {
                for (row, shares) in shares.chunks_exact(width).enumerate() {
                    let sums = stays.iter_mut().zip(gives.iter_mut());
                    for ((share, k), (stays, gives)) in shares.iter().zip(near(row)).zip(sums) {
                        let k = k * per_unit;
                        let left = share * less(k);
                        *stays += left;
                        *gives += if k > 0.0 { left / k } else { 0.0 };
                    }
                }
            },
        );
        let [stays, gives] = sums.map(|each| each.iter().sum::<f64>());
        if stays <= 0.0 {
            let unit = 1.0 / sum;
            self.shares.iter_mut().for_each(|s| *s *= unit);
            return;
        }
        if gives > 0.0 {
            self.stiffness = unit * (stays / gives);
        }
        let unit = 1.0 / stays;
        let shares = &mut self.shares;
        vectorized(
            #[inline(always)]
            || {
                for (row, shares) in shares.chunks_exact_mut(width).enumerate() {
                    for (share, k) in shares.iter_mut().zip(near(row)) {
                        *share *= less(k * per_unit) * unit;
                    }
                }
            },
        );
    }
}

/// `to += factor·what`, of the first numbers.
#[inline(always)]
fn add(to: &mut [f64], factor: f64, what: &[f64]) {
    for (to, what) in to[..what.len()].iter_mut().zip(what) {
        *to += factor * what;
    }
}

/// The length of a row with what fills it up.
fn filled_up(count: usize) -> usize {
    count.next_multiple_of(LANES)
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
        let [nx, ny, nz] = at.count;
        // What fills up a row at the end is room for what fills up those of spreads.
        let width = nz + LANES;
        let mut sums = vec![0.0; nx * ny * width];
        for (spread, factor) in acting {
            let [mx, my, mz] = spread.at.count;
            let from: [usize; 3] = std::array::from_fn(|a| spread.at.first[a].saturating_sub(at.first[a]));
            let count = filled_up(mz);
            let mut rows = spread.shares.chunks_exact(count.max(1));
            vectorized(
                #[inline(always)]
                || {
                    for x in 0..mx {
                        for (y, shares) in rows.by_ref().take(my).enumerate() {
                            let row = ((from[0] + x) * ny + from[1] + y) * width + from[2];
                            let to = &mut sums[row..][..count];
                            for (to, shares) in to.chunks_exact_mut(LANES).zip(shares.chunks_exact(LANES)) {
                                for (to, share) in to.iter_mut().zip(shares) {
                                    *to += factor * share;
                                }
                            }
                        }
                    }
                },
            );
        }
        let mut values = Vec::with_capacity(at.len());
        for row in sums.chunks_exact(width) {
            values.extend(row[..nz].iter().map(|v| T::from_f64(*v)));
        }
        Self { at, values }
    }

    pub fn on_box(&self) -> OnBox<'_, T> {
        OnBox {
            at: self.at,
            values: &self.values,
        }
    }
}
