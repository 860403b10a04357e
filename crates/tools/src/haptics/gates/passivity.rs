//! Passivity observer and controller \[Hannaford02\].

use glam::DVec3;

use super::super::Abilities;

/// Forces that are kept: as many ticks may a device be late.
const KEPT: usize = 64;
/// Ticks without force after which the count begins anew.
const FREE: u32 = 8;

/// Counts the energy that the hand puts in, and damps when it would get more back.
///
/// Of the interval between two poses the force is known that was on the hand then: what was sent as many ticks before as the device
/// is late. So `E ← E − F·Δx` \[Hannaford02 eq. 7\] is exact for a force that is held, but for the quantum of Δx. To it comes what
/// the device's own damping takes, `b Δx²/T`: without that, a hand at rest between two counts would seem to get energy. It is never
/// more than the coupling can hold, `F²/2K`: energy that friction took is no credit for what comes later. If it falls below 0,
/// `d = −E/(T (v² + v₀²))` \[Hannaford02 eq. 9\] is added, with v₀ = Δ/T against the division by nothing, and at most so much as a
/// late device can use.
#[derive(Clone, Debug)]
pub struct Passivity {
    /// Forces sent, N, the newest at `next − 1`.
    sent: [DVec3; KEPT],
    next: usize,
    /// Ticks from sending to feeling.
    late: usize,
    /// N s/m.
    own_damping: f64,
    most_damping: f64,
    /// m/s.
    slow: f64,
    /// J.
    most_energy: f64,
    energy: f64,
    dt: f64,
    ticks_free: u32,
}

impl Passivity {
    /// For a device with a coupling of a stiffness, N/m, that damps by so much at most, N s/m.
    pub fn new(abilities: &Abilities, force: f64, stiffness: f64, most_damping: f64) -> Self {
        let period = abilities.period.max(1e-3);
        let late = (abilities.delay / period).round() as usize;
        // A damper that is felt late is a spring, and then a motor: half as late, twice as much.
        let prompt = 0.5 * period / (0.5 * period + abilities.delay);
        Self {
            sent: [DVec3::ZERO; KEPT],
            next: 0,
            late: late.min(KEPT - 1),
            own_damping: abilities.damping,
            most_damping: most_damping * prompt,
            slow: f64::max(1e-2, abilities.resolution * 1e-3 / period),
            most_energy: 0.5 * force * force / stiffness,
            energy: 0.0,
            dt: period,
            ticks_free: 0,
        }
    }

    /// A force went to the hand, of which it felt a share on the mean.
    pub fn passed(&mut self, force: DVec3, share: f64) {
        self.sent[self.next] = force * share;
        self.next = (self.next + 1) % KEPT;
    }

    /// The hand moved, mm.
    pub fn observe(&mut self, way: DVec3, dt: f64) {
        let force = self.sent[(self.next + KEPT - 1 - self.late) % KEPT];
        let way = way * 1e-3;
        self.dt = dt;
        self.ticks_free = if force == DVec3::ZERO {
            self.ticks_free + 1
        } else {
            0
        };
        if self.ticks_free > FREE {
            self.energy = 0.0;
            return;
        }
        self.energy -= force.dot(way);
        self.energy += self.own_damping * way.length_squared() / dt;
        self.energy = self.energy.min(self.most_energy);
    }

    /// The force that damps, N, at a velocity of the hand, m/s.
    pub fn damping(&self, velocity: DVec3) -> DVec3 {
        if self.energy >= 0.0 || self.most_damping == 0.0 {
            return DVec3::ZERO;
        }
        let speeds = velocity.length_squared() + self.slow * self.slow;
        let damping = (-self.energy / (self.dt * speeds)).min(self.most_damping);
        -damping * velocity
    }

    /// J.
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// Begins anew.
    pub fn forget(&mut self) {
        self.sent = [DVec3::ZERO; KEPT];
        self.energy = 0.0;
        self.ticks_free = 0;
    }
}
