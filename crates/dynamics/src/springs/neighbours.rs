use serde::{Deserialize, Serialize};

/// Which samples a density spring joins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Neighbours {
    /// The nearest along the axes. Isotropic to 2 % for linear springs.
    Six,
    /// Also across the faces' diagonals. With six, springs of the 4-D law along the surface have no tangent
    /// stiffness, and a Gaussian pull is 63 % wider along a space diagonal than along an axis; with eighteen 3 %.
    Eighteen,
    /// Also across the cubes' diagonals.
    TwentySix,
}

/// One kind of spring: the step from its first sample to its second, and its share of the stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Steps along x, y and z, each −1, 0 or 1.
    pub step: [isize; 3],
    /// Stiffness of the spring relative to `κ·h` of a spring along an axis among six neighbours.
    pub share: f64,
}

impl Direction {
    /// Length relative to the spacing of the samples.
    pub fn length(&self) -> f64 {
        (self.step.iter().map(|s| s * s).sum::<isize>() as f64).sqrt()
    }

    /// Axis of a spring along an axis, `None` of a diagonal one.
    pub fn axis(&self) -> Option<usize> {
        match self.step {
            [1, 0, 0] => Some(0),
            [0, 1, 0] => Some(1),
            [0, 0, 1] => Some(2),
            _ => None,
        }
    }
}

impl Neighbours {
    /// The kinds of springs, one of each opposite pair, along the axes first.
    ///
    /// The shares are `1` for six, `2 : 1` over the sum of squares for eighteen and `16 : 4 : 1` for twenty-six; a
    /// density that rises by `g` per length costs `½κ|g|²` per volume with any of them, whatever its direction.
    pub fn directions(self) -> Vec<Direction> {
        let (axial, face, cube) = match self {
            Self::Six => (1.0, 0.0, 0.0),
            Self::Eighteen => (1.0 / 3.0, 1.0 / 6.0, 0.0),
            Self::TwentySix => (16.0 / 36.0, 4.0 / 36.0, 1.0 / 36.0),
        };
        let mut out = Vec::new();
        let mut add = |steps: &[[isize; 3]], share: f64| {
            if share > 0.0 {
                out.extend(steps.iter().map(|&step| Direction { step, share }));
            }
        };
        add(&[[1, 0, 0], [0, 1, 0], [0, 0, 1]], axial);
        add(
            &[
                [1, 1, 0],
                [1, -1, 0],
                [1, 0, 1],
                [1, 0, -1],
                [0, 1, 1],
                [0, 1, -1],
            ],
            face,
        );
        add(&[[1, 1, 1], [1, 1, -1], [1, -1, 1], [1, -1, -1]], cube);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gradient_costs_the_same_in_every_direction() {
        for neighbours in [Neighbours::Six, Neighbours::Eighteen, Neighbours::TwentySix] {
            for g in [
                [1.0, 0.0, 0.0],
                [0.6, 0.8, 0.0],
                [0.48, 0.6, 0.64],
                [0.0, -0.6, 0.8],
            ] {
                let rise = |d: &Direction| (0..3).map(|a| d.step[a] as f64 * g[a]).sum::<f64>();
                let cost: f64 = neighbours
                    .directions()
                    .iter()
                    .map(|d| d.share * rise(d).powi(2))
                    .sum();
                assert!((cost - 1.0).abs() < 1e-14, "{neighbours:?} {g:?}: {cost}");
            }
        }
    }
}
