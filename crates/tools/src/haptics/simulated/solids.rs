//! Solids whose distance is a formula: what scenes touch. Lengths are mm, angles radians; each goes on without end along y unless said.

use super::super::{Obstacle, Touch};
use glam::{DVec2, DVec3};

/// Distance and direction from the nearest of some points or rays in the plane of x and z, as a 3D answer.
fn flat((distance, g): (f64, DVec2)) -> (f64, DVec3) {
    (distance, DVec3::new(g.x, 0.0, g.y))
}

/// Everything below a plane.
#[derive(Clone, Copy, Debug)]
pub struct HalfSpace {
    /// Into the air, of length 1.
    pub normal: DVec3,
    /// Distance of the plane from the origin along the normal.
    pub height: f64,
}

impl HalfSpace {
    /// Below z = height.
    pub fn floor(height: f64) -> Self {
        Self {
            normal: DVec3::Z,
            height,
        }
    }
}

impl Obstacle for HalfSpace {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        (self.normal.dot(p) - self.height, self.normal)
    }

    fn finest(&self) -> f64 {
        f64::INFINITY
    }
}

/// |z| below half a thickness, without end.
#[derive(Clone, Copy, Debug)]
pub struct Sheet {
    /// From face to face.
    pub thickness: f64,
}

impl Obstacle for Sheet {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        (
            p.z.abs() - 0.5 * self.thickness,
            if p.z < 0.0 { -DVec3::Z } else { DVec3::Z },
        )
    }

    fn finest(&self) -> f64 {
        self.thickness
    }
}

/// A wedge of the plane of x and z about the axis z, with its vertex at the origin, that opens upwards: signed distance to its
/// rim, positive within.
fn within_wedge(half: f64, p: DVec2) -> (f64, DVec2) {
    let (sine, cosine) = libm::sincos(half);
    // The nearer of the two sides is that on the side of the point.
    let side = if p.x < 0.0 { -1.0 } else { 1.0 };
    let (along, inward) = (DVec2::new(side * sine, cosine), DVec2::new(-side * cosine, sine));
    let depth = p.dot(inward);
    if depth >= 0.0 || p.dot(along) >= 0.0 {
        (depth, inward)
    } else {
        let far = p.length();
        (-far, -p / far)
    }
}

/// All but a wedge that opens upwards from the origin: a trench along y.
#[derive(Clone, Copy, Debug)]
pub struct Groove {
    /// Angle from the axis to a side.
    pub half: f64,
}

impl Obstacle for Groove {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        flat(within_wedge(self.half, DVec2::new(p.x, p.z)))
    }

    fn finest(&self) -> f64 {
        f64::INFINITY
    }
}

/// A wedge that points upwards with its edge on the axis y.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Angle from the axis to a side.
    pub half: f64,
}

impl Obstacle for Edge {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let (depth, inward) = within_wedge(self.half, DVec2::new(p.x, -p.z));
        flat((-depth, DVec2::new(-inward.x, inward.y)))
    }

    /// The wedge is as thin as one likes near its edge.
    fn finest(&self) -> f64 {
        0.5
    }
}

/// A ball.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Its middle.
    pub middle: DVec3,
    /// Its radius.
    pub radius: f64,
}

impl Obstacle for Ball {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let off = p - self.middle;
        (off.length() - self.radius, off.normalize_or(DVec3::Z))
    }

    fn finest(&self) -> f64 {
        2.0 * self.radius
    }
}

/// A rod along y through the origin.
#[derive(Clone, Copy, Debug)]
pub struct Rod {
    /// Its radius.
    pub radius: f64,
}

impl Obstacle for Rod {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let off = DVec3::new(p.x, 0.0, p.z);
        (off.length() - self.radius, off.normalize_or(DVec3::Z))
    }

    fn finest(&self) -> f64 {
        2.0 * self.radius
    }
}

/// z below 0 but for a slot |x| below half a gap, without bottom.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Width of the slot.
    pub gap: f64,
}

impl Obstacle for Channel {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let side = if p.x < 0.0 { -1.0 } else { 1.0 };
        // From the corner, outwards and upwards.
        let (out, up) = (side * p.x - 0.5 * self.gap, p.z);
        let (distance, g) = if up >= 0.0 && out >= 0.0 {
            (up, DVec2::Y)
        } else if up >= 0.0 {
            let far = out.hypot(up);
            if far == 0.0 {
                (0.0, DVec2::Y)
            } else {
                (far, DVec2::new(out, up) / far)
            }
        } else if out <= 0.0 {
            (-out, -DVec2::X)
        } else if -up <= out {
            (up, DVec2::Y)
        } else {
            (-out, -DVec2::X)
        };
        flat((distance, DVec2::new(side * g.x, g.y)))
    }

    fn finest(&self) -> f64 {
        f64::INFINITY
    }
}

/// Two walls along the plane x = 0, without end.
#[derive(Clone, Copy, Debug)]
pub struct Passage {
    /// Between the walls.
    pub gap: f64,
    /// Of each wall.
    pub thickness: f64,
}

impl Obstacle for Passage {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let side = if p.x < 0.0 { -1.0 } else { 1.0 };
        let beyond = side * p.x - 0.5 * (self.gap + self.thickness);
        let away = if beyond < 0.0 { -side } else { side };
        (beyond.abs() - 0.5 * self.thickness, away * DVec3::X)
    }

    fn finest(&self) -> f64 {
        self.thickness
    }
}

/// An obstacle with friction.
#[derive(Clone, Copy, Debug)]
pub struct Rubbing<O> {
    /// What is touched.
    pub solid: O,
    /// Of friction.
    pub coefficient: f64,
}

impl<O: Obstacle> Obstacle for Rubbing<O> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.solid.distance(p)
    }

    fn finest(&self) -> f64 {
        self.solid.finest()
    }

    fn touch(&self, _: DVec3) -> Touch {
        Touch {
            friction: self.coefficient,
            ..Touch::default()
        }
    }
}

/// z below waves in two directions. The field z − h(x, y) is no distance: its gradient is up to some times as long as 1.
#[derive(Clone, Copy, Debug)]
pub struct Bumps {
    /// From crest to middle, mm.
    pub amplitude: f64,
    /// Along x and along y, mm.
    pub waves: DVec2,
}

impl Obstacle for Bumps {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let k = std::f64::consts::TAU / self.waves;
        let (sx, cx) = libm::sincos(k.x * p.x);
        let (sy, cy) = libm::sincos(k.y * p.y);
        let a = 0.5 * self.amplitude;
        (p.z - a * (sx + sy), DVec3::new(-a * k.x * cx, -a * k.y * cy, 1.0))
    }

    fn finest(&self) -> f64 {
        0.25 * self.waves.min_element()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fitting::phantoms::SplitMix64;

    /// Distances have slope 1 towards the nearest point: φ(p − φ n) = 0, and the gradient is the derivative.
    fn is_distance(name: &str, obstacle: &dyn Obstacle, inside_too: bool) {
        let mut random = SplitMix64::new(5);
        for _ in 0..2000 {
            let p = 8.0 * (random.uniform3() - 0.5);
            let (d, n) = obstacle.distance(p);
            if d < 0.0 && !inside_too {
                continue;
            }
            let foot = obstacle.distance(p - d * n).0;
            assert!(foot.abs() < 1e-9, "{name}: {foot} at the foot of {p}");
            assert!((n.length() - 1.0).abs() < 1e-12, "{name}: gradient {n} at {p}");
            let h = 1e-6;
            let ahead = obstacle.distance(p + h * n).0;
            // On a ridge the far side rises slower.
            assert!(ahead - d <= h * (1.0 + 1e-6), "{name}: too steep at {p}");
        }
    }

    #[test]
    fn solids_of_formulas_tell_true_distances() {
        is_distance("sheet", &Sheet { thickness: 1.0 }, true);
        for half in [0.1, 0.35, 0.8] {
            is_distance("groove", &Groove { half }, true);
            is_distance("edge", &Edge { half }, true);
        }
        is_distance(
            "ball",
            &Ball {
                middle: DVec3::X,
                radius: 2.0,
            },
            true,
        );
        is_distance("rod", &Rod { radius: 1.0 }, true);
        let passage = Passage {
            gap: 3.0,
            thickness: 1.0,
        };
        is_distance("passage", &passage, true);
        is_distance("channel", &Channel { gap: 3.0 }, true);
    }
}
