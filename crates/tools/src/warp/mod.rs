//! Smooth motions of space, which carry a solid with all its detail.
//!
//! A motion `w` takes a field `f` to `f(w⁻¹(x))` ([`Warped`]). It is made of steps that give the way back in a formula and are
//! so short that none folds space over itself; so neither does the whole, however far it goes.

mod step;
mod warped;
mod zone;

use bspline::Aabb;
use glam::{DMat3, DVec3};

use crate::fade::STEEPEST;
use step::Step;
pub(crate) use step::rotation;
use zone::Zone;

pub use warped::Warped;

/// Bound on `|∇k|·(|θ|·distance + |δ|)` of one step; folds begin at 1. Between ¼ and ¾ the result of a long pull does not
/// change by more than a hundredth of it.
const STRETCH: f64 = 0.4;

/// Most steps of a motion.
const MOST_STEPS: f64 = 4096.0;

/// A motion of space without folds.
#[derive(Clone, Debug)]
pub struct Warp {
    /// In the order of time.
    steps: Vec<Step>,
}

/// Why there is no such motion: a sentence.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct WarpError(String);

impl WarpError {
    pub(crate) fn new(why: impl Into<String>) -> Self {
        Self(why.into())
    }
}

impl Warp {
    /// Takes what lies within `rigid` of the hand along as it moves from place to place, and what lies within `radius` in part.
    ///
    /// # Errors
    /// [`WarpError`] for a path without length, a radius that is not above `rigid`, or a path too long for its radius.
    pub fn grab(along: &[DVec3], rigid: f64, radius: f64) -> Result<Self, WarpError> {
        if !(rigid >= 0.0 && radius > rigid) {
            return Err(WarpError(format!(
                "the radius {radius} has to be above rigid, {rigid}, which is 0 or more"
            )));
        }
        let ball = |center| Zone::Ball {
            center,
            inner: rigid,
            outer: radius,
        };
        Self::carried(along, ball)
    }

    /// Takes what lies in a box along by a displacement, and what lies within `width` of it in part.
    ///
    /// # Errors
    /// [`WarpError`] for a box without size, a displacement without length, a width that is not above 0, or a displacement
    /// too long for it.
    pub fn shift(region: &Aabb, by: DVec3, width: f64) -> Result<Self, WarpError> {
        if !(region.min.cmplt(region.max).all() && width > 0.0) {
            return Err(WarpError(format!(
                "the box {} to {} has to have a size, and the width {width} about it to be above 0",
                region.min, region.max
            )));
        }
        let (from, half) = (region.center(), 0.5 * region.size());
        let zone = |center| Zone::Box { center, half, width };
        Self::carried(&[from, from + by], zone)
    }

    /// Bends what lies before `at` by `angle` about an axis through it; `direction` points to the side that turns. The bend is
    /// spread over `length`. `within` bounds what the motion has to be free of folds for.
    ///
    /// # Errors
    /// [`WarpError`] for vectors without direction or along one another, an angle of 0 or beyond a full turn, a length that is not
    /// above 0, or one too short for the box.
    pub fn bend(
        at: DVec3,
        axis: DVec3,
        direction: DVec3,
        angle: f64,
        length: f64,
        within: &Aabb,
    ) -> Result<Self, WarpError> {
        let (axis, normal) = (unit("axis", axis)?, unit("direction", direction)?);
        if axis.cross(normal).length() < 1e-3 {
            return Err(WarpError(
                "axis and direction point the same way; that is a twist".into(),
            ));
        }
        check_turn(angle, length)?;
        let farthest = (within.min - at).abs().max((within.max - at).abs()).length();
        let steps = count_of(STEEPEST * angle.abs() * farthest / length)?;
        let step = |i: usize| {
            // The plane between what rests and what turns follows by half.
            let share = (i as f64 + 0.5) / steps as f64;
            let normal = rotation(axis, 0.5 * share * angle) * normal;
            Step {
                zone: Zone::Half {
                    start: at - 0.5 * length * normal,
                    normal,
                    width: length,
                },
                pivot: at,
                axis,
                angle: angle / steps as f64,
                shift: DVec3::ZERO,
            }
        };
        Ok(Self {
            steps: (0..steps).map(step).collect(),
        })
    }

    /// Twists by `angle` about an axis: nothing behind `at`, the whole angle from `length` before it on.
    ///
    /// # Errors
    /// [`WarpError`] for an axis without direction, an angle of 0 or beyond a hundred turns, a length that is not above 0.
    pub fn twist(at: DVec3, axis: DVec3, angle: f64, length: f64) -> Result<Self, WarpError> {
        let normal = unit("axis", axis)?;
        let zone = Zone::Half {
            start: at,
            normal,
            width: length,
        };
        Self::turned(at, normal, angle, length, zone)
    }

    /// Twists a ball about an axis through its middle: by `angle` in the middle, not at all from `radius` on.
    ///
    /// # Errors
    /// [`WarpError`] for an axis without direction, an angle of 0 or beyond a hundred turns, a radius that is not above 0.
    pub fn swirl(at: DVec3, axis: DVec3, angle: f64, radius: f64) -> Result<Self, WarpError> {
        let zone = Zone::Ball {
            center: at,
            inner: 0.0,
            outer: radius,
        };
        Self::turned(at, unit("axis", axis)?, angle, radius, zone)
    }

    /// Turns under which no point changes its share fold nothing, so one step is enough.
    fn turned(at: DVec3, axis: DVec3, angle: f64, length: f64, zone: Zone) -> Result<Self, WarpError> {
        check_turn(angle, length)?;
        Ok(Self {
            steps: vec![Step {
                zone,
                pivot: at,
                axis,
                angle,
                shift: DVec3::ZERO,
            }],
        })
    }

    /// A zone that goes along a path.
    fn carried(along: &[DVec3], zone: impl Fn(DVec3) -> Zone) -> Result<Self, WarpError> {
        if !along.iter().all(|p| p.is_finite()) {
            return Err(WarpError("a place of the path is not finite".into()));
        }
        let mut steps = Vec::new();
        for leg in along.windows(2).filter(|leg| leg[0] != leg[1]) {
            let way = leg[1] - leg[0];
            let count = count_of(zone(leg[0]).steepest() * way.length())?;
            let shift = way / count as f64;
            steps.extend((1..=count).map(|i| Step {
                // The way back starts where the step has led.
                zone: zone(leg[0] + shift * i as f64),
                pivot: DVec3::ZERO,
                axis: DVec3::Z,
                angle: 0.0,
                shift,
            }));
        }
        match steps.len() {
            0 => Err(WarpError(
                "the path leads nowhere; write at least two different places".into(),
            )),
            n if n as f64 > MOST_STEPS => Err(too_long()),
            _ => Ok(Self { steps }),
        }
    }

    /// `w⁻¹(y)`: where what is now at `y` came from; `y` to the bit where nothing moved.
    pub fn back(&self, y: DVec3) -> DVec3 {
        self.steps.iter().rev().fold(y, |y, step| step.back(y))
    }

    /// `w⁻¹(y)` and its matrix of derivatives.
    pub fn back_jacobian(&self, y: DVec3) -> (DVec3, DMat3) {
        let steps = self.steps.iter().rev();
        steps.fold((y, DMat3::IDENTITY), |(y, all), step| {
            let (at, jacobian) = step.back_jacobian(y);
            (at, jacobian * all)
        })
    }

    /// `w(x)`: where what was at `x` goes, to rounding.
    pub fn forth(&self, x: DVec3) -> DVec3 {
        self.steps.iter().fold(x, |x, step| step.forth(x))
    }

    /// A box outside which nothing moves; infinite where a motion has no end.
    pub fn reach(&self) -> Aabb {
        let boxes = self.steps.iter().map(|step| step.zone.reach());
        boxes.reduce(Aabb::hull).expect("a motion has a step")
    }

    /// A box that holds `w⁻¹` of all of `b`; `b` itself where nothing moves.
    fn back_box(&self, b: &Aabb) -> Aabb {
        let steps = self.steps.iter().rev();
        steps.fold(*b, |b, step| step.back_box(&b))
    }

    /// Whether nothing in `b` moves.
    fn rests_in(&self, b: &Aabb) -> bool {
        self.steps.iter().all(|step| step.zone.range(b).hi == 0.0)
    }
}

fn count_of(stretch: f64) -> Result<usize, WarpError> {
    let count = (stretch / STRETCH).ceil().max(1.0);
    match count <= MOST_STEPS {
        true => Ok(count as usize),
        false => Err(too_long()),
    }
}

fn too_long() -> WarpError {
    WarpError("the motion is too long for what it is spread over; make it shorter, or its reach wider".into())
}

fn unit(name: &str, v: DVec3) -> Result<DVec3, WarpError> {
    let direction = v.try_normalize();
    direction.ok_or_else(|| {
        WarpError(format!(
            "{name} {:?} gives no direction; write one that is not zero",
            v.to_array()
        ))
    })
}

fn check_turn(angle: f64, length: f64) -> Result<(), WarpError> {
    let turns = angle.abs() / std::f64::consts::TAU;
    if !(turns > 0.0 && turns <= 100.0) {
        return Err(WarpError(format!(
            "the angle is {} degrees; write one that is not 0, and at most 36000",
            angle.to_degrees()
        )));
    }
    match length > 0.0 && length.is_finite() {
        true => Ok(()),
        false => Err(WarpError(format!(
            "the turn is spread over {length}; write a length above 0"
        ))),
    }
}
