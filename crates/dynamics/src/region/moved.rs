//! A region that goes along with its tool.

use bspline::{HierarchicalSpline, Real};
use glam::DVec3;

use super::{Cells, MIN_CELLS, Region, RegionError, RegionOptions};
use crate::matter::Matter;
use crate::springs::{Plasticity, Weights};

/// Knot intervals after which knots and samples meet, 4/3 samples an interval: regions that begin and end there share their samples.
const PERIOD: u32 = 3;

impl Cells {
    /// The cells of a level within `half` of a place of the world, along the axes of the lattice, as far as the field
    /// reaches; rounded out so that regions with knots `stride` cells apart and 4/3 samples between them that are cut round any two places share
    /// their samples.
    ///
    /// # Errors
    /// [`RegionError`] for a box that misses the field or becomes too large.
    pub fn around<T: Real>(
        field: &HierarchicalSpline<T>,
        level: usize,
        stride: [u32; 3],
        place: DVec3,
        half: DVec3,
    ) -> Result<Self, RegionError> {
        let lattice = field.lattice();
        // Refuses levels that the lattice cannot have.
        field.level_coefficients(level, [0; 3], [0; 3])?;
        let at = field.lattice_from_world().transform_point3(place) * (1u64 << level) as f64;
        let spacing = lattice.spacing(level);
        let mut cells = Self {
            level,
            first: [0; 3],
            count: [0; 3],
        };
        for (a, limit) in lattice.cells_at(level).into_iter().enumerate() {
            let reach = half[a] / spacing[a];
            let period = f64::from(PERIOD * stride[a]);
            let low = ((at[a] - reach) / period).floor() * period;
            let high = ((at[a] + reach) / period).ceil() * period;
            let [low, high] = [low, high].map(|v| v.clamp(0.0, f64::from(limit)) as u32);
            (cells.first[a], cells.count[a]) = (low, high - low);
            if cells.count[a] / stride[a] < MIN_CELLS {
                return Err(RegionError::TooFewCells {
                    axis: a,
                    count: cells.count[a],
                });
            }
        }
        cells.check(field)?;
        Ok(cells)
    }
}

/// Where the samples of one axis lie among those of another, in its spacings.
struct Places(Vec<f64>);

impl Places {
    /// Of springs that step by `step` along the axis only those count that begin and end on it.
    fn weights(&self, count: usize, step: isize) -> impl Fn(usize) -> Option<(usize, f64)> + '_ {
        let (low, high) = ((-step).max(0) as f64, (count as isize - 1 - step.max(0)) as f64);
        move |i| {
            // Samples that coincide may miss each other by rounding.
            let near = self.0[i].round();
            let x = if (self.0[i] - near).abs() < 1e-6 {
                near
            } else {
                self.0[i]
            };
            (low..=high).contains(&x).then(|| {
                let below = x.floor().min(high - 1.0).max(low);
                (below as usize, x - below)
            })
        }
    }
}

/// Lists on the samples of an old region, read at those of a new one.
struct Carried {
    from: [usize; 3],
    to: [usize; 3],
    places: [Places; 3],
}

impl Carried {
    fn new<T: Real>(old: &Region<T>, new: &Region<T>) -> Self {
        let dims = |r: &Region<T>| r.patch.lattice().sample_dims();
        let (from, to) = (dims(old), dims(new));
        let places = |a: usize| {
            let at = |r: &Region<T>, m: usize, i: f64| {
                f64::from(r.cells.first[a]) + i * f64::from(r.cells.count[a]) / (m - 1) as f64
            };
            let width = at(old, from[a], 1.0) - at(old, from[a], 0.0);
            let place = |i: usize| (at(new, to[a], i as f64) - at(old, from[a], 0.0)) / width;
            Places((0..to[a]).map(place).collect())
        };
        Self {
            from,
            to,
            places: [places(0), places(1), places(2)],
        }
    }

    /// Trilinear interpolation, exact where samples coincide; `beside` where the old region has no spring with this step.
    fn read<T: Real>(&self, list: &[T], step: [isize; 3], beside: f64) -> Vec<T> {
        let [fx, fy, fz] = self.from;
        let [tx, ty, tz] = self.to;
        let [x, y, z] = [0, 1, 2].map(|a| self.places[a].weights(self.from[a], step[a]));
        let mut out = vec![T::from_f64(beside); tx * ty * tz];
        let pair = |(i, t): (usize, f64), m: usize| [(i, 1.0 - t), ((i + 1).min(m - 1), t)];
        for i in 0..tx {
            let Some(px) = x(i).map(|p| pair(p, fx)) else {
                continue;
            };
            for j in 0..ty {
                let Some(py) = y(j).map(|p| pair(p, fy)) else {
                    continue;
                };
                for k in 0..tz {
                    let Some(pz) = z(k).map(|p| pair(p, fz)) else {
                        continue;
                    };
                    let mut sum = 0.0;
                    for (a, u) in px {
                        for (b, v) in py {
                            for (c, w) in pz {
                                let weight = u * v * w;
                                if weight != 0.0 {
                                    sum += weight * list[(a * fy + b) * fz + c].as_f64();
                                }
                            }
                        }
                    }
                    out[(i * ty + j) * tz + k] = T::from_f64(sum);
                }
            }
        }
        out
    }
}

impl<T: Real> Region<T> {
    /// The field with the change of this region, and a region of other cells of the same level cut from it that goes on
    /// where this one was: for a tool that walks on.
    ///
    /// Where old and new cells overlap, velocities stay, being those of the same functions, and springs keep their
    /// stretch, the ground ones too: exactly if the samples coincide ([`Cells::around`]), else interpolated. So do the rest
    /// scale and the weights of a plasticity. What is left behind keeps its shape; what is new is at rest. Forces and
    /// constraints are let go, the solvers begin anew. `matter` is that of the new cells.
    ///
    /// # Errors
    /// As [`bake`](Self::bake) and [`new`](Self::new); [`RegionError::OtherLevel`], [`RegionError::Masked`].
    pub fn moved(
        &self,
        onto: &HierarchicalSpline<T>,
        cells: Cells,
        matter: Matter,
    ) -> Result<(HierarchicalSpline<T>, Self), RegionError> {
        if cells.level != self.cells.level {
            return Err(RegionError::OtherLevel {
                from: self.cells.level,
                to: cells.level,
            });
        }
        if self.patch.mask().is_some() {
            return Err(RegionError::Masked);
        }
        let field = self.bake(onto)?;
        let options = RegionOptions {
            stride: self.stride,
            samples_per_cell: self.samples_per_cell,
            law: self.patch.springs().law(),
            neighbours: self.patch.material.neighbours,
            solver: self.patch.solver_options(),
            sleep: self.thresholds,
        };
        let mut new = Self::new(&field, cells, matter, &options)?;
        new.set_parts_sleep(self.parts.on);
        self.hand_over(&mut new);
        new.asleep = self.asleep;
        Ok((field, new))
    }

    fn hand_over(&self, new: &mut Self) {
        let carried = Carried::new(self, new);
        let (old, patch) = (&self.patch, &mut new.patch);
        let dims = patch.lattice().coefficient_dims();
        for (i, v) in patch.motion.state.v.iter_mut().enumerate() {
            let at = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
            let cell = std::array::from_fn(|a| new.cells.first[a] + self.stride[a] * at[a] as u32);
            *v = self.velocity_of(cell);
        }
        patch.sample_velocities();
        for (n, differences) in old
            .springs()
            .stretches(&old.motion.state.d)
            .into_iter()
            .enumerate()
        {
            let step = old.springs().springs()[n].direction.step;
            let mut stretch = carried.read(&differences, step, 0.0);
            let axis = step.iter().position(|&s| s != 0).expect("a spring has a length");
            let longer = patch.lattice().spacing()[axis] / old.lattice().spacing()[axis];
            let units = old.springs().length_unit() / patch.springs().length_unit();
            let factor = T::from_f64(longer * units);
            stretch.iter_mut().for_each(|s| *s = factor * *s);
            patch.material.network.stretch(n, &patch.motion.state.d, &stretch);
        }
        if let Weights::Each(scale) = &old.springs().rest().scale {
            patch.material.network.rest_mut().scale = Weights::Each(carried.read(scale, [0; 3], 1.0));
        } else {
            patch.material.network.rest_mut().scale = old.springs().rest().scale.clone();
        }
        let away: Vec<T> = old
            .motion
            .state
            .d
            .iter()
            .zip(&old.motion.anchor)
            .map(|(d, a)| *d - *a)
            .collect();
        let away = carried.read(&away, [0; 3], 0.0);
        for ((anchor, d), away) in patch
            .motion
            .anchor
            .iter_mut()
            .zip(&patch.motion.state.d)
            .zip(away)
        {
            *anchor = *d - away;
        }
        patch.material.plasticity = match old.plasticity() {
            Plasticity::Kernel { rate, weights } => Plasticity::Kernel {
                rate: *rate,
                weights: carried.read(weights, [0; 3], 0.0),
            },
            other => other.clone(),
        };
    }

    /// Velocity of the function whose support begins at a cell; 0 of one that is not free here.
    fn velocity_of(&self, cell: [u32; 3]) -> T {
        let dims = self.patch.lattice().coefficient_dims();
        let mut place = 0;
        for a in 0..3 {
            match cell[a].checked_sub(self.cells.first[a]) {
                Some(i) if i % self.stride[a] == 0 && ((i / self.stride[a]) as usize) < dims[a] => {
                    place = place * dims[a] + (i / self.stride[a]) as usize;
                }
                _ => return T::zero(),
            }
        }
        self.patch.motion.state.v[place]
    }
}
