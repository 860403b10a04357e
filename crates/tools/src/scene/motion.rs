//! The scene in motion.

use bspline::{HierarchicalSpline, Real};
use dynamics::integrators::{AdaptiveOptions, Integrator, StepReport};
use dynamics::region::Region;
use serde::Serialize;

use super::error::{SimulateError, wrong};
use super::holds::Holds;
use super::load::Load;
use super::matter::{self, Clay};
use super::place::{self, Samples};
use super::script::{ReleaseKind, Scene, Scheme};
use crate::paint::Layers;

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepLine {
    /// Number, from 1.
    pub step: usize,
    /// Time at its end, in seconds.
    pub time: f64,
    /// Its length.
    pub dt: f64,
    /// Iterations of the solve that took most.
    pub iterations: usize,
    /// Largest residual that a solve left, relative to its impulse.
    pub residual: f64,
    /// How it was solved; empty asleep.
    pub method: &'static str,
    /// The scheme taken; empty asleep.
    pub integrator: &'static str,
    /// Equal parts that the step was made of.
    pub substeps: usize,
    /// Springs whose negative tangent was taken as 0.
    pub clamped: usize,
    /// Kinetic energy at the end.
    pub kinetic: f64,
    /// Energy of all springs, those of constraints and ground included.
    pub potential: f64,
    /// Work of the forces since the start.
    pub work: f64,
    /// Whether the region was awake.
    pub awake: bool,
    /// Samples that were moved.
    pub awake_samples: usize,
    /// Largest change of a sample's density since the start.
    pub max_change: f64,
    /// Estimated error of the densities, root mean square; of TR-BDF2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Steps taken back before this one; of adaptive ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rejected: Option<usize>,
}

/// A scene on its field.
pub struct Simulation<T> {
    scene: Scene,
    /// The field without the changes of the region since it was cut out or let go.
    field: HierarchicalSpline<T>,
    region: Region<T>,
    samples: Samples,
    clay: Clay,
    load: Load,
    holds: Holds,
    /// Which paint is laid on.
    painted: Vec<bool>,
    released: Option<ReleaseKind>,
    force: Vec<T>,
    steps: usize,
    time: f64,
    /// What an adaptive step tries next.
    next_dt: f64,
    work: f64,
    notes: Vec<String>,
}

/// Longest adaptive step over the first, and first over shortest, unless the scene says otherwise.
const LONGER: f64 = 16.0;
const SHORTER: f64 = 1000.0;
/// Error of an adaptive step, in cells, unless the scene says otherwise.
const TOLERANCE: f64 = 1e-3;
/// Share of a step by which its ends may be off.
const ROUNDING: f64 = 1e-9;
/// Share of the energy that an adaptive step may create.
const ENERGY_GAIN: f64 = 0.01;

impl<T: Real> Simulation<T> {
    /// The scene at its start. `iso` is the density of the field's surface; `layers` are what is painted on the field.
    ///
    /// # Errors
    /// [`SimulateError::Scene`].
    pub fn new(
        scene: &Scene,
        field: HierarchicalSpline<T>,
        iso: Option<f64>,
        layers: &Layers,
    ) -> Result<Self, SimulateError> {
        check_times(scene)?;
        let mut notes = Vec::new();
        let mut region = place::cut(scene, &field, &mut notes)?;
        let samples = Samples::of(&region);
        let mut clay = Clay::new(&scene.material, &samples)?;
        clay.scale_by(layers, &samples);
        clay.give(&mut region)?;
        let plasticity = matter::plasticity(scene, &samples)?;
        let set = region.patch_mut().set_plasticity(plasticity);
        set.map_err(|e| wrong("[plasticity]", e))?;
        region.set_parts_sleep(scene.sleep.parts);
        for (i, p) in scene.paint.iter().enumerate() {
            p.check().map_err(|e| wrong(format!("[[paint]] {}", i + 1), e))?;
        }
        let cell = field.lattice().spacing(region.cells().level).min_element();
        let iso = scene.iso.map(|i| i.0).or(iso);
        let mut out = Self {
            load: Load::new(scene, &samples)?,
            holds: Holds::new(scene, &field, iso, &samples, cell)?,
            painted: vec![false; scene.paint.len()],
            released: None,
            force: vec![T::zero(); samples.positions.len()],
            steps: 0,
            time: 0.0,
            next_dt: scene.time.step.0,
            work: 0.0,
            scene: scene.clone(),
            field,
            region,
            samples,
            clay,
            notes,
        };
        // What holds or is painted from the start is refused before anything moves.
        out.act(scene.time.step.0)?;
        Ok(out)
    }

    /// Whether the scene is over.
    pub fn is_over(&self) -> bool {
        self.time >= self.scene.time.duration.0
    }

    /// Share of the time that has passed.
    pub fn progress(&self) -> f64 {
        self.time / self.scene.time.duration.0
    }

    /// What has to be told of the scene.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The region.
    pub fn region(&self) -> &Region<T> {
        &self.region
    }

    /// One step.
    ///
    /// # Errors
    /// [`SimulateError`]; the scene cannot go on then.
    pub fn step(&mut self) -> Result<StepLine, SimulateError> {
        let dt = self.length();
        self.act(dt)?;
        let awake_samples = self.region.awake_samples();
        let (dt, report, rejected) = self.advance(dt)?;
        self.steps += 1;
        let (step, end) = (self.scene.time.step.0, self.scene.time.duration.0);
        self.time = match self.scene.time.integrator {
            Scheme::Adaptive => self.time + dt,
            _ => self.steps as f64 * step,
        };
        // Rounding must not add a step.
        if self.time > end - ROUNDING * step {
            self.time = end;
        }
        self.let_go()?;
        self.work += report.map_or(0.0, |r| r.work);
        let energy = self.region.energy();
        let now = &self.region.patch().state().d;
        let changes = now.iter().zip(&self.samples.densities);
        Ok(StepLine {
            step: self.steps,
            time: self.time,
            dt,
            iterations: report.map_or(0, |r| r.solve.iteration.iterations),
            residual: report.map_or(0.0, |r| r.solve.iteration.residual),
            method: report.map_or("", |r| r.solve.method.name()),
            integrator: report.map_or("", |r| r.integrator.name()),
            substeps: report.map_or(0, |r| r.substeps),
            clamped: report.map_or(0, |r| r.clamped),
            kinetic: energy.kinetic,
            potential: energy.springs + energy.ground + energy.constraints,
            work: self.work,
            awake: report.is_some(),
            awake_samples: if report.is_some() { awake_samples } else { 0 },
            max_change: changes.map(|(d, b)| (d.as_f64() - b).abs()).fold(0.0, f64::max),
            error: report.and_then(|r| r.error),
            rejected,
        })
    }

    /// The field with all changes so far.
    ///
    /// # Errors
    /// [`SimulateError::Bake`].
    pub fn baked(&self) -> Result<HierarchicalSpline<T>, SimulateError> {
        self.region
            .bake(&self.field)
            .map_err(|source| SimulateError::Bake {
                time: self.time,
                source,
            })
    }

    /// What the next step may last: to the end, and if it can be chosen, to the next moment at which something changes.
    fn length(&self) -> f64 {
        let left = self.scene.time.duration.0 - self.time;
        let step = self.scene.time.step.0;
        if self.scene.time.integrator != Scheme::Adaptive {
            // A step that differs by rounding would cost a new factor.
            return if left > (1.0 - ROUNDING) * step {
                step
            } else {
                left
            };
        }
        let scene = &self.scene;
        let whens = scene.pull.iter().map(|p| &p.when);
        let whens = whens
            .chain(scene.force.iter().map(|f| &f.when))
            .chain(scene.constraint.iter().map(|c| &c.when));
        let switches = whens.map(|w| w.next_change(self.time));
        let paint = scene.paint.iter().filter_map(|p| p.at.map(|a| a.0));
        let release = scene.release.and_then(|r| r.at.map(|a| a.0));
        let moments = paint.chain(release).filter(|t| *t > self.time);
        let next = switches.chain(moments).fold(f64::INFINITY, f64::min);
        self.next_dt.min(left).min(next - self.time)
    }

    /// Paint, constraints and forces of the step that begins now.
    fn act(&mut self, dt: f64) -> Result<(), SimulateError> {
        // Clay that was let go stays, to the bit.
        if self.released == Some(ReleaseKind::Clay) {
            return Ok(());
        }
        let mut fresh = false;
        for (paint, done) in self.scene.paint.iter().zip(&mut self.painted) {
            if !*done && paint.at.map_or(0.0, |a| a.0) < self.time + 0.5 * dt {
                self.clay.paint(paint, &self.samples);
                (*done, fresh) = (true, true);
            }
        }
        if fresh {
            self.clay.give(&mut self.region)?;
        }
        if let Some(list) = self.holds.changed(self.time, dt) {
            let set = self.region.patch_mut().set_constraints(&list);
            set.map_err(|e| wrong(format!("[[constraint]] at {} s", self.time), e))?;
        }
        self.load.write(self.time, dt, &self.samples, &mut self.force);
        if self.released.is_some() {
            return Ok(());
        }
        self.region
            .set_force(&self.force)
            .map_err(|source| SimulateError::Step {
                time: self.time,
                source,
            })
    }

    fn advance(&mut self, dt: f64) -> Result<(f64, Option<StepReport>, Option<usize>), SimulateError> {
        let time = self.time;
        let failed = |source| SimulateError::Step { time, source };
        let integrator = match self.scene.time.integrator {
            Scheme::Paper => Integrator::Paper,
            Scheme::Symplectic => Integrator::Symplectic,
            Scheme::Verlet => Integrator::Verlet,
            Scheme::TrBdf2 => Integrator::TrBdf2,
            Scheme::Auto => Integrator::Auto,
            Scheme::Adaptive => {
                let options = self.adaptive();
                let done = self.region.adaptive_step(dt, &options).map_err(failed)?;
                let Some(done) = done else {
                    return Ok((dt, None, Some(0)));
                };
                // A step cut short by an event says nothing against the length that was meant.
                if done.rejected > 0 || done.next_dt > self.next_dt || dt == self.next_dt {
                    self.next_dt = done.next_dt;
                }
                return Ok((done.step.dt, Some(done.step), Some(done.rejected)));
            }
        };
        let report = self.region.step(integrator, dt).map_err(failed)?;
        Ok((dt, report, None))
    }

    fn adaptive(&self) -> AdaptiveOptions {
        let time = &self.scene.time;
        let cell = self
            .field
            .lattice()
            .spacing(self.region.cells().level)
            .min_element();
        let longest = time.longest.map_or(time.step.0 * LONGER, |l| l.0);
        let shortest = time.shortest.map_or(time.step.0 / SHORTER, |s| s.0);
        AdaptiveOptions {
            tolerance: time.tolerance.map_or(
                TOLERANCE * cell / self.region.patch().springs().law().scale(),
                |t| t.0,
            ),
            // What the scene does not say follows what it says.
            shortest: shortest.min(longest),
            longest,
            energy_gain: ENERGY_GAIN,
            acceleration: time.acceleration.map(|a| a.0),
        }
    }

    fn let_go(&mut self) -> Result<(), SimulateError> {
        let Some(release) = self.scene.release.filter(|_| self.released.is_none()) else {
            return Ok(());
        };
        if self.time < release.at.map_or(self.scene.time.duration.0, |a| a.0) {
            return Ok(());
        }
        self.released = Some(release.kind);
        match release.kind {
            ReleaseKind::Clay => {
                self.field = self
                    .region
                    .release_clay(&self.field)
                    .map_err(|source| SimulateError::Bake {
                        time: self.time,
                        source,
                    })?;
            }
            ReleaseKind::Elastic => self.region.release_elastic(),
        }
        Ok(())
    }
}

/// Refuses times that contradict each other.
fn check_times(scene: &Scene) -> Result<(), SimulateError> {
    let time = &scene.time;
    let keys = [
        ("tolerance", time.tolerance),
        ("shortest", time.shortest),
        ("longest", time.longest),
        ("acceleration", time.acceleration),
    ];
    if time.integrator != Scheme::Adaptive
        && let Some((key, _)) = keys.iter().find(|(_, v)| v.is_some())
    {
        return Err(wrong(
            format!("[time] {key}"),
            "is for adaptive steps; leave it out, or write integrator = \"adaptive\"",
        ));
    }
    let (duration, step) = (time.duration.0, time.step.0);
    let longest = time.longest.map_or(step * LONGER, |l| l.0);
    if let Some(shortest) = time.shortest.filter(|s| s.0 > longest) {
        return Err(wrong(
            "[time] shortest",
            format!(
                "{} s is longer than the longest step, {longest} s; shorten it, or write a larger longest",
                shortest.0
            ),
        ));
    }
    if step > duration {
        return Err(wrong(
            "[time] step",
            format!("{step} s is longer than the duration, {duration} s"),
        ));
    }
    if duration / step > 1e7 {
        return Err(wrong(
            "[time] step",
            format!(
                "{step} s divides {duration} s into {:.0} steps; at most 10 million are possible",
                duration / step
            ),
        ));
    }
    if let Some(at) = scene.release.and_then(|r| r.at).filter(|at| at.0 > duration) {
        return Err(wrong(
            "[release] at",
            format!("{} s is after the end, {duration} s", at.0),
        ));
    }
    Ok(())
}
