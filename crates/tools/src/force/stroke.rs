use bspline::{Field, HierarchicalSpline, Real};
use dynamics::integrators::Integrator;
use dynamics::lattice::OnBox;
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{Cells, Region, RegionOptions};
use dynamics::response::Against;
use glam::DVec3;

use super::filter::Shape;
use super::quadrature::Tolerance;
use super::row::{Functions, Row};
use super::spread::{Load, Part, Spread};
use super::target::{Span, Target};
use super::{ForceError, How, Rule, Solid, system, track};

/// Samples at most this share of a radius apart: coarser ones show in the result.
const SPACINGS_PER_RADIUS: f64 = 1.5;
/// Samples per cell of the regions that are cut.
const SAMPLES_PER_CELL: f64 = 4.0 / 3.0;
/// Radii of a region beside the paths.
const ROOM: f64 = 4.0;
/// Knot intervals that the rim takes from a region.
const RIM: f64 = 0.58;
/// Radii about the paths of a stage in which those of earlier ones go on acting.
const TRAIL: f64 = 5.0;
/// Radii of track that a tool goes on at once. Each time the shape so far becomes the one at rest: what is left behind
/// would else spring back by what its springs have not yet followed.
const STAGE: f64 = 6.0;
/// Radii that the goal of the longest path advances in a step.
const ADVANCE: f64 = 0.3;
/// Share of what is missing by which rest lengths follow in a step of clay, as an exponent: `λΔt`.
const FLOW: f64 = 0.1;
/// Steps, in `1/λ`, of elastic solids.
const LONG: f64 = 10.0;
/// Mass and damping over `K/(λr)²` and `K/(λr²)`.
const MASS: f64 = 0.1;
const DAMPING: f64 = 1.0;
/// Softness of paths that have to arrive, over their own stiffness.
const SOFT: [f64; 2] = [0.01, 0.003];
/// Share of its length that a path that has arrived may be off; after some steps with goals that stand still more is
/// allowed, between neighbours it may not become less.
const ARRIVED: f64 = 0.002;
const ARRIVED_LATE: f64 = 0.01;
const LATE: usize = 8;
/// Share that an elastic path at rest moves in a step.
const AT_REST: f64 = 1e-5;
/// Steps with goals that stand still after which the next stage begins in any case.
const PATIENCE: usize = 60;
/// Of the integrals: over the value, and of the mean over the fall of the density in a radius.
const EXACT: Tolerance = Tolerance {
    relative: 1e-4,
    mean: 1e-5,
};

/// What the paths of a tool are together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// A point or a curve: all paths act at once.
    Curve,
    /// An area, which takes more solves a step.
    Area,
    /// A track that the tool walks along, in order: those of six radii act at a time, with those near them from before.
    Track,
}

impl Extent {
    /// Solves of a step beside the first.
    fn solves(self) -> usize {
        match self {
            Self::Curve | Self::Track => 3,
            Self::Area => 5,
        }
    }
}

/// How far the paths of a stroke have come, as shares of their lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// The one that lags most.
    pub least: f64,
    /// The one that leads.
    pub most: f64,
}

/// What a step of a stroke did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    /// Of the paths that act.
    pub arrival: Arrival,
    /// Paths that act.
    pub acting: usize,
    /// Sum of their forces: what is felt, from the reference point towards the cursor.
    pub force: f64,
    /// Solves that it took.
    pub solves: usize,
    /// What the paths are short of after the solve, over what they were short of before.
    pub residual: f64,
}

/// What a stroke did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceReport {
    /// Paths.
    pub paths: usize,
    /// Steps.
    pub steps: usize,
    /// Solves of all steps.
    pub solves: usize,
    /// Of all paths, at the end.
    pub arrival: Arrival,
    /// The most that any path was ahead of its end, as a share of its length.
    pub overshoot: f64,
    /// Steps until all paths were within a hundredth of their ends, if they came there.
    pub steps_to_99: Option<usize>,
    /// Largest sum of the forces.
    pub force: f64,
    /// Samples of the region.
    pub samples: usize,
    /// Times that the region was cut.
    pub cuts: usize,
}

/// A path that acts.
#[derive(Clone, Debug)]
struct Acting {
    index: usize,
    /// Total force.
    force: f64,
    /// Arc length of the surface on it, where there is one, now and before the step.
    crossing: Option<f64>,
    before: Option<f64>,
    /// Steps that it has acted.
    age: usize,
    /// What moves it by itself, a unit of force on all paths by their weights.
    stiffness: f64,
}

impl Acting {
    fn new(index: usize, age: usize) -> Self {
        Self {
            index,
            age,
            force: 0.0,
            crossing: None,
            before: None,
            stiffness: 0.0,
        }
    }
}

/// What a path asks of a step.
struct Bearing {
    spread: Spread,
    row: Row,
    /// Mean that it is short of.
    short: f64,
    span: Span,
}

/// A force tool at work on a field.
pub struct ForceStroke<T> {
    /// The field when the stroke began.
    origin: HierarchicalSpline<T>,
    /// The field without the changes of the region since it was cut.
    field: HierarchicalSpline<T>,
    region: Region<T>,
    iso: f64,
    radius: f64,
    shape: Shape,
    how: How,
    gain: f64,
    targets: Vec<Target>,
    acting: Vec<Acting>,
    /// Targets that have begun.
    begun: usize,
    extent: Extent,
    /// Where the tool is on its track.
    gone: f64,
    longest: f64,
    /// Steps of the stage with all goals at the ends.
    settled: usize,
    scales: bool,
    /// Forces of the last step.
    load: Load<T>,
    report: ForceReport,
}

impl<T: Real> ForceStroke<T> {
    /// Begins to work on a field whose surface lies at `iso`.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn new(
        field: &HierarchicalSpline<T>,
        iso: f64,
        targets: Vec<Target>,
        extent: Extent,
        radius: f64,
        how: &How,
    ) -> Result<Self, ForceError> {
        if targets.is_empty() {
            return Err(ForceError::tool("the tool has no path"));
        }
        for target in &targets {
            track::within(field, target.path.at(target.path.length()))?;
        }
        let whole = field.lattice().extent() * field.lattice().spacing(0);
        if radius > 0.5 * whole.max_element() {
            return Err(ForceError::tool(format!(
                "a radius of {radius} is wider than the field, {:?}; use a smaller one",
                whole.to_array()
            )));
        }
        let shape = Shape::new(&how.filter).map_err(ForceError::Tool)?;
        let longest = targets.iter().map(|t| t.path.length()).fold(0.0, f64::max);
        let level = level(field, radius)?;
        let matter = matter(field, radius);
        let gain = how.gain.map_or(
            match how.solid {
                Solid::Clay => 15.0,
                Solid::Elastic => 4.0,
            },
            |g| g.0,
        );
        // Elastic springs may not follow at all.
        let extent = match (extent, how.solid) {
            (Extent::Track, Solid::Elastic) => Extent::Curve,
            (extent, _) => extent,
        };
        let gone = if extent == Extent::Track {
            STAGE * radius
        } else {
            f64::INFINITY
        };
        let first: Vec<&Target> = targets.iter().filter(|t| t.begins <= gone).collect();
        let cells = about(field, level, &first, radius)?;
        let region = Region::new(field, cells, matter, &RegionOptions::of(field, level))?;
        let samples = region.patch().lattice().sample_count();
        let none = Arrival {
            least: 0.0,
            most: 0.0,
        };
        Ok(Self {
            origin: field.clone(),
            field: field.clone(),
            region,
            iso,
            radius,
            shape,
            how: how.clone(),
            gain,
            acting: Vec::new(),
            begun: 0,
            extent,
            gone,
            longest,
            settled: 0,
            scales: false,
            load: Load::of(std::iter::empty()),
            report: ForceReport {
                paths: targets.len(),
                steps: 0,
                solves: 0,
                arrival: none,
                overshoot: 0.0,
                steps_to_99: None,
                force: 0.0,
                samples,
                cuts: 1,
            },
            targets,
        })
    }

    /// The region that moves.
    pub fn region(&self) -> &Region<T> {
        &self.region
    }

    /// What it has done so far.
    pub fn report(&self) -> &ForceReport {
        &self.report
    }

    /// The value of the field as it is now.
    pub fn value(&self, p: DVec3) -> f64 {
        Functions::of(&self.field, &self.region).value(&self.region.patch().state().p, p)
    }

    /// Whether it springs back when it is let go.
    pub fn is_elastic(&self) -> bool {
        self.how.solid == Solid::Elastic
    }

    /// Forces on the samples that the last step ended with.
    pub fn load(&self) -> OnBox<'_, T> {
        self.load.on_box()
    }

    /// Share of the work that is done, about.
    pub fn progress(&self) -> f64 {
        let stage = (self.settled as f64 / LATE as f64).min(0.9);
        (self.begun as f64 - (1.0 - stage) * self.acting.len() as f64).max(0.0) / self.targets.len() as f64
    }

    /// Whether all paths have arrived, or have had their time.
    pub fn is_over(&self) -> bool {
        self.begun == self.targets.len() && self.is_stage_over()
    }

    fn is_stage_over(&self) -> bool {
        if self.settled == 0 {
            return self.acting.is_empty() && self.report.steps > 0;
        }
        let is_late = self.settled >= LATE && self.acting.len() > 1;
        let off = if is_late { ARRIVED_LATE } else { ARRIVED };
        let is_there = |a: &Acting| {
            let Some(crossing) = a.crossing else { return true };
            let target = &self.targets[a.index];
            let length = target.path.length();
            let ahead = (crossing - length) / length;
            if target.ends_early && ahead > 0.0 {
                return true;
            }
            match (self.how.solid, a.before) {
                (Solid::Clay, _) => ahead.abs() <= off,
                (Solid::Elastic, Some(before)) => (crossing - before).abs() <= AT_REST * length,
                (Solid::Elastic, None) => false,
            }
        };
        self.settled >= PATIENCE || (self.settled > 1 && self.acting.iter().all(is_there))
    }

    /// Share of its path to which a surface is brought.
    fn share(&self) -> f64 {
        match (self.how.solid, self.how.rule) {
            (Solid::Elastic, Rule::Arrive) => self.gain / (1.0 + self.gain),
            _ => 1.0,
        }
    }

    fn dt(&self) -> f64 {
        match self.how.solid {
            Solid::Clay => FLOW,
            Solid::Elastic => LONG,
        }
    }

    /// Length in which nothing of the surface is missed.
    fn look(&self) -> f64 {
        let spacing = self
            .field
            .lattice()
            .spacing(self.region.cells().level)
            .min_element();
        (0.5 * spacing).min(0.25 * self.radius)
    }

    /// One step.
    ///
    /// # Errors
    /// [`ForceError`]; the stroke cannot go on then.
    pub fn step(&mut self) -> Result<Told, ForceError> {
        self.advance()?;
        let goals = self.goals();
        let bearings = self.bearings(&goals)?;
        let (dt, keep) = match self.how.solid {
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
        if self.scales {
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
        let live: Vec<usize> = (0..bearings.len()).filter(|i| bearings[*i].is_some()).collect();
        let bearing = |i: usize| bearings[i].as_ref().expect("live paths have one");
        let right: Vec<f64> = live
            .iter()
            .map(|&i| bearing(i).short - bearing(i).row.times(&moved) - soft[i] * self.acting[i].force)
            .collect();
        let soft: Vec<f64> = live.iter().map(|&i| soft[i]).collect();
        let diagonal: Vec<f64> = live
            .iter()
            .zip(&soft)
            .map(|(&i, soft)| self.acting[i].stiffness / self.targets[self.acting[i].index].weight + soft)
            .collect();
        let most = self.extent.solves();
        let region = &mut self.region;
        let solved = system::solve(&right, &soft, &diagonal, most, 1e-4, |z| {
            let of = live.iter().zip(z).map(|(&i, z)| (&bearing(i).spread, *z));
            let load = Load::<T>::of(of);
            let mut found = region.respond(Integrator::Paper, dt, &[load.on_box()])?;
            let p = found.pop().map(|r| r.p).unwrap_or_default();
            let felt = live.iter().map(|&i| bearing(i).row.times(&p)).collect();
            Ok::<_, ForceError>((p, felt))
        })?;
        solves += solved.parts.len();
        for (&i, force) in live.iter().zip(&solved.forces) {
            self.acting[i].force += force;
        }
        self.load = Load::of(pairs(&bearings, self.acting.iter().map(|a| a.force)));
        self.move_on(&solved.parts, dt)?;
        if self.how.solid == Solid::Clay {
            let patch = self.region.patch_mut();
            let d = patch.state().d.clone();
            patch.springs_mut().relax(&d, -libm::expm1(-FLOW));
        }
        Ok(self.told(solves, solved.residual))
    }

    /// Adds what the solved forces do in a step of `dt`.
    fn move_on(&mut self, parts: &[(f64, Vec<T>)], dt: f64) -> Result<(), ForceError> {
        let patch = self.region.patch_mut();
        let state = patch.state();
        let mut change = vec![0.0; state.p.len()];
        for (share, p) in parts {
            change
                .iter_mut()
                .zip(p)
                .for_each(|(c, p)| *c += share * p.as_f64());
        }
        let add = |to: &[T], factor: f64| -> Vec<T> {
            let sums = to.iter().zip(&change);
            sums.map(|(a, c)| T::from_f64(a.as_f64() + factor * c)).collect()
        };
        let (p, v) = (add(&state.p, 1.0), add(&state.v, 1.0 / dt));
        patch.set_state(&p, &v)?;
        Ok(())
    }

    /// Lets go: what is left of the field.
    ///
    /// # Errors
    /// [`ForceError::Region`].
    pub fn release(mut self) -> Result<(HierarchicalSpline<T>, ForceReport), ForceError> {
        let field = match self.how.solid {
            Solid::Clay => self.region.release_clay(&self.field)?,
            Solid::Elastic => self.field.clone(),
        };
        self.report.arrival = self.arrival(|t| {
            let value = |p| match self.how.solid {
                Solid::Clay => field.value(p),
                Solid::Elastic => self.value(p),
            };
            t.crossing(&value, self.iso, self.radius, self.look())
        });
        let field = match self.how.solid {
            Solid::Clay => field,
            Solid::Elastic => self.origin,
        };
        Ok((field, self.report))
    }

    /// Of all paths, by where the surface is on each; those without one have arrived.
    fn arrival(&self, crossing: impl Fn(&Target) -> Option<f64>) -> Arrival {
        let share = |t: &Target| crossing(t).map_or(1.0, |s| s / t.path.length());
        let none = Arrival {
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        };
        self.targets.iter().map(share).fold(none, |all, s| Arrival {
            least: all.least.min(s),
            most: all.most.max(s),
        })
    }

    /// Lets the tool go on along its track where it is done so far: its shape becomes the one at rest, the oldest paths end
    /// and the next begin.
    fn advance(&mut self) -> Result<(), ForceError> {
        if self.report.steps > 0 && self.begun < self.targets.len() && self.is_stage_over() {
            self.field = self.region.release_clay(&self.field)?;
            self.gone += STAGE * self.radius;
            let targets = &self.targets;
            let next = targets[self.begun..].partition_point(|t| t.begins <= self.gone);
            let next = &targets[self.begun..][..next];
            let far = (TRAIL * self.radius).powi(2);
            let is_near = |t: &Target| {
                next.iter()
                    .any(|n| n.path.at(0.0).distance_squared(t.path.at(0.0)) <= far)
            };
            let kept = (0..self.begun).filter(|i| is_near(&targets[*i]));
            // What they had to hold is at rest now.
            self.acting = kept.map(|i| Acting::new(i, usize::MAX / 2)).collect();
            let paths: Vec<&Target> = self
                .acting
                .iter()
                .map(|a| &targets[a.index])
                .chain(next)
                .collect();
            let cells = about(&self.field, self.region.cells().level, &paths, self.radius)?;
            let options = RegionOptions::of(&self.field, cells.level);
            self.region = Region::new(&self.field, cells, matter(&self.field, self.radius), &options)?;
            self.settled = 0;
            self.report.cuts += 1;
            self.report.samples = self
                .report
                .samples
                .max(self.region.patch().lattice().sample_count());
        }
        self.report.steps += 1;
        self.scales = false;
        while self
            .targets
            .get(self.begun)
            .is_some_and(|t| t.begins <= self.gone)
        {
            self.acting.push(Acting::new(self.begun, 0));
            self.begun += 1;
            self.scales = true;
        }
        if self.scales {
            self.look_up();
        }
        Ok(())
    }

    /// Arc lengths to which the surface is to go in this step.
    fn goals(&mut self) -> Vec<f64> {
        let share = self.share();
        let (mut all, steps) = (true, self.longest / (ADVANCE * self.radius));
        let goals = self.acting.iter_mut().map(|a| {
            a.age += 1;
            let part = (a.age as f64 / steps).min(1.0);
            all &= part == 1.0;
            part * share * self.targets[a.index].path.length()
        });
        let goals = goals.collect();
        self.settled += usize::from(all);
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
            let Some(span) = acting
                .crossing
                .and_then(|at| target.span(&value, self.iso, at, *goal, step))
            else {
                return Ok(None);
            };
            // A path without length is the place where it ends.
            let least = 1e-6 * self.radius;
            let span = Span {
                from: span.from.min(span.to - least),
                ..span
            };
            let integral = target.integral(value, self.iso, span, exact);
            let part = Part {
                path: &target.path,
                from: span.from,
                to: span.to,
            };
            let spread =
                Spread::new(&self.region, &part, &self.shape, self.radius).map_err(ForceError::Tool)?;
            if spread.shares.is_empty() {
                return Ok(None);
            }
            Ok(Some(Bearing {
                spread,
                row: Row::mean(&functions, &integral.nodes, |s| target.path.at(s)),
                short: integral.value / (span.to - span.from),
                span,
            }))
        };
        self.acting.iter().zip(goals).map(one).collect()
    }

    /// How far each path goes by a unit of force on all, by their weights.
    fn scale(&mut self, bearings: &[Option<Bearing>], dt: f64) -> Result<(), ForceError> {
        let targets = &self.targets;
        let weights = self.acting.iter().map(|a| targets[a.index].weight);
        let load = Load::<T>::of(pairs(bearings, weights));
        let mut found = self.region.respond(Integrator::Paper, dt, &[load.on_box()])?;
        let p = found.pop().map(|r| r.p).unwrap_or_default();
        let each = |b: &Option<Bearing>| b.as_ref().map_or(0.0, |b| b.row.times(&p));
        let moved: Vec<f64> = bearings.iter().map(each).collect();
        let most = moved.iter().copied().fold(0.0, f64::max);
        for (acting, moved) in self.acting.iter_mut().zip(moved) {
            // Paths that the region hardly moves must not rule the others.
            acting.stiffness = moved.max(1e-3 * most).max(f64::MIN_POSITIVE);
        }
        Ok(())
    }

    /// What each path may stay short of, per force.
    fn softness(&mut self, bearings: &[Option<Bearing>]) -> Result<Vec<f64>, ForceError> {
        let weight = |a: &Acting| self.targets[a.index].weight;
        match self.how.rule {
            Rule::Arrive => {
                let soft = SOFT[usize::from(self.how.solid == Solid::Elastic)];
                Ok(self
                    .acting
                    .iter()
                    .map(|a| soft * a.stiffness / weight(a))
                    .collect())
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

    /// Looks where the surface is now.
    fn look_up(&mut self) {
        let functions = Functions::of(&self.field, &self.region);
        let p = &self.region.patch().state().p;
        let value = |at: DVec3| functions.value(p, at);
        let step = self.look();
        for acting in &mut self.acting {
            let target = &self.targets[acting.index];
            acting.before = acting.crossing;
            acting.crossing = target.crossing(&value, self.iso, self.radius, step);
        }
    }

    /// What the step did.
    fn told(&mut self, solves: usize, residual: f64) -> Told {
        self.look_up();
        let (mut least, mut most, mut force) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for acting in &self.acting {
            let target = &self.targets[acting.index];
            force += acting.force;
            let share = acting.crossing.map_or(1.0, |s| s / target.path.length());
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

/// Spreads of the paths that ask for something, with a factor each.
fn pairs(
    bearings: &[Option<Bearing>],
    factors: impl Iterator<Item = f64> + Clone,
) -> impl Iterator<Item = (&Spread, f64)> + Clone {
    let both = bearings.iter().zip(factors);
    both.filter_map(|(b, f)| b.as_ref().map(|b| (&b.spread, f)))
}

/// The coarsest level whose samples are fine enough for a tool.
fn level<T: Real>(field: &HierarchicalSpline<T>, radius: f64) -> Result<usize, ForceError> {
    let spacing = field.lattice().spacing(0).max_element() / SAMPLES_PER_CELL;
    let level = (SPACINGS_PER_RADIUS * spacing / radius).log2().ceil().max(0.0);
    match level <= 16.0 {
        true => Ok(level as usize),
        false => Err(ForceError::tool(format!(
            "a radius of {radius} is too small for this field, whose coarsest knot intervals are {}; use a larger one",
            field.lattice().spacing(0).max_element()
        ))),
    }
}

/// Matter of stiffness 1 that moves as wide as the tool is.
fn matter<T: Real>(field: &HierarchicalSpline<T>, radius: f64) -> Matter {
    let stiffness = field.slope().powi(-2);
    Matter {
        mass: Quantity::Constant(MASS * stiffness / (radius * radius)),
        damping: Quantity::Constant(DAMPING * stiffness / (radius * radius)),
        ..Matter::default()
    }
}

/// Corners of the box about paths, in lattice coordinates.
fn bounds<T: Real>(field: &HierarchicalSpline<T>, targets: &[&Target]) -> [DVec3; 2] {
    let places = targets.iter().flat_map(|t| t.path.points());
    let local = places.map(|p| field.lattice_from_world().transform_point3(*p));
    local.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
        [low.min(p), high.max(p)]
    })
}

/// Cells about paths, with room on all sides.
fn about<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    targets: &[&Target],
    radius: f64,
) -> Result<Cells, ForceError> {
    let [low, high] = bounds(field, targets);
    let spacing = field.lattice().spacing(0);
    let room = ROOM * radius + RIM * field.lattice().spacing(level).max_element();
    let middle = field
        .lattice()
        .world_from_lattice
        .transform_point3(0.5 * (low + high));
    let half = 0.5 * (high - low) * spacing + room;
    Ok(Cells::around(field, level, middle, half)?.widened(field)?)
}
