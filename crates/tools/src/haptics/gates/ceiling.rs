//! The stiffness that a device can hold.

use super::super::Abilities;

/// The stiffness above which a device trembles, and why.
///
/// A spring that is felt half a period and a delay late takes from the damping of device and hand: `K < (b + b_hand − B)/(T/2 + t_d)`
/// \[Colgate97\], with the coupling's damping B. Where the friction f_c of the device is known, a hand at rest between two counts is
/// held by it as long as `K ≤ 2 f_c/Δ` \[Abbott05\]. What its makers allow counts beside both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ceiling {
    /// By damping and lateness, N/m.
    pub late: f64,
    /// By friction and resolution, N/m; infinite where unknown.
    pub counts: f64,
    /// By its makers, N/m; infinite where unknown.
    pub makers: f64,
}

impl Ceiling {
    /// Of a device at a period of the servo, s, in a hand with a damping, N s/m, with a coupling's damping, N s/m, and the device's
    /// friction, N, where known.
    pub fn new(
        abilities: &Abilities,
        period: f64,
        hand_damping: f64,
        damping: f64,
        friction: Option<f64>,
    ) -> Self {
        // A force lasts until the next pose.
        let late = 0.5 * f64::max(period, abilities.period) + abilities.delay;
        Self {
            late: (abilities.damping + hand_damping - damping).max(0.0) / late,
            counts: match friction {
                Some(friction) if abilities.resolution > 0.0 => {
                    2.0 * friction / (abilities.resolution * 1e-3)
                }
                _ => f64::INFINITY,
            },
            makers: abilities.stiffness,
        }
    }

    /// N/m.
    pub fn stiffness(&self) -> f64 {
        self.late.min(self.counts).min(self.makers)
    }
}

/// What was wished of a coupling and what a device can hold of it, at the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Granted {
    /// N/m.
    pub wished: f64,
    /// N/m.
    pub stiffness: f64,
    /// N s/m.
    pub damping: f64,
    /// What keeps it low.
    pub ceiling: Ceiling,
}

impl Granted {
    /// A sentence where less is granted than was wished.
    pub fn note(&self) -> Option<String> {
        (self.stiffness < self.wished).then(|| {
            let why = match self.ceiling {
                c if c.makers <= c.late.min(c.counts) => "its makers allow no more",
                c if c.counts < c.late => "its friction cannot hide its counts above that",
                _ => "its forces come too late for more",
            };
            format!(
                "a stiffness of {:.0} N/m was wished; the device holds {:.0} N/m, {why}",
                self.wished, self.stiffness
            )
        })
    }
}
