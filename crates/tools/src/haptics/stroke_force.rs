//! The force of a tool that pulls, as the hand feels it between the steps of the simulation.

use glam::DVec3;

/// How a stroke is felt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeForceOptions {
    /// Newtons for each unit of the stroke's force; see [`newtons_per_unit`].
    pub scale: f64,
    /// Largest force, N.
    pub most: f64,
    /// Largest stiffness, N/m: what the device at hand can stand.
    pub stiffness: f64,
    /// Largest change of the force, N/s.
    pub slew: f64,
    /// Period of the simulation, s: what comes with a step comes within it.
    pub period: f64,
}

impl StrokeForceOptions {
    /// At a scale, with 30 steps a second: 3 N, 500 N/m and 0.1 N in a thousandth of a second at most.
    pub fn of_scale(scale: f64) -> Self {
        Self {
            scale,
            most: 3.0,
            stiffness: 500.0,
            slew: 100.0,
            period: 1.0 / 30.0,
        }
    }
}

/// Scale at which a drag by one radius of the tool in unpainted matter is felt as so many newtons. `rigidity` is what it asks for by
/// [`ForceStroke::rigidity`](crate::force::ForceStroke::rigidity), `radius` the tool's, both in the same lengths; 0 where nothing gives way.
pub fn newtons_per_unit(newtons: f64, unpainted_rigidity: f64, radius: f64) -> f64 {
    let asked = unpainted_rigidity * radius;
    if asked > 0.0 && asked.is_finite() {
        newtons / asked
    } else {
        0.0
    }
}

/// What a step of the simulation tells of a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeStep {
    /// Which step.
    pub number: u64,
    /// Where the tool took hold, mm.
    pub reference: DVec3,
    /// Where the hand was in this step, mm.
    pub cursor: DVec3,
    /// Magnitude of the stroke's force, in its own unit.
    pub force: f64,
    /// What more it asks for each millimetre that the hand goes on, in its own unit.
    pub rigidity: f64,
}

/// The felt force of a stroke: along the line from the place where the tool took hold to the cursor \[Hua04 §6.1\], against the pull.
///
/// Between the steps it is that of a spring: `|F| = s(T + k(ℓ − ℓₙ))`, with `T` the stroke's force at the last step, `k` its rigidity, `ℓ` the way of the
/// hand from the reference point, `ℓₙ` that at the step, `s` the scale; not below 0 nor above what is allowed. When a step comes, the difference to
/// what was felt goes to 0 within a period.
#[derive(Clone, Debug)]
pub struct StrokeForce {
    options: StrokeForceOptions,
    step: Option<StrokeStep>,
    /// What was felt beyond the step at hand when that came.
    rest: DVec3,
    /// Share of the period since then.
    share: f64,
    last: DVec3,
}

impl StrokeForce {
    /// Of a stroke that has not begun.
    pub fn new(options: StrokeForceOptions) -> Self {
        Self {
            options,
            step: None,
            rest: DVec3::ZERO,
            share: 1.0,
            last: DVec3::ZERO,
        }
    }

    /// A tick of `dt` seconds with the hand at a place, mm, and what the simulation told last; none where there is no stroke any more. Returns the
    /// force on the hand, N.
    pub fn tick(&mut self, step: Option<&StrokeStep>, hand: DVec3, dt: f64) -> DVec3 {
        if self.step.map(|s| s.number) != step.map(|s| s.number) {
            self.step = step.copied();
            self.rest = self.last - self.spring(hand);
            self.share = 0.0;
        }
        self.share = (self.share + dt / self.options.period).min(1.0);
        let wanted = self.spring(hand) + (1.0 - self.share) * self.rest;
        let wanted = wanted.clamp_length_max(self.options.most);
        let change = (wanted - self.last).clamp_length_max(self.options.slew * dt);
        self.last += change;
        self.last
    }

    /// What the step at hand says.
    fn spring(&self, hand: DVec3) -> DVec3 {
        let Some(step) = &self.step else {
            return DVec3::ZERO;
        };
        let options = &self.options;
        let way = hand - step.reference;
        let length = way.length();
        // Newtons per millimetre.
        let rigid = (options.scale * step.rigidity).clamp(0.0, 1e-3 * options.stiffness);
        let since = length - step.cursor.distance(step.reference);
        let wanted = options.scale * step.force.max(0.0) + rigid * since;
        // Near the reference point the line has no direction: no more than the stiffest spring from there.
        let most = options.most.min(1e-3 * options.stiffness * length);
        -wanted.clamp(0.0, most) * way.normalize_or_zero()
    }

    /// Forgets the stroke: the force is 0 at once, for what stops it. A stroke that ends goes to 0 by itself.
    pub fn reset(&mut self) {
        *self = Self::new(self.options);
    }
}

#[cfg(test)]
mod tests {
    use bspline::HierarchicalSpline;
    use bspline::hierarchical::Lattice;
    use glam::DAffine3;

    use super::*;
    use crate::curve::Along;
    use crate::force::{ForceStroke, ForceTool, Holding, Pull};
    use crate::number::{Point, Positive};
    use crate::paint::Layers;

    const RADIUS: f64 = 2.0;
    const TICK: f64 = 1e-3;

    fn stroke(from: DVec3) -> ForceStroke<f32> {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(DVec3::splat(-20.0)),
            cells: [40; 3],
        };
        let ball: HierarchicalSpline<f32> =
            HierarchicalSpline::schoenberg(lattice, 1.0, |p| 8.0 - p.length()).unwrap();
        let tool = Pull {
            along: Along::Points(vec![Point(from)]),
            area: None,
            disc: None,
            by: None,
            way: None,
            lift: None,
            radius: Positive(RADIUS),
            how: Default::default(),
        };
        let layers = Layers::new();
        let holding = Holding::default();
        ForceTool::Pull(&tool)
            .hold(&ball, 0.0, &layers, &holding, from)
            .unwrap()
    }

    /// What a hand felt.
    struct Felt {
        jump: f64,
        most: f64,
        /// Least energy that the hand had given by then, J: below 0 it has got some.
        least: f64,
        given: f64,
    }

    /// A drag of clay by three radii and back by half of one, with 30 steps of the simulation a second that come a period late.
    fn drag(options: impl Fn(f64) -> StrokeForceOptions) -> Felt {
        let from = DVec3::new(0.0, 0.0, 8.0);
        let mut stroke = stroke(from);
        let every = 33;
        let path = |t: f64| match t {
            t if t < 0.5 => 3.0 * RADIUS * (t / 0.5),
            t if t < 0.7 => 3.0 * RADIUS,
            t if t < 0.9 => 3.0 * RADIUS - 0.5 * RADIUS * (t - 0.7) / 0.2,
            _ => 2.5 * RADIUS,
        };
        let hand = |n: u64| from + path(n as f64 * TICK) * DVec3::new(0.6, 0.0, 0.8);
        let (mut told, mut coming): (Option<StrokeStep>, Option<StrokeStep>) = (None, None);
        let mut felt: Option<StrokeForce> = None;
        let mut out = Felt {
            jump: 0.0,
            most: 0.0,
            least: 0.0,
            given: 0.0,
        };
        let mut last = DVec3::ZERO;
        for n in 0..1200 {
            if n % every == 0 {
                told = coming;
                stroke.pose(hand(n) - from).unwrap();
                stroke.step().unwrap();
                let [own, plain] = stroke.rigidity();
                felt.get_or_insert_with(|| StrokeForce::new(options(newtons_per_unit(1.5, plain, RADIUS))));
                coming = Some(StrokeStep {
                    number: n,
                    reference: from,
                    cursor: hand(n),
                    force: stroke.force().length(),
                    rigidity: own,
                });
            }
            let felt = felt.as_mut().unwrap();
            let force = felt.tick(told.as_ref(), hand(n), TICK);
            let way = 1e-3 * (hand(n + 1) - hand(n));
            out.given -= force.dot(way);
            out.least = out.least.min(out.given);
            out.jump = out.jump.max((force - last).length());
            out.most = out.most.max(force.length());
            last = force;
        }
        out
    }

    /// A drag of three radii with the simulation at 30 Hz: no step above a quarter of a newton in a tick, and the hand gets nothing that it has not
    /// given.
    #[test]
    fn a_drag_is_felt_without_steps_and_gives_no_energy() {
        let felt = drag(StrokeForceOptions::of_scale);
        println!(
            "step {} N, most {} N, given {} J, least {} J",
            felt.jump, felt.most, felt.given, felt.least
        );
        assert!(felt.jump <= 0.25, "{} N", felt.jump);
        assert!(felt.most > 0.5 && felt.most <= 3.0, "{} N", felt.most);
        assert!(
            felt.least >= -1e-4 && felt.given > 1e-3,
            "{} J, {} J",
            felt.least,
            felt.given
        );
        // What comes at once is felt as steps: the test can fail.
        let rough = drag(|scale| StrokeForceOptions {
            slew: 1e9,
            period: 1e-6,
            most: 100.0,
            stiffness: 1e9,
            ..StrokeForceOptions::of_scale(scale)
        });
        println!("at once: step {} N, most {} N", rough.jump, rough.most);
        assert!(rough.jump > 0.25, "{} N", rough.jump);
    }

    /// Between steps it is a spring; when the stroke ends the force goes to 0 within its period and the slew.
    #[test]
    fn between_steps_it_is_a_spring() {
        let options = StrokeForceOptions {
            scale: 0.1,
            ..StrokeForceOptions::of_scale(0.1)
        };
        let mut felt = StrokeForce::new(options);
        let step = StrokeStep {
            number: 1,
            reference: DVec3::ZERO,
            cursor: DVec3::X * 5.0,
            force: 10.0,
            rigidity: 2.0,
        };
        let mut force = DVec3::ZERO;
        for _ in 0..100 {
            force = felt.tick(Some(&step), DVec3::X * 5.0, TICK);
        }
        assert!((force - DVec3::new(-1.0, 0.0, 0.0)).length() < 1e-12, "{force}");
        let ahead = felt.tick(Some(&step), DVec3::X * 5.2, TICK);
        assert!((ahead.x + 1.04).abs() < 1e-12, "{ahead}");
        let ended = (0..40)
            .map(|_| felt.tick(None, DVec3::X * 5.2, TICK))
            .last()
            .unwrap();
        assert_eq!(ended, DVec3::ZERO);
    }
}
