//! The spring and damper between the hand and what it is held to.

use glam::DVec3;

/// Spring and damper between hand and proxy \[Colgate95\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Damping, N s/m.
    pub damping: f64,
}

/// Time over which the speed of the spring is averaged, s: differences of single ticks are mostly the quantum of the encoder.
const AVERAGED: f64 = 0.005;

impl Coupling {
    /// A spring without a damper.
    pub fn spring(stiffness: f64) -> Self {
        Self {
            stiffness,
            damping: 0.0,
        }
    }

    /// Stiffness in N/mm, in series with that of a surface in N/m.
    pub(crate) fn in_series(&self, surface: f64) -> f64 {
        let all = match surface.is_finite() {
            true => self.stiffness * surface / (self.stiffness + surface),
            false => self.stiffness,
        };
        if all.is_finite() { 1e-3 * all } else { 0.0 }
    }
}

/// How fast the spring of a contact is stretched.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stretching {
    last: Option<DVec3>,
    speed: DVec3,
}

impl Stretching {
    /// Speed, mm/s, of a spring that now reaches from the hand to the proxy by `stretch`.
    pub fn of(&mut self, stretch: DVec3, dt: f64) -> DVec3 {
        if let Some(last) = self.last {
            let share = dt / (dt + AVERAGED);
            self.speed += share * ((stretch - last) / dt - self.speed);
        }
        self.last = Some(stretch);
        self.speed
    }

    /// There is no contact.
    pub fn end(&mut self) {
        *self = Self::default();
    }
}

/// Force of a spring and damper that hold a hand to a surface, N: they press and never pull.
///
/// `stretch` from hand to proxy, mm; `stiffness` in N/mm; `damping` in N s/m; `speed` of the stretch in mm/s.
pub(crate) fn pressing(stretch: DVec3, stiffness: f64, damping: f64, speed: DVec3) -> DVec3 {
    let spring = stiffness * stretch;
    let Some(out) = stretch.try_normalize() else {
        return spring;
    };
    // Along the spring alone: sideways it would be a friction that nobody asked for.
    let damper = 1e-3 * damping * speed.dot(out);
    (spring.dot(out) + damper).max(0.0) * out
}
