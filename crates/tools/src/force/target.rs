use bspline::Field;

use super::path::{Path, first_crossing};
use super::quadrature::{Integral, Tolerance, integrate};

/// Radii that a surface is looked for behind the start of a path, and beyond its end.
const BEYOND: f64 = 3.0;

/// A path on which the surface is to go from its start to its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The way.
    pub path: Path,
    /// Length, or area, of the tool that it stands for.
    pub weight: f64,
    /// Whether the solid grows along it; it starts in the solid then, and in front of it otherwise.
    pub grows: bool,
    /// Whether it ends where it would meet the surface again: for holes and bridges.
    pub ends_early: bool,
    /// Way of the tool along its track at which it begins to act.
    pub begins: f64,
}

/// Where a path stands: between the surface and where it is to go now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Arc length of its nearer end.
    pub from: f64,
    /// Arc length of its farther end.
    pub to: f64,
    /// Whether the far side of a gap ends it before its goal.
    pub is_gap: bool,
}

/// How a path lay in the field when its stroke began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Arc length of the surface.
    pub at: f64,
    /// Fall of the density per length there, along the path; 0 where it rises.
    pub fall: f64,
}

impl Target {
    /// A tool of one path.
    pub fn single(path: Path, grows: bool) -> Self {
        Self {
            path,
            weight: 1.0,
            grows,
            ends_early: false,
            begins: 0.0,
        }
    }

    /// How far the field is on the side of the start, by arc length.
    fn behind(&self, value: &impl Fn(glam::DVec3) -> f64, iso: f64, s: f64) -> f64 {
        let above = value(self.path.at(s)) - iso;
        if self.grows { above } else { -above }
    }

    /// Arc length at which the surface is now; `None` where there is none along the path.
    pub fn crossing(
        &self,
        value: &impl Fn(glam::DVec3) -> f64,
        iso: f64,
        radius: f64,
        step: f64,
    ) -> Option<f64> {
        let end = self.path.length() + BEYOND * radius;
        let behind = |s| self.behind(value, iso, s);
        first_crossing(behind, BEYOND * radius, end, step).filter(|s| *s < end)
    }

    /// How it lies in a field.
    pub fn start(
        &self,
        value: &impl Fn(glam::DVec3) -> f64,
        iso: f64,
        radius: f64,
        step: f64,
    ) -> Option<Start> {
        let at = self.crossing(value, iso, radius, step)?;
        let behind = |s| self.behind(value, iso, s);
        let fall = (behind(at - step) - behind(at + step)) / (2.0 * step);
        Some(Start {
            at,
            fall: fall.max(0.0),
        })
    }

    /// Where a surface at `crossing` counts as being if it is to come to `goal`: at the goal where it has met what was there
    /// `before`.
    pub fn own(
        &self,
        before: &impl Fn(glam::DVec3) -> f64,
        iso: f64,
        start: Start,
        [crossing, goal]: [f64; 2],
        step: f64,
    ) -> f64 {
        let mut s = goal.max(start.at + step);
        while s < crossing {
            if self.behind(before, iso, s) > 0.0 {
                return goal;
            }
            s += step;
        }
        crossing
    }

    /// What is left of the path from a crossing to the arc length `goal`, or to the far side of a gap before it; `None` if
    /// nothing is to be done.
    pub fn span(
        &self,
        value: &impl Fn(glam::DVec3) -> f64,
        iso: f64,
        crossing: f64,
        goal: f64,
        step: f64,
    ) -> Option<Span> {
        if crossing >= goal {
            return (!self.ends_early).then_some(Span {
                from: goal,
                to: crossing,
                is_gap: false,
            });
        }
        let start = crossing + 1e-6 * step;
        let before = |s: f64| -self.behind(value, iso, start + s);
        let ahead = goal - start;
        let far = first_crossing(before, 0.0, ahead, 0.5 * step);
        let is_gap = far.is_some_and(|s| s < ahead);
        Some(Span {
            from: crossing,
            to: if is_gap || self.ends_early {
                start + far.unwrap_or(0.0)
            } else {
                goal
            },
            is_gap,
        })
    }

    /// `∫(c − s)dc` over a span.
    pub fn integral(
        &self,
        value: impl Fn(glam::DVec3) -> f64,
        iso: f64,
        span: Span,
        tolerance: Tolerance,
    ) -> Integral {
        integrate(|s| iso - value(self.path.at(s)), span.from, span.to, tolerance)
    }

    /// The same of a field, from where the path crosses its surface now to its end: `F/α` \[Hua04 eq. 7\]. 0 where it does
    /// not cross.
    pub fn force_of(&self, field: &dyn Field, iso: f64, radius: f64, step: f64, tolerance: Tolerance) -> f64 {
        let value = |p| field.value(p);
        let span = self
            .crossing(&value, iso, radius, step)
            .and_then(|at| self.span(&value, iso, at, self.path.length(), step));
        span.map_or(0.0, |span| self.integral(value, iso, span, tolerance).value)
    }
}
