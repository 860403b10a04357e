//! The body of a device between two ticks.

use std::collections::VecDeque;

use glam::{DQuat, DVec3};

use super::super::gates::held;
use super::super::{Abilities, Device, DeviceError, Pose, Reading};
use super::{Fault, FaultKind, Mechanics, SimulatedHand};

/// Longest step of the motion, s: a hundredth of a tick. A scheme that stepped with the tick would move the limit of
/// stability that is looked for.
const SUB_STEP: f64 = 10e-6;

/// Forces under way at most: 10 ms at 10 kHz.
const UNDER_WAY: usize = 128;

/// Time for which a writer may owe an answer before sending fails, s: with a tick before and after, no force is older than 10 ms.
const HEARTBEAT: f64 = 8e-3;

/// A mass with damping, dry friction, an encoder that counts and an amplifier that is late and saturates, in a hand.
#[derive(Clone, Debug)]
pub struct SimulatedDevice {
    mechanics: Mechanics,
    abilities: Abilities,
    hand: SimulatedHand,
    faults: Vec<Fault>,
    now: f64,
    /// Place, mm.
    at: DVec3,
    /// Speed, m/s.
    speed: DVec3,
    /// When forces and torques arrive.
    under_way: VecDeque<(f64, DVec3, DVec3)>,
    force: DVec3,
    torque: DVec3,
    arrived: f64,
    /// Work of the motors on the hand and the mass so far, J.
    work: f64,
    told: Option<(f64, Pose)>,
    stalled_since: Option<f64>,
    is_self_timed: bool,
    fades: bool,
}

impl SimulatedDevice {
    /// A device at rest where the hand wants to be at time 0.
    pub fn new(mechanics: Mechanics, hand: SimulatedHand) -> Self {
        Self {
            abilities: mechanics.abilities(),
            at: hand.path.at(0.0).0,
            mechanics,
            hand,
            faults: Vec::new(),
            now: 0.0,
            speed: DVec3::ZERO,
            under_way: VecDeque::with_capacity(UNDER_WAY),
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
            arrived: 0.0,
            work: 0.0,
            told: None,
            stalled_since: None,
            is_self_timed: false,
            fades: false,
        }
    }

    /// With faults to come.
    #[must_use]
    pub fn with_faults(mut self, faults: impl IntoIterator<Item = Fault>) -> Self {
        self.faults = faults.into_iter().collect();
        self
    }

    /// Moved on by its own period at each reading but the first: for loops that know a [`Device`] only.
    #[must_use]
    pub fn self_timed(mut self) -> Self {
        self.is_self_timed = true;
        self
    }

    /// With a writer that lets a force fade when no other follows, as [`held`] says.
    #[must_use]
    pub fn fading(mut self) -> Self {
        self.fades = true;
        self
    }

    /// What it is made of.
    pub fn mechanics(&self) -> &Mechanics {
        &self.mechanics
    }

    /// Who holds it.
    pub fn hand(&self) -> &SimulatedHand {
        &self.hand
    }

    /// Virtual time, s.
    pub fn now(&self) -> f64 {
        self.now
    }

    /// Where it truly is.
    pub fn pose(&self) -> Pose {
        Pose {
            at: self.at,
            turn: self.hand.turn(self.now),
        }
    }

    /// Its true speed, m/s.
    pub fn speed(&self) -> DVec3 {
        self.speed
    }

    /// Force of the motors now, N.
    pub fn force(&self) -> DVec3 {
        self.force * self.share()
    }

    /// Torque of the motors now, N mm.
    pub fn torque(&self) -> DVec3 {
        self.torque * self.share()
    }

    /// Share that is left of what arrived last.
    fn share(&self) -> f64 {
        if self.fades {
            held(self.now - self.arrived)
        } else {
            1.0
        }
    }

    /// Work of the motors on the hand and the mass so far, J: what came out of the port of the loop.
    pub fn work(&self) -> f64 {
        self.work
    }

    /// Lets so many seconds pass.
    pub fn advance(&mut self, dt: f64) {
        let steps = (dt / SUB_STEP - 1e-9).ceil().max(1.0);
        let h = dt / steps;
        let start = self.now;
        for i in 1..=steps as u32 {
            self.step(h);
            self.now = start + f64::from(i) * h;
        }
    }

    fn step(&mut self, h: f64) {
        // Half a step's tolerance: times are sums of rounded steps.
        while let Some(&(arrival, force, torque)) = self.under_way.front()
            && arrival <= self.now + 0.5 * h
        {
            (self.force, self.torque, self.arrived) = (force, torque, self.now);
            self.under_way.pop_front();
        }
        let lets_go = self.now - self.arrived > self.mechanics.watchdog;
        if lets_go || self.fails(FaultKind::Unplugged) {
            (self.force, self.torque) = (DVec3::ZERO, DVec3::ZERO);
        }
        let (m, motors) = (&self.mechanics, self.force());
        let (hand, hand_damping) = self.hand.force(self.now, self.at, self.speed);
        // Damping is taken at the end of the step, so that it only ever brakes.
        let pushed = self.speed + (h / m.mass) * (hand + motors);
        let damped = pushed / (1.0 + h * (m.damping + hand_damping) / m.mass);
        // So is dry friction: what it stops within a step stays at rest, the band of rest of [Karnopp85].
        let stopped = h * m.friction / m.mass;
        let size = damped.length();
        self.speed = if size <= stopped {
            DVec3::ZERO
        } else {
            damped * (1.0 - stopped / size)
        };
        self.at += 1e3 * h * self.speed;
        self.work += h * motors.dot(self.speed);
    }

    fn fails(&self, kind: FaultKind) -> bool {
        self.active().any(|k| k == kind)
    }

    fn active(&self) -> impl Iterator<Item = FaultKind> {
        let now = self.now;
        let lasts = move |f: &&Fault| (f.from..f.until).contains(&now);
        self.faults.iter().filter(lasts).map(|f| f.kind)
    }

    fn gone(&self) -> DeviceError {
        DeviceError::Gone(self.abilities.name.clone())
    }

    /// The true pose as the encoder counts it.
    fn counted(&self) -> Pose {
        let (mut pose, quantum) = (self.pose(), self.mechanics.quantum);
        if quantum > 0.0 {
            pose.at = (pose.at / quantum).round() * quantum;
        }
        pose
    }
}

impl Device for SimulatedDevice {
    fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    fn read(&mut self) -> Result<Reading, DeviceError> {
        if self.is_self_timed && self.told.is_some() {
            self.advance(self.mechanics.period);
        }
        if self.fails(FaultKind::Unplugged) {
            return Err(self.gone());
        }
        let mut pose = self.counted();
        for kind in self.active() {
            match kind {
                FaultKind::NotANumber => (pose.at, pose.turn) = (DVec3::NAN, DQuat::NAN),
                FaultKind::Jump(by) => pose.at += by,
                FaultKind::Frozen | FaultKind::Unplugged | FaultKind::WriterStalls => (),
            }
        }
        let (since, pose) = match self.told {
            Some(last) if self.fails(FaultKind::Frozen) => last,
            _ => (self.now, pose),
        };
        self.told = Some((since, pose));
        Ok(Reading {
            pose,
            buttons: self.hand.buttons(self.now),
            age: self.now - since,
        })
    }

    fn send(&mut self, force: DVec3, torque: DVec3) -> Result<(), DeviceError> {
        if self.fails(FaultKind::Unplugged) {
            return Err(self.gone());
        }
        if self.fails(FaultKind::WriterStalls) {
            let since = *self.stalled_since.get_or_insert(self.now);
            return if self.now - since > HEARTBEAT {
                Err(DeviceError::Silent(self.abilities.name.clone()))
            } else {
                Ok(())
            };
        }
        self.stalled_since = None;
        if self.under_way.len() == UNDER_WAY {
            self.under_way.pop_front();
        }
        let m = &self.mechanics;
        self.under_way.push_back((
            self.now + m.delay,
            force.clamp_length_max(m.force),
            torque.clamp_length_max(m.torque),
        ));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Path, Preset};
    use super::*;

    #[test]
    fn a_push_against_damping_reaches_its_final_speed() {
        // m v' + b v = F: v(t) = F/b (1 − e^(−b t/m)).
        let hand = SimulatedHand::none(DVec3::ZERO, DVec3::X);
        let mut device = SimulatedDevice::new(Preset::Ideal.mechanics(), hand);
        device.advance(0.05);
        let exact = 1.0 / 0.8 * (1.0 - libm::exp(-0.8 * 0.05 / 0.045));
        assert!(
            (device.speed().x / exact - 1.0).abs() < 1e-3,
            "{}",
            device.speed()
        );
    }

    #[test]
    fn friction_holds_what_is_pushed_less_and_brakes_the_rest() {
        let m = Mechanics {
            damping: 0.0,
            ..Preset::Falcon.mechanics()
        };
        let pushed = |force: f64| {
            let hand = SimulatedHand::none(DVec3::ZERO, force * DVec3::X);
            let mut device = SimulatedDevice::new(m.clone(), hand);
            device.advance(0.1);
            device.speed().x
        };
        assert_eq!(pushed(0.49), 0.0);
        let exact = (0.6 - 0.5) / 0.25 * 0.1;
        assert!((pushed(0.6) - exact).abs() < 1e-9);
    }

    #[test]
    fn work_of_a_motor_is_what_the_mass_gains_and_the_damper_takes() {
        let hand = SimulatedHand::none(DVec3::ZERO, DVec3::ZERO);
        let m = Preset::Ideal.mechanics();
        let mut device = SimulatedDevice::new(m.clone(), hand);
        let mut lost = 0.0;
        for _ in 0..2000 {
            device.send(DVec3::Y, DVec3::ZERO).expect("no faults");
            device.advance(1e-5);
            lost += m.damping * device.speed().length_squared() * 1e-5;
        }
        let kinetic = 0.5 * m.mass * device.speed().length_squared();
        assert!((device.work() / (kinetic + lost) - 1.0).abs() < 1e-2);
    }

    #[test]
    fn forces_come_late_and_are_clamped_without_turning() {
        let hand = SimulatedHand::light(Path::still(DVec3::ZERO));
        let m = Mechanics {
            delay: 2e-3,
            ..Preset::Omni.mechanics()
        };
        let mut device = SimulatedDevice::new(m, hand);
        device
            .send(DVec3::new(30.0, 40.0, 0.0), DVec3::ZERO)
            .expect("no faults");
        device.advance(1.9e-3);
        assert_eq!(device.force(), DVec3::ZERO);
        device.advance(0.2e-3);
        assert!((device.force() - 3.3 * DVec3::new(0.6, 0.8, 0.0)).length() < 1e-12);
    }

    #[test]
    fn faults_show_while_they_last() {
        let hand = || SimulatedHand::light(Path::straight([(0.0, DVec3::ZERO), (1.0, DVec3::X)]));
        let broken = |kind| {
            let fault = Fault {
                from: 0.01,
                until: 0.02,
                kind,
            };
            SimulatedDevice::new(Preset::Omni.mechanics(), hand()).with_faults([fault])
        };
        let mut frozen = broken(FaultKind::Frozen);
        frozen.read().expect("not yet");
        frozen.advance(0.015);
        assert!((frozen.read().expect("told before").age - 0.015).abs() < 1e-9);
        frozen.advance(0.01);
        assert_eq!(frozen.read().expect("mended").age, 0.0);
        let mut unplugged = broken(FaultKind::Unplugged);
        unplugged.send(DVec3::X, DVec3::ZERO).expect("not yet");
        unplugged.advance(0.009);
        assert_eq!(unplugged.force(), DVec3::X);
        unplugged.advance(0.002);
        assert_eq!(unplugged.force(), DVec3::ZERO);
        assert!(unplugged.read().is_err() && unplugged.send(DVec3::X, DVec3::ZERO).is_err());
        let mut stalled = broken(FaultKind::WriterStalls);
        stalled.advance(0.0101);
        assert!(stalled.send(DVec3::X, DVec3::ZERO).is_ok(), "nobody knows yet");
        stalled.advance(0.0095);
        assert_eq!(stalled.force(), DVec3::ZERO);
        let mut wild = broken(FaultKind::NotANumber);
        wild.advance(0.015);
        assert!(!wild.read().expect("a reading").pose.is_finite());
    }

    #[test]
    fn a_device_that_is_told_nothing_lets_go() {
        let hand = SimulatedHand::light(Path::still(DVec3::ZERO));
        let mut device = SimulatedDevice::new(Preset::Wooden.mechanics(), hand);
        device.send(DVec3::X, DVec3::ZERO).expect("no faults");
        device.advance(0.49);
        assert_eq!(device.force(), DVec3::X);
        device.advance(0.02);
        assert_eq!(device.force(), DVec3::ZERO);
    }
}
