//! The three threads one after the other, in virtual time: the same every time.

use document::DocumentError;
use fitting::Control;
use tools::haptics::gates::Trip;
use tools::haptics::simulated::SimulatedDevice;
use tools::haptics::{Device, Servo, TickRecord};

use super::Show;
use super::hand::Hand;
use super::sculpting::Sculpting;
use super::shown::Shown;

/// A simulated device, a servo and a document, without threads and without waiting.
pub struct Rehearsal {
    /// In the hand.
    pub device: SimulatedDevice,
    /// Between hand and solid.
    pub servo: Servo,
    /// What is worked on.
    pub sculpting: Sculpting,
    /// What may be touched of it.
    pub show: Show,
    /// From step to step of the simulation, s. What a step made is shown when the next begins, as by a thread that needs all its time.
    pub step: f64,
}

impl Rehearsal {
    /// Ticks until so many seconds have passed, or `goes_on` says no, which is asked at each step of the simulation with the time that has
    /// passed. Tells `keep` of every tick. Then it ends the stroke that there is.
    ///
    /// # Errors
    /// That an edit cannot be written.
    pub fn run(
        &mut self,
        until: f64,
        control: &mut Control,
        mut goes_on: impl FnMut(f64) -> bool,
        mut keep: impl FnMut(&TickRecord),
    ) -> Result<(), DocumentError> {
        let period = self.device.abilities().period;
        let mut hand = Hand::nobody();
        self.servo.arm();
        let start = self.servo.workspace().scene_from_device(&self.device.pose());
        let mut made = (self.show)(self.sculpting.shown(), start.at);
        let mut shown = Shown::new(1, made.clone(), self.step);
        let (mut next_step, mut last_step) = (0.0, 0.0);
        // Half a period of tolerance: times are sums of rounded steps.
        while self.device.now() < until - 0.5 * period {
            let now = self.device.now();
            if now >= next_step - 0.5 * period {
                if !goes_on(now) {
                    break;
                }
                shown = Shown::new(shown.sequence + 1, made, self.step);
                self.sculpting.step(&hand, control)?;
                let at = hand.pose.map_or(start.at, |pose| pose.at);
                made = (self.show)(self.sculpting.shown(), at);
                (last_step, next_step) = (now, next_step + self.step);
            }
            let told = self.device.read();
            let obstacle = shown.after(now - last_step);
            let tick = self.servo.tick(told.as_ref(), &obstacle, now - last_step, period);
            if self.device.send(tick.wrench.force, tick.wrench.torque).is_err() {
                self.servo.trip(Trip::Writer);
            }
            if told.is_ok() {
                hand.press(tick.record.buttons);
                hand.pose = Some(self.servo.hand());
            }
            hand.proxy = tick.felt.proxy;
            hand.force = tick.felt.force;
            keep(&tick.record);
            self.device.advance(period);
        }
        self.sculpting.end(control).map(drop)
    }
}
