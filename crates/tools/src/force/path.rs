use bspline::Field;
use glam::DVec3;

use super::ForceError;

/// Pieces that a parametric curve is cut into. Its length is then off by a third of a millionth for half a circle.
const PIECES: usize = 1024;

/// A way through space, straight or curved, by arc length; goes on straight beyond both ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    points: Vec<DVec3>,
    /// Arc length from the first point to each.
    lengths: Vec<f64>,
}

impl Path {
    /// From point to point.
    ///
    /// # Errors
    /// [`ForceError::Tool`] where a coordinate is not finite or all points are one.
    pub fn through(points: impl IntoIterator<Item = DVec3>) -> Result<Self, ForceError> {
        let (mut kept, mut lengths): (Vec<DVec3>, Vec<f64>) = Default::default();
        for p in points {
            if !p.is_finite() {
                return Err(ForceError::tool(format!(
                    "a path cannot go through {p}; write finite coordinates"
                )));
            }
            let gone = kept.last().map_or(0.0, |last| last.distance(p));
            if kept.is_empty() || gone > 0.0 {
                lengths.push(lengths.last().map_or(0.0, |l| l + gone));
                kept.push(p);
            }
        }
        if kept.len() < 2 {
            return Err(ForceError::tool(
                "a path has no length; let it end beside its start",
            ));
        }
        Ok(Self {
            points: kept,
            lengths,
        })
    }

    /// The curve `at(t)`, `t` from 0 to 1.
    ///
    /// # Errors
    /// As [`through`](Self::through), and what `at` says.
    pub fn parametric(at: impl Fn(f64) -> Result<DVec3, String>) -> Result<Self, ForceError> {
        let points: Result<Vec<_>, String> = (0..=PIECES).map(|i| at(i as f64 / PIECES as f64)).collect();
        Self::through(points.map_err(ForceError::Tool)?)
    }

    /// The points that it goes through.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Arc length.
    pub fn length(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// The place at an arc length from the start.
    pub fn at(&self, s: f64) -> DVec3 {
        let end = self
            .lengths
            .partition_point(|l| *l <= s)
            .clamp(1, self.points.len() - 1);
        let (from, to) = (self.points[end - 1], self.points[end]);
        let share = (s - self.lengths[end - 1]) / (self.lengths[end] - self.lengths[end - 1]);
        from + share * (to - from)
    }

    /// Arc lengths of the points between the ends at which it turns by more than an angle of this cosine, and the cosine there.
    pub fn corners(&self, cosine: f64) -> impl Iterator<Item = (f64, f64)> {
        let ways: Vec<DVec3> = self
            .points
            .windows(2)
            .map(|w| (w[1] - w[0]).normalize())
            .collect();
        let turns = (1..ways.len()).map(move |i| (i, ways[i].dot(ways[i - 1])));
        turns
            .filter(move |(_, turn)| *turn < cosine)
            .map(|(i, turn)| (self.lengths[i], turn))
    }

    /// Unit vector of the way at an arc length.
    pub fn direction(&self, s: f64) -> DVec3 {
        let end = self
            .lengths
            .partition_point(|l| *l <= s)
            .clamp(1, self.points.len() - 1);
        (self.points[end] - self.points[end - 1]).normalize()
    }
}

/// Where a path first leaves the side on which it starts, by arc length: of `behind`, positive on that side, the first zero
/// from 0 on towards `ahead`; if the start itself is on the other side, the first on the way back to `-back`. `None` where
/// that side is nowhere; `ahead` where it does not end.
///
/// `step` is the least part of either side that is seen.
pub fn first_crossing(mut behind: impl FnMut(f64) -> f64, back: f64, ahead: f64, step: f64) -> Option<f64> {
    let mut inside = (0.0, behind(0.0));
    if inside.1 > 0.0 {
        while inside.0 < ahead {
            let s = (inside.0 + step).min(ahead);
            let value = behind(s);
            if value <= 0.0 {
                return Some(root(behind, inside, (s, value)));
            }
            inside = (s, value);
        }
        return Some(ahead);
    }
    let mut outside = inside;
    while outside.0 > -back {
        let s = (outside.0 - step).max(-back);
        let value = behind(s);
        if value > 0.0 {
            return Some(root(behind, (s, value), outside));
        }
        outside = (s, value);
    }
    None
}

/// A zero between two places with values of different sign, to rounding: the Illinois method, with bisection where it creeps.
fn root(mut f: impl FnMut(f64) -> f64, mut a: (f64, f64), mut b: (f64, f64)) -> f64 {
    let exact = 4.0 * f64::EPSILON * a.0.abs().max(b.0.abs()).max((b.0 - a.0).abs());
    let [mut wa, mut wb] = [a.1, b.1];
    let mut kept_before = None;
    for n in 0..200 {
        let width = b.0 - a.0;
        if width.abs() <= exact || b.1 == 0.0 {
            break;
        }
        let share = if n % 8 == 7 { 0.5 } else { wa / (wa - wb) };
        let s = a.0 + share * width;
        if s == a.0 || s == b.0 {
            break;
        }
        let value = f(s);
        let is_b_kept = value > 0.0;
        // An end that stays twice weighs half.
        let weigh = if kept_before == Some(is_b_kept) { 0.5 } else { 1.0 };
        kept_before = Some(is_b_kept);
        if is_b_kept {
            a = (s, value);
            (wa, wb) = (value, weigh * wb);
        } else {
            b = (s, value);
            (wa, wb) = (weigh * wa, value);
        }
    }
    b.0
}

/// Spheres about a place, up to how far the surface is looked for, and directions on each.
const SPHERES: usize = 16;
const DIRECTIONS: usize = 128;

/// A way down that is longer than it leads by less than this share of it, and this of the reach, is straight.
const BENT: [f64; 2] = [0.1, 0.01];

/// The point of the surface `f = iso` that is nearest to `p`, about: down along the gradient, and where noise or flat ground leads that astray,
/// where the first of growing spheres meets it.
///
/// # Errors
/// [`ForceError::Nowhere`] where there is none within `reach`.
pub fn nearest_surface(field: &dyn Field, iso: f64, p: DVec3, reach: f64) -> Result<DVec3, ForceError> {
    let found = match descended(field, iso, p, reach) {
        Some((at, walked)) if walked <= (1.0 + BENT[0]) * at.distance(p) + BENT[1] * reach => Some(at),
        // The walk through the noise of a scan's air ends anywhere.
        Some((at, _)) => nearer(field, iso, p, at.distance(p)).or(Some(at)),
        None => nearer(field, iso, p, reach),
    };
    found.ok_or(ForceError::Nowhere {
        at: p.to_array(),
        reach,
    })
}

/// Steps along the gradient, each as long as the linear field asks for: where they end, and how long they are together.
fn descended(field: &dyn Field, iso: f64, p: DVec3, reach: f64) -> Option<(DVec3, f64)> {
    let (mut x, mut walked) = (p, 0.0);
    for _ in 0..64 {
        let (value, gradient) = field.value_gradient(x);
        let steep = gradient.length_squared();
        if !(steep > 0.0 && steep.is_finite()) {
            return None;
        }
        let step = (iso - value) / steep * gradient;
        // Long steps are not trusted where the field bends.
        let step = step.clamp_length_max(0.25 * reach);
        x += step;
        walked += step.length();
        if x.distance(p) > reach {
            return None;
        }
        if step.length() <= 1e-9 * reach {
            return Some((x, walked));
        }
    }
    // Single precision may not settle to that.
    let (value, gradient) = field.value_gradient(x);
    ((value - iso).abs() <= 1e-4 * reach * gradient.length()).then_some((x, walked))
}

/// Where the spheres meet the surface, and from there along it to where it is perpendicular to the way: they are asked in few directions.
fn nearer(field: &dyn Field, iso: f64, p: DVec3, reach: f64) -> Option<DVec3> {
    let mut at = met(field, iso, p, reach)?;
    for _ in 0..4 {
        let normal = field.value_gradient(at).1.normalize_or_zero();
        let aside = (p - at).reject_from_normalized(normal);
        match descended(field, iso, at + aside, at.distance(p)) {
            Some((next, _)) if next.distance(p) < at.distance(p) => at = next,
            _ => break,
        }
    }
    Some(at)
}

/// On the first sphere on which the field lies on the other side somewhere, the nearest place on the way there.
fn met(field: &dyn Field, iso: f64, p: DVec3, reach: f64) -> Option<DVec3> {
    let sign = if field.value(p) > iso { 1.0 } else { -1.0 };
    // Evenly over the sphere, on a spiral.
    let directions = (0..DIRECTIONS).map(|n| {
        let z = 1.0 - (2 * n + 1) as f64 / DIRECTIONS as f64;
        let turn = n as f64 * std::f64::consts::PI * (3.0 - libm::sqrt(5.0));
        let flat = libm::sqrt(1.0 - z * z);
        DVec3::new(flat * libm::cos(turn), flat * libm::sin(turn), z)
    });
    let directions: Vec<DVec3> = directions.collect();
    let mut inner = vec![sign * (field.value(p) - iso); DIRECTIONS];
    for sphere in 1..=SPHERES {
        let [from, to] = [sphere - 1, sphere].map(|n| reach * n as f64 / SPHERES as f64);
        let mut nearest: Option<(f64, DVec3)> = None;
        for (way, inner) in directions.iter().zip(&mut inner) {
            let behind = |s: f64| sign * (field.value(p + s * *way) - iso);
            let outer = behind(to);
            if outer <= 0.0 {
                let s = root(behind, (from, *inner), (to, outer));
                if nearest.is_none_or(|(least, _)| s < least) {
                    nearest = Some((s, p + s * *way));
                }
            }
            *inner = outer;
        }
        if let Some((_, at)) = nearest {
            return Some(at);
        }
    }
    None
}
