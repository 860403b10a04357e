//! Sleep and wake of regions, and how much of them may move at a time.

use bspline::Real;

use super::Region;
use crate::integrators::{Integrator, StepReport};
use crate::patch::PatchError;

/// Below which motion a region falls asleep, in world lengths: densities times the scale of the law, so about the motion
/// of the surface.
///
/// Both have to hold, so neither a turning point nor a pass through balance puts a region to sleep. What it is off its
/// balance then is about `acceleration/ω²`, `ω` its lowest frequency. In single precision a stiff solid cannot get below
/// the rounding of its forces, about `1e-7·(κ/μh²)` of the densities; thresholds below that keep it awake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Speed of the mean kinetic energy, `σ√(2E/M)`, in lengths per second.
    pub speed: f64,
    /// Unbalanced force over mass of any free coefficient, in lengths per second squared; also what a force has to exceed
    /// to wake the region.
    pub acceleration: f64,
}

impl<T: Real> Region<T> {
    /// Whether steps leave the region alone.
    pub fn is_asleep(&self) -> bool {
        self.asleep
    }

    /// Wakes the region.
    pub fn wake(&mut self) {
        self.asleep = false;
    }

    /// Sets the external forces on the samples. A region asleep wakes if they leave more unbalanced than the threshold;
    /// the forces it has already cost one comparison.
    ///
    /// # Errors
    /// As [`crate::patch::Patch::set_force`]; the old forces then stay.
    pub fn set_force(&mut self, force: &[T]) -> Result<(), PatchError> {
        if self.patch.external == force {
            return Ok(());
        }
        self.patch.set_force(force)?;
        if self.asleep {
            self.asleep = self.patch.unbalanced() <= self.thresholds.acceleration;
        }
        Ok(())
    }

    /// Falls asleep, and drops what is left of the velocity, where both thresholds hold.
    pub(super) fn rest_if_quiet(&mut self) {
        // The speed is cheap and decides most of the time. NaN stays awake.
        if self.patch.mean_speed() <= self.thresholds.speed
            && self.patch.unbalanced() <= self.thresholds.acceleration
        {
            self.patch.stop();
            self.asleep = true;
        }
    }

    /// Work of a step: solves times samples; 0 asleep. Wall time is not in it, so that the same input moves the same
    /// regions on every machine.
    pub fn step_work(&self, integrator: Integrator) -> u64 {
        if self.asleep {
            return 0;
        }
        let solves = match integrator {
            Integrator::Paper | Integrator::Symplectic => 1,
            // Auto takes explicit sub-steps only where they cost less than the two solves.
            Integrator::Verlet | Integrator::TrBdf2 | Integrator::Auto => 2,
        };
        solves * self.patch.lattice().sample_count() as u64
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

/// Steps of many regions within a budget of work, in turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Schedule {
    next: usize,
}

impl Schedule {
    /// Moves the regions that are awake by one step of `dt` each, beginning with the first one given up the last time,
    /// until the next would exceed `budget` in units of [`Region::step_work`]. The first one awake always moves, so no
    /// region waits for ever. A caller with a clock sets the budget from the time that its last frames took.
    pub fn step<T: Real>(
        &mut self,
        regions: &mut [Region<T>],
        integrator: Integrator,
        dt: f64,
        budget: u64,
    ) -> Vec<Turn> {
        let count = regions.len();
        let mut turns = vec![Turn::Asleep; count];
        let (mut spent, mut given_up) = (0u64, None);
        for place in (0..count).map(|i| (self.next % count + i) % count) {
            let region = &mut regions[place];
            let work = region.step_work(integrator);
            if region.is_asleep() {
                continue;
            }
            if given_up.is_some() || (spent > 0 && spent.saturating_add(work) > budget) {
                given_up.get_or_insert(place);
                turns[place] = Turn::GivenUp;
                continue;
            }
            spent = spent.saturating_add(work);
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
