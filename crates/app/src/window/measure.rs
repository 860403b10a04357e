//! Lengths, angles and walls between places of the surface: seen only, no edits.

use glam::DVec3;

/// A place of the surface that was clicked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// In the world.
    pub at: DVec3,
    /// How thick the solid is below it, along the normal; none where the other side is not in the field's box.
    pub wall: Option<f64>,
}

/// What was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measure {
    /// Places in the order of the clicks.
    pub marks: Vec<Mark>,
    /// Area and volume of the object that was asked for last, and its name.
    pub size: Option<(String, [f64; 2])>,
}

impl Measure {
    /// Distances from each place to the next.
    pub fn distances(&self) -> impl Iterator<Item = f64> {
        self.marks.windows(2).map(|m| m[0].at.distance(m[1].at))
    }

    /// At each place between two others the angle between the ways to these, degrees; none where two of them are one.
    pub fn angles(&self) -> impl Iterator<Item = Option<f64>> {
        self.marks.windows(3).map(|m| {
            let ways = [m[0].at - m[1].at, m[2].at - m[1].at];
            let is_angle = ways.iter().all(|way| way.length() > 0.0);
            is_angle.then(|| ways[0].angle_between(ways[1]).to_degrees())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_a_right_triangle() {
        let at = |x, y| Mark {
            at: DVec3::new(x, y, 7.0),
            wall: None,
        };
        let measure = Measure {
            marks: vec![
                at(3.0, 0.0),
                at(0.0, 0.0),
                at(0.0, 4.0),
                at(3.0, 0.0),
                at(3.0, 0.0),
            ],
            size: None,
        };
        assert_eq!(measure.distances().collect::<Vec<_>>(), [3.0, 4.0, 5.0, 0.0]);
        let angles: Vec<_> = measure.angles().collect();
        assert!((angles[0].unwrap() - 90.0).abs() < 1e-12);
        assert!((angles[1].unwrap() - (3.0f64 / 4.0).atan().to_degrees()).abs() < 1e-12);
        assert_eq!(angles[2], None);
    }
}
