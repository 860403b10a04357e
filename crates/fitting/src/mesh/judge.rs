//! Which cells are worth splitting.
//!
//! A smooth field cannot have an edge. Where the normal of the surface jumps by `Δ` the zero set stays `0.1 Δ h` away
//! from it, so half the error costs twice the cells along the edge; elsewhere it buys a sixteenth for four times
//! the cells. So cells at creases are told from others by how the error fell from the cell above, and are split only
//! while what they leave matters for the whole and they cost no more than the rest.

use std::ops::Range;

use glam::DVec3;

use super::Plan;
use super::probes::{Cell, Octants, cell_of};
use crate::StopReason;

/// Share of the tolerance that is aimed at: cells beside refined ones move a little after they were judged.
const AIM: f64 = 0.8;
/// An error off the surface below so many cells is that of a ridge of the distance, where the zero set is none.
const RIDGE: f64 = 0.2;
/// Mean square of `|∇f + n|` on the surface above which the field does not see its sheets: opposite ones cancel.
const BLIND: f64 = 0.5;
/// The error fell by less than this factor: the cell is at a crease. It halves there, and elsewhere is an eighth to a
/// sixteenth.
const FALL: f64 = 0.3;
/// Slopes of the field below this are taken for it where distances to the zero set are told.
const LEAST_SLOPE: f64 = 0.25;

/// Distances from points of the surface to the zero set.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Misses {
    pub count: u32,
    square: f64,
    pub max: f64,
}

impl Misses {
    /// A point of the surface, with value and gradient of the field there.
    pub fn add(&mut self, (f, slope): (f64, DVec3)) {
        self.add_error(f.abs() / slope.length().max(LEAST_SLOPE));
    }

    pub fn add_error(&mut self, error: f64) {
        self.count += 1;
        self.square += error * error;
        self.max = self.max.max(error);
    }

    pub fn rms(&self) -> f64 {
        (self.square / f64::from(self.count.max(1))).sqrt()
    }
}

/// A leaf as it was judged.
pub(super) struct LeafCell {
    pub depth: usize,
    pub at: [u32; 3],
    pub reason: StopReason,
    /// Area of the surface in it, unit box, about.
    pub area: f64,
    /// Feet of its parts that lie in it.
    pub feet: Range<usize>,
}

/// Errors of a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quality {
    /// At the feet of its parts.
    pub feet: Misses,
    /// At the corners of the surface.
    pub corners: Misses,
    /// Sum of `|∇f + n|²` over the feet.
    turn: f64,
    /// Parts in which the field is not the distance, not even but for a ridge.
    pub lost: u8,
    /// Parts that the surface passes through.
    touched: u8,
}

impl Quality {
    pub fn of(
        cell: &Cell,
        octants: &Octants,
        depth: usize,
        plan: &Plan,
        value: impl Fn(DVec3) -> f64,
        field: impl Fn(DVec3) -> (f64, DVec3),
    ) -> Self {
        let mut out = Self::default();
        let h = 0.5f64.powi(depth as i32);
        for (o, found) in octants.iter().enumerate() {
            let place = cell.part(o, depth);
            let error = (value(place) - found.value()).abs();
            let allowed = plan.allowed(found.distance, found.in_hole());
            if error > allowed.max(RIDGE * h) {
                out.lost |= 1 << o;
            }
            if !found.in_hole() && found.distance <= plan.band {
                out.feet.add_error(error);
            }
            if found.distance <= 0.433 * h {
                out.touched |= 1 << o;
            }
            if cell_of(found.foot, depth) == cell.at {
                let (f, slope) = field(found.foot);
                out.feet.add((f, slope));
                out.turn += found
                    .gradient(place)
                    .map_or(0.0, |g| (slope - g).length_squared());
            }
        }
        out
    }

    /// Root mean square error at the feet or the corners, whichever is larger.
    pub fn rms(&self) -> f64 {
        self.feet.rms().max(self.corners.rms())
    }

    /// Area of the surface in a cell of edge `h`, about.
    pub fn area(&self, h: f64) -> f64 {
        f64::from(self.touched.count_ones()) * 0.25 * h * h
    }

    /// Whether the field has not found the surface yet.
    pub fn is_lost(&self) -> bool {
        self.lost != 0 || self.turn > BLIND * f64::from(self.feet.count)
    }
}

/// What a cell asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It is within the tolerance.
    Fine,
    /// It is worth splitting.
    Split,
    /// It is above the tolerance at a crease.
    Crease,
}

pub(super) fn verdict(quality: &Quality, cell: &Cell, plan: &Plan) -> Verdict {
    let rms = quality.rms();
    if quality.is_lost() {
        Verdict::Split
    } else if rms <= AIM * plan.tolerance {
        Verdict::Fine
    } else if rms <= FALL * f64::from(cell.error_above) {
        Verdict::Split
    } else {
        Verdict::Crease
    }
}
