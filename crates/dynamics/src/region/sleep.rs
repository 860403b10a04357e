//! Sleep and wake of regions, and how much of them may move at a time.

use bspline::Real;
use serde::{Deserialize, Serialize};

use super::Region;
use crate::integrators::{Integrator, StepReport};
use crate::lattice::OnBox;
use crate::paint::Substance;
use crate::patch::PatchError;

/// Below which motion a region falls asleep, in world lengths: densities times the scale of the law, so about the motion
/// of the surface.
///
/// Both have to hold, so neither a turning point nor a pass through balance puts a region to sleep. What it is off its
/// balance then is about `acceleration/ω²`, `ω` its lowest frequency. In single precision a stiff solid cannot get below
/// the rounding of its forces, about `1e-7·(κ/μh²)` of the densities; thresholds below that keep it awake.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Thresholds {
    /// Speed of the mean kinetic energy, `σ√(2E/M)`, in lengths per second.
    pub speed: f64,
    /// Unbalanced force over mass of any free coefficient, constraint springs and what hard constraints bear included, in lengths per second squared; also what a force has to exceed
    /// to wake the region.
    pub acceleration: f64,
}

impl<T: Real> Region<T> {
    /// Whether steps leave the region alone.
    pub fn is_asleep(&self) -> bool {
        self.asleep
    }

    /// Wakes the region; before the next step it is looked at which parts of it may sleep on.
    pub fn wake(&mut self) {
        self.asleep = false;
        self.parts.steps_to_look = 0;
    }

    /// Paints matter on a box of samples, as [`crate::patch::Patch::paint`]; wakes the region, all parts of it.
    ///
    /// # Errors
    /// As there; the old matter then stays.
    pub fn paint(&mut self, substance: Substance, paint: OnBox<f64>) -> Result<(), PatchError> {
        self.patch.paint(substance, paint)?;
        self.wake();
        self.part = None;
        self.parts.forget();
        Ok(())
    }

    /// Finishes at once the factors that are being made beside the steps.
    pub fn settle(&mut self) {
        self.patch.settle();
        if let Some(part) = &mut self.part {
            part.patch.settle();
        }
    }

    /// Sets the external forces on the samples. A region asleep wakes if they leave more unbalanced than the threshold;
    /// the forces it has already cost one comparison.
    ///
    /// # Errors
    /// As [`crate::patch::Patch::set_force`]; the old forces then stay.
    pub fn set_force(&mut self, force: &[T]) -> Result<(), PatchError> {
        if self.patch.motion.external == force {
            return Ok(());
        }
        let before = self.part.is_some().then(|| self.patch.motion.external.clone());
        self.patch.set_force(force)?;
        if let Some(before) = before {
            self.force_changed(before.into_iter().enumerate());
        }
        if self.asleep && !self.is_balanced() {
            self.wake();
        }
        Ok(())
    }

    /// The same of forces on a box of samples, all others none, at the cost of the box and the one before.
    ///
    /// # Errors
    /// As [`crate::patch::Patch::set_force_on`]; the old forces then stay.
    pub fn set_force_on(&mut self, force: OnBox<T>) -> Result<(), PatchError> {
        self.patch.check_load(&force)?;
        let dims = self.patch.lattice().sample_dims();
        let boxes = [self.patch.motion.pushed, force.at];
        let places = boxes.into_iter().flat_map(|b| b.indices(dims));
        let before: Vec<(usize, T)> = places.map(|i| (i, self.patch.motion.external[i])).collect();
        self.patch.set_force_on(force)?;
        if before
            .iter()
            .all(|(i, then)| self.patch.motion.external[*i] == *then)
        {
            return Ok(());
        }
        self.force_changed(before.into_iter());
        if self.asleep && !self.is_balanced() {
            self.wake();
        }
        Ok(())
    }

    /// Whether no coefficient of the whole is off its balance by more than the threshold. NaN is not balanced.
    fn is_balanced(&mut self) -> bool {
        self.patch.unbalanced() <= self.thresholds.acceleration
    }

    /// Falls asleep, and drops what is left of the velocity, where both thresholds hold.
    pub(super) fn rest_if_quiet(&mut self) {
        // The speed is cheap and decides most of the time. NaN stays awake.
        let moving = self.part.as_mut().map_or(&mut self.patch, |part| &mut part.patch);
        let quiet = moving.mean_speed() <= self.thresholds.speed
            && moving.unbalanced() <= self.thresholds.acceleration;
        if quiet && (self.part.is_none() || self.is_balanced()) {
            self.patch.stop();
            if let Some(part) = &mut self.part {
                part.patch.stop();
            }
            self.asleep = true;
        }
    }

    /// Work of a step: solves times samples awake; 0 asleep. Wall time is not in it, so that the same input moves the same
    /// regions on every machine.
    pub fn step_work(&self, integrator: Integrator) -> u64 {
        if self.asleep {
            return 0;
        }
        solves(integrator) * self.awake_samples() as u64
    }
}

/// Solves of a step.
pub(super) fn solves(integrator: Integrator) -> u64 {
    match integrator {
        Integrator::Paper | Integrator::Symplectic => 1,
        // Auto takes explicit sub-steps only where they cost less than the two solves.
        Integrator::Verlet | Integrator::TrBdf2 | Integrator::Auto => 2,
    }
}

/// What became of a region in [`Schedule::step`].
#[derive(Clone, Debug, PartialEq)]
pub enum Turn {
    /// It was asleep.
    Asleep,
    /// It moved.
    Stepped(StepReport),
    /// The budget was spent: it is behind the others by this step, and comes first the next time.
    GivenUp,
    /// It could not be moved and is as it was.
    Failed(PatchError),
}

impl Turn {
    /// Whether the region had its turn. How many had is all that has to be journaled of [`Schedule::step_while`].
    pub fn was_taken(&self) -> bool {
        matches!(self, Self::Stepped(_) | Self::Failed(_))
    }
}

/// Steps of many regions within a budget of work, in turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Schedule {
    next: usize,
}

impl Schedule {
    /// Moves the regions that are awake by one step of `dt` each, beginning with the first one given up the last time,
    /// until the next would exceed `budget` in units of [`Region::step_work`]. The first one awake always moves, so no
    /// region waits for ever. The same input moves the same regions on every machine.
    pub fn step<T: Real>(
        &mut self,
        regions: &mut [Region<T>],
        integrator: Integrator,
        dt: f64,
        budget: u64,
    ) -> Vec<Turn> {
        let mut spent = 0u64;
        self.step_while(regions, integrator, dt, |work| {
            spent = spent.saturating_add(work);
            spent <= budget
        })
    }

    /// What [`step_while`](Self::step_while) did when `taken` regions had their turn, whatever made it stop there: a session
    /// whose budget was one of time is replayed by it to the same bits.
    pub fn replay<T: Real>(
        &mut self,
        regions: &mut [Region<T>],
        integrator: Integrator,
        dt: f64,
        taken: usize,
    ) -> Vec<Turn> {
        let mut left = taken;
        self.step_while(regions, integrator, dt, |_| {
            let may = left > 0;
            left = left.saturating_sub(1);
            may
        })
    }

    /// The same until `may_move` says no, which is asked before each region with the work of its step. A caller with a
    /// clock, and the seconds that a unit of work took in its last frames, keeps to a budget of time with it.
    pub fn step_while<T: Real>(
        &mut self,
        regions: &mut [Region<T>],
        integrator: Integrator,
        dt: f64,
        mut may_move: impl FnMut(u64) -> bool,
    ) -> Vec<Turn> {
        let count = regions.len();
        let mut turns = vec![Turn::Asleep; count];
        let (mut first, mut given_up) = (true, None);
        for place in (0..count).map(|i| (self.next % count + i) % count) {
            let region = &mut regions[place];
            if region.is_asleep() {
                continue;
            }
            let may = given_up.is_none() && (may_move(region.step_work(integrator)) || first);
            first = false;
            if !may {
                given_up.get_or_insert(place);
                turns[place] = Turn::GivenUp;
                continue;
            }
            turns[place] = match region.step(integrator, dt) {
                Ok(Some(report)) => Turn::Stepped(report),
                Ok(None) => Turn::Asleep,
                Err(error) => Turn::Failed(error),
            };
        }
        self.next = given_up.unwrap_or(self.next);
        turns
    }
}
