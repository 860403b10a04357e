//! One step of a stroke: what each path asks for, and the forces that give it.

use bspline::Real;
use dynamics::integrators::Integrator;
use dynamics::matter::Quantity;
use dynamics::region::Region;
use dynamics::response::{Against, Response};
use glam::DVec3;

use super::quadrature::Tolerance;
use super::report::{Arrival, Told};
use super::rough::{Rough, Seen};
use super::row::{Functions, Row};
use super::spread::{Load, Part, Spread};
use super::stroke::{ADVANCE, Acting, ForceStroke};
use super::target::Span;
use super::{ForceError, Rule, Solid, ground, system};

/// Share of what is missing by which rest lengths follow in a step of clay, as an exponent: `λΔt`.
const FLOW: f64 = 0.1;
/// Steps, in `1/λ`, of elastic solids.
const LONG: f64 = 10.0;
/// Softness of paths that have to arrive, over their own stiffness: of clay, and of elastic or painted matter.
const SOFT: [f64; 2] = [0.01, 0.003];
/// Share of its length that a path of clay may be off its goal for the solve of a step.
const CLOSE: f64 = 0.002;
/// Factor by which the matter under a path may become other before its softness does.
const OTHER: f64 = 1.5;
/// Density by which gaps close, over its fall in a radius.
const CLOSED: f64 = 0.1;
/// Of the integrals: over the value, and of the mean over the fall of the density in a radius.
const EXACT: Tolerance = Tolerance {
    relative: 1e-4,
    mean: 1e-5,
};

/// What a path asks of a step.
struct Bearing {
    spread: Spread,
    row: Row,
    /// Mean that it is short of.
    short: f64,
    span: Span,
    /// Whether it only keeps what it has: its goal lies in what was there before.
    rests: bool,
}

impl<T: Real> ForceStroke<T> {
    /// One step.
    ///
    /// # Errors
    /// [`ForceError`]; the stroke cannot go on then.
    pub fn step(&mut self) -> Result<Told, ForceError> {
        self.chase()?;
        self.advance()?;
        if let Some(constraints) = self.drawn.next(&self.field, &self.region) {
            self.region.patch_mut().set_constraints(&constraints)?;
        }
        let goals = self.goals();
        let bearings = self.bearings(&goals)?;
        let (dt, keep) = match self.how.solid() {
            Solid::Clay => (self.dt(), libm::exp(-FLOW)),
            Solid::Elastic => (self.dt(), 1.0),
        };
        for (acting, bearing) in self.acting.iter_mut().zip(&bearings) {
            acting.force = if bearing.is_some() {
                keep * acting.force
            } else {
                0.0
            };
        }
        let mut solves = 1;
        if self.scales || self.are_elsewhere(&bearings) {
            self.scale(&bearings, dt)?;
            solves += 1;
        }
        let soft = self.softness(&bearings)?;
        let forces = self.acting.iter().map(|a| a.force);
        let load = Load::<T>::of(pairs(&bearings, forces));
        let before = self.region.patch().state().p.clone();
        let patch = self.region.patch_mut();
        patch.set_force_on(load.on_box())?;
        patch.step(Integrator::Paper, dt)?;
        let moved: Vec<T> = patch
            .state()
            .p
            .iter()
            .zip(&before)
            .map(|(now, then)| *now - *then)
            .collect();
        // Where nothing gives way no force is large enough.
        let is_live =
            |i: &usize| bearings[*i].as_ref().is_some_and(|b| !b.rests) && self.acting[*i].stiffness > 0.0;
        let live: Vec<usize> = (0..bearings.len()).filter(is_live).collect();
        let bearing = |i: usize| bearings[i].as_ref().expect("live paths have one");
        let share = self.kept_soft();
        let right = live.iter().map(|&i| {
            let short = bearing(i).short - bearing(i).row.times(&moved);
            short - share * soft[i] * self.acting[i].force
        });
        let right: Vec<f64> = right.collect();
        let soft: Vec<f64> = live.iter().map(|&i| soft[i]).collect();
        let enough: Vec<f64> = live.iter().map(|&i| self.enough(&self.acting[i])).collect();
        self.memory
            .turn_to(live.iter().map(|&i| self.acting[i].index).collect());
        let rough = self.memory.rough.take();
        let rough = rough.unwrap_or_else(|| self.rough(&live, &bearings, &soft));
        let most = self.extent.solves();
        let (region, solid) = (&mut self.region, self.how.solid());
        let solved = system::solve(&right, &soft, &rough, most, &enough, &mut self.memory, |z| {
            let of = live.iter().zip(z).map(|(&i, z)| (&bearing(i).spread, *z));
            let load = Load::<T>::of(of);
            let found = answer(region, solid, dt, &load)?;
            let felt = live.iter().map(|&i| bearing(i).row.times(&found.p)).collect();
            Ok::<_, ForceError>((found, felt))
        })?;
        if self.how.rule == Rule::Arrive {
            self.memory.rough = Some(rough);
        }
        solves += solved.parts.len();
        for (&i, force) in live.iter().zip(&solved.forces) {
            self.acting[i].force += force;
        }
        self.load = Load::of(pairs(&bearings, self.acting.iter().map(|a| a.force)));
        let patch = self.region.patch_mut();
        patch.add_responses(&solved.parts, dt)?;
        if self.how.solid() == Solid::Clay {
            let d = patch.state().d.clone();
            patch.springs_mut().relax(&d, -libm::expm1(-FLOW));
        }
        Ok(self.told(solves, solved.residual))
    }

    fn dt(&self) -> f64 {
        match self.how.solid() {
            Solid::Clay => FLOW,
            Solid::Elastic => LONG,
        }
    }

    /// Share of the forces at hand for which paths stay soft.
    fn kept_soft(&self) -> f64 {
        match (self.how.rule, self.how.solid()) {
            (Rule::Arrive, Solid::Clay) if self.settled > 0 => self.extent.kept_soft(),
            _ => 1.0,
        }
    }

    /// Arc lengths to which the surface is to go in this step.
    fn goals(&mut self) -> Vec<f64> {
        let share = self.share();
        let mut steps = self.longest / (ADVANCE * self.radius);
        let mut all = true;
        if let Some(hand) = &self.hand
            && let Some(is_there) = hand.drags()
        {
            // Its paths themselves grow no faster.
            (steps, all) = (0.0, is_there);
        }
        let goals = self.acting.iter_mut().map(|a| {
            a.age += 1;
            let part = (a.age as f64 / steps).min(1.0);
            all &= part == 1.0;
            part * share * self.targets[a.index].path.length()
        });
        let goals = goals.collect();
        self.settled += usize::from(all && self.drawn.is_done());
        goals
    }

    /// What each path that acts asks of this step; `None` of those that have nothing to do.
    fn bearings(&self, goals: &[f64]) -> Result<Vec<Option<Bearing>>, ForceError> {
        let functions = Functions::of(&self.field, &self.region);
        let p = &self.region.patch().state().p;
        let value = |at: DVec3| functions.value(p, at);
        let step = self.look();
        let exact = Tolerance {
            mean: EXACT.mean * self.radius * self.field.slope(),
            ..EXACT
        };
        let one = |(acting, goal): (&Acting, &f64)| {
            let target = &self.targets[acting.index];
            let Some(crossing) = acting.crossing.filter(|_| acting.is_free) else {
                return Ok(None);
            };
            let own = self.own(target, acting.start, crossing, *goal);
            let Some(span) = target.span(&value, self.iso, own, *goal, step) else {
                return Ok(None);
            };
            // A path without length is the place where it ends.
            let least = 1e-6 * self.radius;
            let span = Span {
                from: span.from.min(span.to - least),
                ..span
            };
            // What closes does so by more than a thread.
            let fall = acting.start.map_or(0.0, |start| start.fall);
            let more = if span.is_gap && !target.ends_early {
                CLOSED * fall * if target.grows { 1.0 } else { -1.0 } * self.radius
            } else {
                0.0
            };
            let integral = target.integral(value, self.iso + more, span, exact);
            let part = Part {
                path: &target.path,
                from: span.from,
                to: span.to,
            };
            let spread =
                Spread::new(&self.region, &part, &self.shape, self.radius).map_err(ForceError::Tool)?;
            if spread.is_empty() {
                return Ok(None);
            }
            Ok(Some(Bearing {
                spread,
                row: Row::mean(&functions, &integral.nodes, |s| target.path.at(s)),
                short: integral.value / (span.to - span.from),
                span,
                rests: own < crossing && own <= *goal,
            }))
        };
        self.acting.iter().zip(goals).map(one).collect()
    }

    /// Density that a path may be short of after the solve of a step.
    fn enough(&self, acting: &Acting) -> f64 {
        match self.how.solid() {
            Solid::Clay => CLOSE * self.whole(&self.targets[acting.index]) * self.field.slope(),
            // They come to rest in balance.
            Solid::Elastic => 0.0,
        }
    }

    /// Whether paths have come to other matter.
    fn are_elsewhere(&self, bearings: &[Option<Bearing>]) -> bool {
        let mut both = self.acting.iter().zip(bearings);
        both.any(|(acting, bearing)| {
            let now = bearing.as_ref().map_or(acting.worth, |b| self.worth(acting, b));
            !(1.0 / OTHER..=OTHER).contains(&(now / acting.worth))
        })
    }

    /// What a path stands for: its weight, and the stiffness of what it moves. Forces in proportion to that move all paths
    /// about as far, on both sides of a border.
    fn worth(&self, acting: &Acting, bearing: &Bearing) -> f64 {
        self.targets[acting.index].weight * bearing.spread.stiffness
    }

    /// How far each path goes by a unit of force on all, by what they stand for.
    fn scale(&mut self, bearings: &[Option<Bearing>], dt: f64) -> Result<(), ForceError> {
        for i in 0..self.acting.len() {
            if let Some(bearing) = &bearings[i] {
                let worth = self.worth(&self.acting[i], bearing);
                let acting = &mut self.acting[i];
                // What has come to softer matter needs less.
                acting.force *= if acting.age > 1 { worth / acting.worth } else { 1.0 };
                acting.worth = worth;
            }
        }
        let load = Load::<T>::of(pairs(bearings, self.acting.iter().map(|a| a.worth)));
        let found = self
            .region
            .respond_as_step(Integrator::Paper, dt, &load.on_box())?;
        let p = found.p;
        let each = |b: &Option<Bearing>| b.as_ref().map_or(0.0, |b| b.row.times(&p));
        let moved: Vec<f64> = bearings.iter().map(each).collect();
        let most = moved.iter().copied().fold(0.0, f64::max);
        self.memory.rough = None;
        for (acting, moved) in self.acting.iter_mut().zip(moved) {
            // Paths that the region hardly moves must not rule the others.
            acting.stiffness = moved.max(1e-3 * most);
        }
        Ok(())
    }

    /// What forces move, roughly.
    fn rough(&self, live: &[usize], bearings: &[Option<Bearing>], soft: &[f64]) -> Rough {
        let seen = |&i: &usize| {
            let (acting, span) = (&self.acting[i], bearings[i].as_ref().map(|b| b.span));
            let target = &self.targets[acting.index];
            Seen {
                at: target.path.at(span.map_or(0.0, |s| 0.5 * (s.from + s.to))),
                weight: target.weight,
                stiffness: if target.weight > 0.0 {
                    acting.worth / target.weight
                } else {
                    1.0
                },
                goes: acting.stiffness,
            }
        };
        let seen: Vec<Seen> = live.iter().map(seen).collect();
        match (self.how.rule, self.how.solid()) {
            (Rule::Arrive, Solid::Clay) => {
                Rough::new(&seen, soft, self.radius, ground::fading(self.radius, self.dt()))
            }
            _ => Rough::diagonal(&seen, soft),
        }
    }

    /// What each path may stay short of, per force.
    fn softness(&mut self, bearings: &[Option<Bearing>]) -> Result<Vec<f64>, ForceError> {
        let weight = |a: &Acting| self.targets[a.index].weight;
        match self.how.rule {
            Rule::Arrive => {
                let is_even = matches!(self.region.patch().matter().stiffness, Quantity::Constant(_));
                let soft = SOFT[usize::from(self.how.solid() == Solid::Elastic || !is_even)];
                Ok(self.acting.iter().map(|a| soft * a.stiffness / a.worth).collect())
            }
            Rule::Raw(alpha) => {
                let of = |b: &Option<Bearing>| b.as_ref().map_or(1.0, |b| b.span.to - b.span.from);
                Ok(bearings.iter().map(|b| 1.0 / (alpha.0 * of(b).powi(2))).collect())
            }
            Rule::Compliance => {
                let load = Load::<T>::of(pairs(bearings, self.acting.iter().map(weight)));
                let against = Against::Reference {
                    stiffness: 1.0,
                    ground: 0.0,
                };
                let mut found = self.region.static_response(against, &[load.on_box()])?;
                let p = found.pop().map(|r| r.p).unwrap_or_default();
                let rows = self.acting.iter().zip(bearings);
                Ok(rows
                    .map(|(a, b)| match b {
                        None => 1.0,
                        Some(b) => b.row.times(&p) / (2.0 * self.gain * weight(a)),
                    })
                    .collect())
            }
        }
    }

    /// What the step did.
    fn told(&mut self, solves: usize, residual: f64) -> Told {
        self.look_up();
        let (mut least, mut most, mut force) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for acting in &self.acting {
            let target = &self.targets[acting.index];
            force += acting.force;
            let share = acting.crossing.map_or(1.0, |s| 1.0 + self.ahead(target, s));
            (least, most) = (least.min(share), most.max(share));
            if !target.ends_early {
                self.report.overshoot = self.report.overshoot.max(share - 1.0);
            }
        }
        let report = &mut self.report;
        report.solves += solves;
        report.force = report.force.max(force.abs());
        if report.steps_to_99.is_none() && least >= 0.99 && most <= 1.01 && self.begun == self.targets.len() {
            report.steps_to_99 = Some(report.steps);
        }
        Told {
            arrival: Arrival { least, most },
            acting: self.acting.len(),
            force: force.abs(),
            solves,
            residual,
        }
    }
}

/// What a load adds to a step. That of clay is as exact as the step; elastic solids have to come to rest in balance.
fn answer<T: Real>(
    region: &mut Region<T>,
    solid: Solid,
    dt: f64,
    load: &Load<T>,
) -> Result<Response<T>, ForceError> {
    let load = load.on_box();
    Ok(match solid {
        Solid::Clay => region.respond_as_step(Integrator::Paper, dt, &load)?,
        Solid::Elastic => region.respond(Integrator::Paper, dt, &[load])?.remove(0),
    })
}

/// Spreads of the paths that ask for something, with a factor each.
fn pairs(
    bearings: &[Option<Bearing>],
    factors: impl Iterator<Item = f64> + Clone,
) -> impl Iterator<Item = (&Spread, f64)> + Clone {
    let both = bearings.iter().zip(factors);
    both.filter_map(|(b, f)| b.as_ref().map(|b| (&b.spread, f)))
}
