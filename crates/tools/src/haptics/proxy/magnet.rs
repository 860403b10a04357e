//! The magnetic band.

/// A band in front of the surface in which the hand is drawn to it \[Kim03 §4.5\]: so the tool keeps to the surface while it is
/// led over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Magnet {
    /// Depth of the band, mm.
    pub range: f64,
    /// Largest force, N.
    pub strength: f64,
}

impl Magnet {
    /// Force towards the surface at a height over it, N: `(25√5/16)·s·t(1 − t²)²` with `t` the share of the band. In proportion to
    /// the height at first, as in the source, but 0 at the end of the band, where the source's jumps.
    pub fn force(&self, height: f64) -> f64 {
        let t = height / self.range;
        if !(0.0..1.0).contains(&t) {
            return 0.0;
        }
        let fade = 1.0 - t * t;
        STEEPNESS * self.strength * t * fade * fade
    }

    /// Stiffness at the surface, N/m.
    pub fn stiffness(&self) -> f64 {
        1e3 * STEEPNESS * self.strength / self.range
    }
}

/// `25√5/16`: so that the largest force is the strength.
const STEEPNESS: f64 = 3.493_856_214_843_422;
