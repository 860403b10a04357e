use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::number::Point;

/// Pieces of a curve between two of its points.
const PIECES: usize = 32;

/// A smooth curve through points: the centripetal Catmull–Rom spline, which makes neither loops nor cusps between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spline {
    /// The points.
    pub through: Vec<Point>,
    /// Whether it goes on from the last to the first.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub closed: bool,
}

impl Spline {
    pub(super) fn line(&self) -> Result<Vec<DVec3>, String> {
        let mut points: Vec<DVec3> = self.through.iter().map(|p| p.0).collect();
        points.dedup();
        if self.closed && points.first() == points.last() {
            points.pop();
        }
        let n = points.len();
        if n < 2 {
            return Err("a spline goes through two different points at least; write more".into());
        }
        let at = |i: isize| -> DVec3 {
            match (self.closed, usize::try_from(i)) {
                (true, _) => points[i.rem_euclid(n as isize) as usize],
                (false, Err(_)) => 2.0 * points[0] - points[1],
                (false, Ok(i)) if i >= n => 2.0 * points[n - 1] - points[n - 2],
                (false, Ok(i)) => points[i],
            }
        };
        let count = if self.closed { n } else { n - 1 };
        let mut line = vec![points[0]];
        for i in 0..count as isize {
            let of = [at(i - 1), at(i), at(i + 1), at(i + 2)];
            line.extend((1..PIECES).map(|k| between(of, k as f64 / PIECES as f64)));
            line.push(of[2]);
        }
        Ok(line)
    }
}

/// The place at a share of the way from the second to the third point.
fn between([a, b, c, d]: [DVec3; 4], share: f64) -> DVec3 {
    let knot = |p: DVec3, q: DVec3| p.distance(q).sqrt();
    let [ta, tb, tc, td] = {
        let [ab, bc, cd] = [knot(a, b), knot(b, c), knot(c, d)];
        [-ab, 0.0, bc, bc + cd]
    };
    let t = share * tc;
    let mix = |p: DVec3, q: DVec3, tp: f64, tq: f64| ((tq - t) * p + (t - tp) * q) / (tq - tp);
    let [ab, bc, cd] = [mix(a, b, ta, tb), mix(b, c, tb, tc), mix(c, d, tc, td)];
    mix(mix(ab, bc, ta, tc), mix(bc, cd, tb, td), tb, tc)
}
