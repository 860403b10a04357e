//! Hand, device, loop and world, tick by tick in virtual time.

use fitting::phantoms::SplitMix64;
use glam::{DQuat, DVec3};

use super::super::{Device, Pose};
use super::{Drive, SimulatedDevice, Tick, Trace, World};

/// When ticks come.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timing {
    /// Share of the device's period by which each tick is early or late at most, evenly spread.
    pub jitter: f64,
    /// Of what seed.
    pub seed: u64,
    /// Times, s, from which one tick lasts so long, s.
    pub stalls: Vec<(f64, f64)>,
}

/// A whole loop of touch.
pub struct Rig<'a, D> {
    /// The device and its hand.
    pub device: SimulatedDevice,
    /// What is ticked.
    pub drive: D,
    /// What is touched.
    pub world: World<'a>,
    /// When ticks come.
    pub timing: Timing,
    /// Tells the time, s, for the costs of ticks.
    pub clock: Option<fn() -> f64>,
}

impl<'a, D: Drive> Rig<'a, D> {
    /// With ticks as regular as the device's.
    pub fn new(device: SimulatedDevice, drive: D, world: World<'a>) -> Self {
        Self {
            device,
            drive,
            world,
            timing: Timing::default(),
            clock: None,
        }
    }

    /// Ticks until so many seconds of virtual time have passed since the device was made.
    pub fn run(&mut self, until: f64) -> Trace {
        let period = self.device.mechanics().period;
        let mut random = SplitMix64::new(self.timing.seed);
        let mut stalls = self.timing.stalls.iter().copied().peekable();
        let mut trace = Trace::default();
        let (mut dt, mut returned) = (period, 0.0);
        let mut before: Option<(DVec3, DVec3)> = None;
        while self.device.now() < until - 0.5 * period {
            let now = self.device.now();
            let hand = self.device.pose();
            self.world.advance(now, &hand);
            let read = self.device.read();
            let told = read.as_ref().map_or(
                Pose {
                    at: DVec3::NAN,
                    turn: DQuat::NAN,
                },
                |r| r.pose,
            );
            let (felt, distance, age, cost) = self.world.show(now, |obstacle, age| {
                let start = self.clock.map(|c| c());
                let felt = self.drive.tick(read.as_ref(), obstacle, age, dt);
                let cost = self.clock.zip(start).map_or(0.0, |(c, start)| c() - start);
                let distance = obstacle.distance(felt.proxy.at).0;
                (felt, distance, age, cost)
            });
            if let Err(why) = self.device.send(felt.force, felt.torque) {
                self.drive.refused(&why);
            }
            if let Some((at, force)) = before
                && told.is_finite()
            {
                returned += 0.5e-3 * (force + felt.force).dot(told.at - at);
            }
            if told.is_finite() {
                before = Some((told.at, felt.force));
            }
            dt = period * (1.0 + self.timing.jitter * (2.0 * random.uniform() - 1.0));
            if let Some(&(_, long)) = stalls.peek().filter(|s| s.0 <= now + 1e-9) {
                dt = long;
                stalls.next();
            }
            self.device.advance(dt);
            trace.ticks.push(Tick {
                time: now,
                dt,
                read: told,
                at: hand.at,
                target: self.device.hand().path.at(now).0,
                force: felt.force,
                torque: felt.torque,
                applied: self.device.force(),
                proxy: felt.proxy,
                distance,
                contact: felt.contact,
                returned,
                work: self.device.work(),
                age,
                cost,
            });
        }
        trace
    }
}
