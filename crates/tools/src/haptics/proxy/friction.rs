//! Friction: how far the proxy follows.

use glam::DVec3;

/// A law of friction. The coefficient is the surface's own, [`Touch::friction`](crate::haptics::Touch).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Friction {
    /// Stick and slip by a cone: the force on the hand leans by no more than the angle of friction \[Ruspini97\].
    Cone {
        /// Coefficient at rest over that in motion, 1 or above.
        at_rest: f64,
    },
    /// The proxy goes only a share of its way, `1 − f(1 + d·depth)`, the factor cut to 0…1 [Kim03 eqs. 4.6–4.9, where `F_v` of
    /// 4.9 is `F_r`].
    Depth {
        /// `d`: growth with the depth, 1/mm.
        per_mm: f64,
    },
}

impl Default for Friction {
    fn default() -> Self {
        Self::Cone { at_rest: 1.0 }
    }
}

impl Friction {
    /// Whether a place of the surface holds the proxy against a pull: it leans by no more than the angle of friction from the
    /// normal there. Of the cone alone.
    pub(super) fn holds(&self, coefficient: f64, pull: DVec3, normal: DVec3, sticks: bool) -> bool {
        let Self::Cone { at_rest } = *self else {
            return false;
        };
        let pressing = -pull.dot(normal);
        let along = (pull + pressing * normal).length();
        let coefficient = if sticks {
            coefficient * at_rest
        } else {
            coefficient
        };
        pressing > 0.0 && along <= coefficient * pressing
    }

    /// Where the proxy goes from `from`, when without friction it would go to `to`, and whether it sticks. `depth` of the hand
    /// below `to`, mm; `sticks`, whether it did in the last tick.
    pub(super) fn follow(
        &self,
        coefficient: f64,
        from: DVec3,
        to: DVec3,
        depth: f64,
        sticks: bool,
    ) -> (DVec3, bool) {
        let way = from - to;
        let length = way.length();
        match *self {
            Self::Cone { at_rest } => {
                let held = if sticks {
                    coefficient * at_rest
                } else {
                    coefficient
                } * depth;
                if length <= held {
                    return (from, coefficient > 0.0);
                }
                (to + way * (coefficient * depth / length), false)
            }
            Self::Depth { per_mm } => {
                let share = (coefficient * (1.0 + per_mm * depth)).clamp(0.0, 1.0);
                (to + share * way, share >= 1.0)
            }
        }
    }
}
