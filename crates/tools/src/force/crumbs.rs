//! What forces leave and nobody asked for: a piece of solid all of which was outside, a pocket all of which was solid.
//!
//! Matter of scans is as dense deep in the solid as just below its surface. Forces that hold the surface beside what they draw out may
//! then thin it below; and what they draw out ends in a haze, of which noise makes specks. Such crumbs become again what they were.

use bspline::{Aabb, Field, Frame, HierarchicalSpline, Interval, Jet, Real};
use fitting::field::{Aim, FieldFitOptions, fit_field_where};
use fitting::{Control, FitError};
use glam::{DAffine3, DVec3};

use super::ForceError;
use crate::limits::Limits;

/// Most knots at which a change is looked at; of larger ones those of a coarser level.
const MOST: usize = 1 << 23;
/// Share of the slope over a knot interval by which what becomes what it was may be off.
const CLOSE: f64 = 0.02;
/// The same by which what lies beside what a tool has lost may be thinner.
const THIN: f64 = 0.1;
/// Knot intervals beside the crumbs in which the field may change.
const MARGIN: f64 = 4.0;

/// A field without the crumbs that it has more than the one before, whose surface lies at `iso` too, as far as limits allow.
///
/// # Errors
/// [`ForceError::Cancelled`].
pub(crate) fn swept<T: Real>(
    before: &HierarchicalSpline<T>,
    after: HierarchicalSpline<T>,
    iso: f64,
    limits: &Limits,
    control: &mut Control,
) -> Result<HierarchicalSpline<T>, ForceError> {
    let crumbs = |knots: &Knots, values: [&[f64]; 2]| {
        let [was, is] = values.map(|values| values.iter().map(|value| *value > iso).collect::<Vec<_>>());
        knots.crumbs(&was, &is)
    };
    restored(before, after, crumbs, limits, control)
}

/// A field that has all of the solid that there was before, of a tool that takes nothing away, and about what it had lost no thinner, as far as
/// limits allow.
///
/// # Errors
/// [`ForceError::Cancelled`].
pub(super) fn grown<T: Real>(
    before: &HierarchicalSpline<T>,
    after: HierarchicalSpline<T>,
    iso: f64,
    limits: &Limits,
    control: &mut Control,
) -> Result<HierarchicalSpline<T>, ForceError> {
    let finest = after.lattice().spacing(after.level_count() - 1);
    let slope = after.slope() * finest.min_element();
    let lost = |knots: &Knots, [was, is]: [&[f64]; 2]| {
        // A surface that is held stays where it was to a share of a knot interval.
        let is_lost = |n: &usize| was[*n] > iso && is[*n] < iso - CLOSE * slope;
        let is_thin = |n: &usize| was[*n] > iso && is[*n] < was[*n] - THIN * slope;
        knots.flood(is_lost, is_thin)
    };
    restored(before, after, lost, limits, control)
}

/// A field that is again what it was before at the knots that are `marked` by their values before and after.
fn restored<T: Real>(
    before: &HierarchicalSpline<T>,
    after: HierarchicalSpline<T>,
    marked: impl Fn(&Knots, [&[f64]; 2]) -> Vec<bool>,
    limits: &Limits,
    control: &mut Control,
) -> Result<HierarchicalSpline<T>, ForceError> {
    let Some(knots) = Knots::changed(before, &after) else {
        return Ok(after);
    };
    let [was, is] = [before, &after].map(|field| knots.values(field));
    let marked = marked(&knots, [&was, &is]);
    let marked = Marked {
        grid_from_world: knots.frame.world_from_grid.inverse(),
        knots,
        marked,
    };
    let Some(about) = marked.about() else {
        return Ok(after);
    };
    let level = marked.knots.level;
    let spacing = after.lattice().spacing(level);
    let within = about.widened(MARGIN * spacing.max_element());
    let whole = after.lattice().world_box();
    let within = Aabb::new(within.min.max(whole.min), within.max.min(whole.max));
    let options = FieldFitOptions {
        aim: Aim::Density {
            tolerance: CLOSE * after.slope() * spacing.min_element(),
        },
        finest: level,
        look: false,
    };
    let target = Restored {
        before,
        after: &after,
        marked,
    };
    // The levels of a fit are right together alone: what may not change takes no part in it.
    let is_free = |support: &Aabb| limits.may_change(support);
    match fit_field_where(&target, &after, &within, &options, &is_free, control) {
        Ok((field, ..)) => Ok(field),
        Err(why @ FitError::Cancelled) => Err(ForceError::Cancelled(why)),
        // The box is too thin for a fit.
        Err(_) => Ok(after),
    }
}

/// Knots of a level about what a stroke has changed.
struct Knots {
    level: usize,
    frame: Frame,
    lo: [i64; 3],
    count: [usize; 3],
}

impl Knots {
    /// None where nothing has changed.
    fn changed<T: Real>(before: &HierarchicalSpline<T>, after: &HierarchicalSpline<T>) -> Option<Self> {
        let lattice = after.lattice();
        let changed = after.changed_boxes(before, &lattice.world_box());
        let changed = changed.into_iter().reduce(Aabb::hull)?;
        let local = changed.transformed(after.lattice_from_world());
        let at_level = |level: usize| {
            let scale = (1u64 << level) as f64;
            let last = lattice.cells_at(level);
            let lo: [i64; 3] = std::array::from_fn(|a| ((local.min[a] * scale).floor() as i64).max(0));
            let hi: [i64; 3] =
                std::array::from_fn(|a| ((local.max[a] * scale).ceil() as i64).min(i64::from(last[a])));
            Self {
                level,
                frame: Frame {
                    world_from_grid: lattice.world_from_lattice
                        * DAffine3::from_scale(DVec3::splat(1.0 / scale)),
                    cells: [1; 3],
                },
                lo,
                count: std::array::from_fn(|a| (hi[a] + 1 - lo[a]).max(0) as usize),
            }
        };
        let levels = (0..=after.finest_in(&changed)).rev().map(at_level);
        levels.into_iter().find(|knots| knots.len() <= MOST)
    }

    fn len(&self) -> usize {
        self.count.iter().product()
    }

    fn values(&self, field: &dyn Field) -> Vec<f64> {
        let mut values = vec![0.0; self.len()];
        field.frame_values(&self.frame, self.lo, self.count, &mut values);
        values
    }

    /// Those next to one, by `reach` axes at most; none beyond the rim.
    fn beside(&self, knot: usize, reach: usize) -> impl Iterator<Item = usize> + '_ {
        let [_, ny, nz] = self.count;
        let at = place(knot, self.count);
        (0..27).filter_map(move |n| {
            let step = [n / 9, n / 3 % 3, n % 3];
            let axes = step.iter().filter(|s| **s != 1).count();
            let to: [usize; 3] = std::array::from_fn(|a| (at[a] + step[a]).wrapping_sub(1));
            let is_there = (1..=reach).contains(&axes) && (0..3).all(|a| to[a] < self.count[a]);
            is_there.then(|| (to[0] * ny + to[1]) * nz + to[2])
        })
    }

    /// Whether a knot lies at the rim, beyond which nothing is known.
    fn is_at_rim(&self, knot: usize) -> bool {
        self.beside(knot, 1).count() < 6
    }

    /// The knots that are `seeds`, and those in touch with them by way of such as are `like` them.
    fn flood(&self, seeds: impl Fn(&usize) -> bool, like: impl Fn(&usize) -> bool) -> Vec<bool> {
        let mut marked = vec![false; self.len()];
        let mut open: Vec<usize> = (0..self.len()).filter(seeds).collect();
        open.iter().for_each(|knot| marked[*knot] = true);
        while let Some(knot) = open.pop() {
            for other in self.beside(knot, 3).filter(&like) {
                if !std::mem::replace(&mut marked[other], true) {
                    open.push(other);
                }
            }
        }
        marked
    }

    /// Crumbs, and what is about them without being of their kind before or after.
    fn crumbs(&self, was: &[bool], is: &[bool]) -> Vec<bool> {
        let mut seen = vec![false; self.len()];
        let mut marked = vec![false; self.len()];
        for first in 0..self.len() {
            if is[first] == was[first] || seen[first] {
                continue;
            }
            // A piece that meets something that was of its kind before is none: the rest of it is not looked at.
            seen[first] = true;
            let mut piece = vec![first];
            let mut next = 0;
            let mut is_crumb = true;
            while next < piece.len() {
                let knot = piece[next];
                next += 1;
                is_crumb &= !self.is_at_rim(knot);
                for other in self.beside(knot, 1).filter(|other| is[*other] == is[first]) {
                    let is_new = was[other] != is[first];
                    is_crumb &= is_new;
                    if is_new && !seen[other] {
                        seen[other] = true;
                        piece.push(other);
                    }
                }
            }
            if is_crumb {
                for &knot in &piece {
                    marked[knot] = true;
                    let about = self.beside(knot, 3);
                    about
                        .filter(|n| is[*n] != is[first] && was[*n] != is[first])
                        .for_each(|n| marked[n] = true);
                }
            }
        }
        marked
    }
}

/// Where a node stands in a block of so many, last axis fastest.
fn place(n: usize, [_, ny, nz]: [usize; 3]) -> [usize; 3] {
    [n / nz / ny, n / nz % ny, n % nz]
}

/// Knots of which a field is to become what it was.
struct Marked {
    knots: Knots,
    grid_from_world: DAffine3,
    marked: Vec<bool>,
}

impl Marked {
    /// A box about all of them.
    fn about(&self) -> Option<Aabb> {
        let marked = (0..self.marked.len()).filter(|n| self.marked[*n]);
        Aabb::about(marked.map(|n| {
            let at = place(n, self.knots.count);
            let at = std::array::from_fn(|a| self.knots.lo[a] + at[a] as i64);
            self.knots.frame.node(at)
        }))
    }

    /// Whether a place belongs to one.
    fn holds(&self, p: DVec3) -> bool {
        let [_, ny, nz] = self.knots.count;
        let at = self.grid_from_world.transform_point3(p).round().to_array();
        let at: [usize; 3] = std::array::from_fn(|a| (at[a] as i64 - self.knots.lo[a]) as usize);
        let is_there = (0..3).all(|a| at[a] < self.knots.count[a]);
        is_there && self.marked[(at[0] * ny + at[1]) * nz + at[2]]
    }
}

/// A field that is another about the knots that are marked.
struct Restored<'a, T> {
    before: &'a HierarchicalSpline<T>,
    after: &'a HierarchicalSpline<T>,
    marked: Marked,
}

impl<T: Real> Restored<'_, T> {
    fn at(&self, p: DVec3) -> &HierarchicalSpline<T> {
        if self.marked.holds(p) {
            self.before
        } else {
            self.after
        }
    }
}

impl<T: Real> Field for Restored<'_, T> {
    fn value(&self, p: DVec3) -> f64 {
        self.at(p).value(p)
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.at(p).value_gradient(p)
    }

    fn jet(&self, p: DVec3) -> Jet {
        self.at(p).jet(p)
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        self.before.bounds(b).hull(self.after.bounds(b))
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        self.after.frame_values(frame, lo, count, out);
        for (n, value) in out.iter_mut().enumerate() {
            let at = place(n, count);
            let p = frame.node(std::array::from_fn(|a| lo[a] + at[a] as i64));
            if self.marked.holds(p) {
                *value = self.before.value(p);
            }
        }
    }
}
