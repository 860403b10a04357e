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

    /// What is left of the path from a crossing to the arc length `goal`; `None` if nothing is to be done.
    pub fn span(
        &self,
        value: &impl Fn(glam::DVec3) -> f64,
        iso: f64,
        crossing: f64,
        goal: f64,
        step: f64,
    ) -> Option<Span> {
        if !self.ends_early {
            return Some(Span {
                from: crossing.min(goal),
                to: crossing.max(goal),
            });
        }
        if crossing >= goal {
            return None;
        }
        let start = crossing + 1e-6 * step;
        let before = |s: f64| -self.behind(value, iso, start + s);
        let to = first_crossing(before, 0.0, goal - start, 0.5 * step).map_or(start, |s| start + s);
        Some(Span { from: crossing, to })
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
