use std::any::Any;
use std::sync::Arc;

use glam::DVec3;

use super::{CsgError, changed_branches, node_of};
use crate::{Aabb, Field, Frame, Interval, Jet};

/// Points of a batch that are pruned together: enough to pay for the bounds, few enough to lie close together
/// in a sorted batch.
const CHUNK: usize = 64;

/// Edges of the blocks of grid nodes that are not divided further, where two branches live and where more do: 16
/// and 8 cells with the nodes at both ends.
const BLOCK: [usize; 2] = [17, 9];

/// Which value wins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// The largest.
    Union,
    /// The smallest.
    Intersection,
}

/// The largest or smallest of several fields, each as it is or reflected about an iso-value.
///
/// Where several branches are equal the first of them gives gradient and Hessian.
#[derive(Clone)]
pub struct Boolean {
    operation: Operation,
    branches: Vec<Branch>,
}

#[derive(Clone)]
struct Branch {
    field: Arc<dyn Field>,
    /// `Some(2c)` stands for `2c - f`, the complement at iso-value `c`.
    twice_iso: Option<f64>,
}

impl Branch {
    fn plain(field: Arc<dyn Field>) -> Self {
        Self {
            field,
            twice_iso: None,
        }
    }

    fn map(&self, value: f64) -> f64 {
        self.twice_iso.map_or(value, |c| c - value)
    }

    fn map_interval(&self, range: Interval) -> Interval {
        self.twice_iso.map_or(range, |c| Interval::point(c) - range)
    }

    fn value_gradient(&self, (value, gradient): (f64, DVec3)) -> (f64, DVec3) {
        (
            self.map(value),
            if self.twice_iso.is_some() {
                -gradient
            } else {
                gradient
            },
        )
    }
}

/// The nodes asked for, where their values go, and room for those of one block.
struct Grid<'a> {
    frame: &'a Frame,
    lo: [i64; 3],
    count: [usize; 3],
    out: &'a mut [f64],
    block: Vec<f64>,
    term: Vec<f64>,
}

impl Boolean {
    /// Union or intersection.
    ///
    /// # Errors
    /// [`CsgError::NoBranches`].
    pub fn new(operation: Operation, solids: Vec<Arc<dyn Field>>) -> Result<Self, CsgError> {
        if solids.is_empty() {
            return Err(CsgError::NoBranches);
        }
        Ok(Self {
            operation,
            branches: solids.into_iter().map(Branch::plain).collect(),
        })
    }

    /// `solid` without `taken`, at iso-value `iso`.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn difference(solid: Arc<dyn Field>, taken: Vec<Arc<dyn Field>>, iso: f64) -> Result<Self, CsgError> {
        if !(2.0 * iso).is_finite() {
            return Err(CsgError::NotFinite {
                name: "twice the iso-value",
                value: 2.0 * iso,
            });
        }
        let mut branches = vec![Branch::plain(solid)];
        branches.extend(taken.into_iter().map(|field| Branch {
            field,
            twice_iso: Some(2.0 * iso),
        }));
        Ok(Self {
            operation: Operation::Intersection,
            branches,
        })
    }

    /// Which value wins.
    pub fn operation(&self) -> Operation {
        self.operation
    }

    /// The fields, and the iso-value about which each is reflected, if it is.
    pub fn branches(&self) -> impl Iterator<Item = (&Arc<dyn Field>, Option<f64>)> {
        self.branches
            .iter()
            .map(|b| (&b.field, b.twice_iso.map(|c| c / 2.0)))
    }

    /// Whether `challenger`, of a later branch, takes the place of `best`. Equal values do not, nor does NaN.
    fn wins(&self, challenger: f64, best: f64) -> bool {
        match self.operation {
            Operation::Union => challenger > best,
            Operation::Intersection => challenger < best,
        }
    }

    /// The winner over the branches: its index and what `of` gave for it.
    fn select<R>(&self, of: impl Fn(&Branch) -> (f64, R)) -> (&Branch, f64, R) {
        let (first, rest) = self.branches.split_first().expect("a Boolean has a branch");
        let (value, found) = of(first);
        let mut best = (first, value, found);
        for branch in rest {
            let (value, found) = of(branch);
            if self.wins(value, best.1) {
                best = (branch, value, found);
            }
        }
        best
    }

    fn combine(&self, ranges: impl Iterator<Item = Interval>) -> Interval {
        let best = match self.operation {
            Operation::Union => ranges.reduce(Interval::max),
            Operation::Intersection => ranges.reduce(Interval::min),
        };
        best.expect("a Boolean has a branch")
    }

    /// Those of `candidates` that can win where their ranges are as `range` says, in order; at least one.
    fn live<'a>(&self, candidates: &[&'a Branch], range: impl Fn(&dyn Field) -> Interval) -> Vec<&'a Branch> {
        if let [only] = candidates {
            return vec![only];
        }
        let ranges: Vec<Interval> = candidates
            .iter()
            .map(|b| b.map_interval(range(b.field.as_ref())))
            .collect();
        let best = self.combine(ranges.iter().copied());
        // Strictly beaten everywhere: even a tie keeps a branch, so that values and gradients are those of the
        // whole tree to the bit.
        let lives = |r: &Interval| match self.operation {
            Operation::Union => r.hi >= best.lo || r.hi.is_nan(),
            Operation::Intersection => r.lo <= best.hi || r.lo.is_nan(),
        };
        candidates
            .iter()
            .zip(&ranges)
            .filter(|(_, r)| lives(r))
            .map(|(b, _)| *b)
            .collect()
    }

    /// [`Self::live`] of two, but that the second may be left to its values: the bounds of a spline, which is the first
    /// of most pairs, cost more than its values unless one only asks about a level.
    fn live_pair<'a>(
        &self,
        [first, second]: [&'a Branch; 2],
        frame: &Frame,
        lo: [i64; 3],
        hi: [i64; 3],
    ) -> Vec<&'a Branch> {
        let range = second.map_interval(second.field.frame_bounds(frame, lo, hi));
        let beats = match self.operation {
            Operation::Union => range.lo,
            Operation::Intersection => range.hi,
        };
        let about = first.map_interval(first.field.frame_bounds_about(frame, lo, hi, first.map(beats)));
        let is_beaten = match self.operation {
            Operation::Union => about.hi < beats,
            Operation::Intersection => about.lo > beats,
        };
        if is_beaten {
            vec![second]
        } else {
            vec![first, second]
        }
    }

    /// Whether a later branch within `range` can take the place of none of `best`.
    fn is_beaten(&self, range: Interval, best: &[f64]) -> bool {
        match self.operation {
            Operation::Union => best.iter().all(|b| range.hi <= *b),
            Operation::Intersection => best.iter().all(|b| range.lo >= *b),
        }
    }

    /// Values of the block of `count` nodes from node `start` of `grid`, of which only `candidates` can decide:
    /// divided until few of them live.
    fn fill(&self, candidates: &[&Branch], grid: &mut Grid, start: [usize; 3], count: [usize; 3]) {
        let lo: [i64; 3] = std::array::from_fn(|a| grid.lo[a] + start[a] as i64);
        let hi: [i64; 3] = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        let live = match candidates {
            [first, second] => self.live_pair([first, second], grid.frame, lo, hi),
            _ => self.live(candidates, |field| field.frame_bounds(grid.frame, lo, hi)),
        };
        let edge = BLOCK[usize::from(live.len() > 2)];
        if live.len() > 1 && count.iter().any(|n| *n > edge) {
            let halves: [usize; 3] = std::array::from_fn(|a| {
                if count[a] > edge {
                    count[a].div_ceil(2)
                } else {
                    count[a]
                }
            });
            for octant in 0..8usize {
                let upper = [octant >> 2 & 1, octant >> 1 & 1, octant & 1];
                let part = std::array::from_fn(|a| [halves[a], count[a] - halves[a]][upper[a]]);
                if part.iter().all(|n| *n > 0) {
                    let from = std::array::from_fn(|a| start[a] + halves[a] * upper[a]);
                    self.fill(&live, grid, from, part);
                }
            }
        } else if count == grid.count {
            let mut term = std::mem::take(&mut grid.term);
            self.block_values(&live, grid.frame, lo, count, grid.out, &mut term);
        } else {
            let (mut block, mut term) = (std::mem::take(&mut grid.block), std::mem::take(&mut grid.term));
            block.resize(count.iter().product(), 0.0);
            self.block_values(&live, grid.frame, lo, count, &mut block, &mut term);
            for (row, values) in block.chunks(count[2]).enumerate() {
                let (x, y) = (start[0] + row / count[1], start[1] + row % count[1]);
                let at = (x * grid.count[1] + y) * grid.count[2] + start[2];
                grid.out[at..at + count[2]].copy_from_slice(values);
            }
            (grid.block, grid.term) = (block, term);
        }
    }

    /// Values of one block from the branches that may win there. `term` is room for those of one; of a pair
    /// the second is left out where its bounds say that it beats none of the first's values.
    fn block_values(
        &self,
        live: &[&Branch],
        frame: &Frame,
        lo: [i64; 3],
        count: [usize; 3],
        out: &mut [f64],
        term: &mut Vec<f64>,
    ) {
        let (first, rest) = live.split_first().expect("a branch lives everywhere");
        first.field.frame_values(frame, lo, count, out);
        let rest = rest.iter().copied();
        self.add_branches(first, rest, live.len() == 2, frame, lo, count, out, term);
    }

    /// The values of one block where `out` holds those of the `first` branch's field; `prunes` says whether others are left
    /// out by their bounds.
    fn add_branches<'a>(
        &self,
        first: &Branch,
        rest: impl IntoIterator<Item = &'a Branch>,
        prunes: bool,
        frame: &Frame,
        lo: [i64; 3],
        count: [usize; 3],
        out: &mut [f64],
        term: &mut Vec<f64>,
    ) {
        if first.twice_iso.is_some() {
            out.iter_mut().for_each(|v| *v = first.map(*v));
        }
        let hi = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        for branch in rest {
            let range = || branch.map_interval(branch.field.frame_bounds(frame, lo, hi));
            if prunes && self.is_beaten(range(), out) {
                continue;
            }
            term.resize(out.len(), 0.0);
            branch.field.frame_values(frame, lo, count, term);
            if branch.twice_iso.is_some() {
                term.iter_mut().for_each(|t| *t = branch.map(*t));
            }
            let pairs = out.iter_mut().zip(term.iter());
            // Decided outside of the loops, and without a jump in them: so they are vectorized.
            match self.operation {
                Operation::Union => pairs.for_each(|(o, t)| *o = if *t > *o { *t } else { *o }),
                Operation::Intersection => pairs.for_each(|(o, t)| *o = if *t < *o { *t } else { *o }),
            }
        }
    }
}

impl Field for Boolean {
    fn value(&self, p: DVec3) -> f64 {
        self.select(|b| (b.map(b.field.value(p)), ())).1
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (_, value, gradient) = self.select(|b| b.value_gradient(b.field.value_gradient(p)));
        (value, gradient)
    }

    fn jet(&self, p: DVec3) -> Jet {
        // Values decide as in the other methods; only the winner's jet is asked for.
        let (branch, value, gradient) = self.select(|b| b.value_gradient(b.field.value_gradient(p)));
        let hessian = branch.field.jet(p).hessian;
        Jet {
            value,
            gradient,
            hessian: if branch.twice_iso.is_some() {
                -hessian
            } else {
                hessian
            },
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        self.combine(
            self.branches
                .iter()
                .map(|branch| branch.map_interval(branch.field.bounds(b))),
        )
    }

    /// All branches that can win somewhere in the box.
    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        let all: Vec<&Branch> = self.branches.iter().collect();
        let live = self.live(&all, |field| field.bounds(b));
        let ranges = live.iter().map(|branch| {
            let range = branch.field.gradient_bounds(b);
            if branch.twice_iso.is_some() {
                range.map(|g| -g)
            } else {
                range
            }
        });
        ranges
            .reduce(|a, b| std::array::from_fn(|i| a[i].hull(b[i])))
            .expect("a branch lives everywhere")
    }

    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        self.combine(
            self.branches
                .iter()
                .map(|branch| branch.map_interval(branch.field.bounds_along(from, to))),
        )
    }

    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        let same_kind = |before: &&Self| {
            let signs = |node: &Self| node.branches.iter().map(|b| b.twice_iso).collect::<Vec<_>>();
            self.operation == before.operation && signs(self) == signs(before)
        };
        let before = node_of::<Self>(before).filter(same_kind);
        let pairs = before.map(|before| self.branches.iter().zip(&before.branches));
        changed_branches(
            pairs.map(|p| p.map(|(now, before)| (&now.field, &before.field))),
            within,
        )
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    /// Infinite where two branches can win: there may be a crease.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let all: Vec<&Branch> = self.branches.iter().collect();
        match self.live(&all, |field| field.bounds(b))[..] {
            [only] => only.field.hessian_bound(b),
            _ => f64::INFINITY,
        }
    }

    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        assert_eq!(points.len(), out.len(), "one output slot per point");
        let mut term = [(0.0, DVec3::ZERO); CHUNK];
        let all: Vec<&Branch> = self.branches.iter().collect();
        for (points, out) in points.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
            let (min, max) = points
                .iter()
                .fold((points[0], points[0]), |b, p| (b.0.min(*p), b.1.max(*p)));
            // NaN hides from min and max: such a batch is not pruned.
            let known = points.iter().all(|p| p.is_finite());
            let live = self.live(&all, |field| {
                if known {
                    field.bounds(&Aabb { min, max })
                } else {
                    Interval::EVERYTHING
                }
            });
            let (first, rest) = live.split_first().expect("a branch lives everywhere");
            first.field.values_gradients(points, out);
            out.iter_mut().for_each(|o| *o = first.value_gradient(*o));
            let term = &mut term[..points.len()];
            for branch in rest {
                branch.field.values_gradients(points, term);
                for (o, t) in out.iter_mut().zip(term.iter()) {
                    let t = branch.value_gradient(*t);
                    if self.wins(t.0, o.0) {
                        *o = t;
                    }
                }
            }
        }
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        assert_eq!(
            out.len(),
            count.iter().product::<usize>(),
            "one output slot per node"
        );
        if out.is_empty() {
            return;
        }
        let all: Vec<&Branch> = self.branches.iter().collect();
        let mut grid = Grid {
            frame,
            lo,
            count,
            out,
            block: Vec::new(),
            term: Vec::new(),
        };
        self.fill(&all, &mut grid, [0; 3], count);
    }

    /// Where the first branch is known.
    fn frame_values_from(
        &self,
        known: &dyn Field,
        values: &[f64],
        frame: &Frame,
        lo: [i64; 3],
        count: [usize; 3],
        out: &mut [f64],
    ) -> bool {
        let (first, rest) = self.branches.split_first().expect("a Boolean has a branch");
        let is_known = first
            .field
            .frame_values_from(known, values, frame, lo, count, out);
        if is_known && !out.is_empty() {
            self.add_branches(first, rest, true, frame, lo, count, out, &mut Vec::new());
        }
        is_known
    }

    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        self.combine(
            self.branches
                .iter()
                .map(|b| b.map_interval(b.field.frame_bounds(frame, lo, hi))),
        )
    }
}
