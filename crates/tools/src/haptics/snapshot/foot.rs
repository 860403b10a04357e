//! Closest points: Newton on `f(x) = c`, `p − x ∥ ∇f(x)`.

use bspline::Jet;
use glam::{DMat3, DVec3};

use super::surface::Surface;

/// A place at or near the surface, and what the field is like there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The place.
    pub at: DVec3,
    /// `∇f/|∇f|`: into the solid.
    pub inward: DVec3,
    /// `(f − c)/|∇f|`: how deep inside the place is, to first order.
    pub depth: f64,
    /// `∇²f/|∇f|`.
    pub bend: DMat3,
}

impl Foot {
    /// At a place where the field is `jet`, counted from `c`. Where it is flat there is no surface to go to.
    pub fn new(at: DVec3, jet: &Jet) -> Option<Self> {
        let slope = jet.gradient.length();
        (slope > 0.0 && slope.is_finite()).then(|| Self {
            at,
            inward: jet.gradient / slope,
            depth: jet.value / slope,
            bend: jet.hessian * (1.0 / slope),
        })
    }

    /// At a place where the field is flat: a place and nothing more.
    pub fn flat(at: DVec3) -> Self {
        Self {
            at,
            inward: DVec3::ZERO,
            depth: 0.0,
            bend: DMat3::ZERO,
        }
    }

    /// A Newton step towards the place of the surface that is closest to `p`, sideways by at most `longest`.
    ///
    /// With `n` the normal, `a = −(f − c)/|∇f|` and `u` in the tangent plane: `(1 + sC)u = (p − x) − asCn` there, where
    /// `C = ∇²f/|∇f|` and `s = (p − x)·n`; then along `n` by `a − uᵀCu/2 − a uᵀCn`, so that `f = c` to second order. Beyond the
    /// centre of curvature, where `1 + sC` is not positive and `x` no least distance, it goes downhill instead.
    pub fn toward(&self, p: DVec3, longest: f64) -> DVec3 {
        self.toward_with_trust(p, longest).0
    }

    /// The same, and what the least eigenvalue of `1 + sC` is at least, a half of it or more: 0 where the step was cut or went downhill, and says
    /// little.
    pub fn toward_with_trust(&self, p: DVec3, longest: f64) -> (DVec3, f64) {
        let n = self.inward;
        if n == DVec3::ZERO {
            return (self.at, 0.0);
        }
        let (t1, t2) = n.any_orthonormal_pair();
        let d = p - self.at;
        let (s, a) = (d.dot(n), -self.depth);
        let (c1, c2) = (self.bend * t1, self.bend * t2);
        let (c11, c12, c22) = (t1.dot(c1), t1.dot(c2), t2.dot(c2));
        let (b1, b2) = (n.dot(c1), n.dot(c2));
        let (r1, r2) = (t1.dot(d) - a * s * b1, t2.dot(d) - a * s * b2);
        let (m11, m12, m22) = (1.0 + s * c11, s * c12, 1.0 + s * c22);
        let det = m11 * m22 - m12 * m12;
        let is_upright = det > 1e-3 && m11 + m22 > 0.0;
        let (mut u1, mut u2) = match is_upright {
            true => ((m22 * r1 - m12 * r2) / det, (m11 * r2 - m12 * r1) / det),
            false => (r1, r2),
        };
        let square = u1 * u1 + u2 * u2;
        let is_whole = is_upright && square < longest * longest && a.abs() < longest;
        if square > longest * longest {
            let cut = longest / square.sqrt();
            (u1, u2) = (u1 * cut, u2 * cut);
        }
        let mut sag = 0.5 * (c11 * u1 * u1 + 2.0 * c12 * u1 * u2 + c22 * u2 * u2) + a * (b1 * u1 + b2 * u2);
        let square = u1 * u1 + u2 * u2;
        if sag * sag > 0.25 * square {
            sag = (0.5 * square.sqrt()).copysign(sag);
        }
        (
            self.at + u1 * t1 + u2 * t2 + (a.clamp(-longest, longest) - sag) * n,
            if is_whole { det / (m11 + m22) } else { 0.0 },
        )
    }

    /// How deep a place near this one is inside, to second order.
    pub fn depth_at(&self, p: DVec3) -> f64 {
        let d = p - self.at;
        self.depth + self.inward.dot(d) + 0.5 * d.dot(self.bend * d)
    }
}

/// Planes that are kept of an edge or a corner.
const PLANES: usize = 3;
/// Most evaluations of [`creased`].
const PATIENCE: usize = 24;

/// A plane `n·y + e = 0`, `n·y + e ≥ 0` on the side to be reached.
#[derive(Clone, Copy)]
struct Plane {
    normal: DVec3,
    offset: f64,
}

/// The closest place of a surface that has edges or bends more sharply than Newton can follow: by planes that cut off what is not
/// reached, of which the last three stay. `start` is on the surface and is the answer where nothing nearer is found. `look` is told
/// where the field is asked.
pub fn creased(
    surface: &Surface<'_>,
    p: DVec3,
    is_inside: bool,
    start: DVec3,
    spacing: f64,
    mut look: impl FnMut(DVec3),
) -> DVec3 {
    let side = if is_inside { -1.0 } else { 1.0 };
    let reach = p.distance(start) + spacing;
    let mut best = start;
    let mut planes: Vec<Plane> = Vec::with_capacity(PLANES + 1);
    let (mut x, mut jets) = (start, Vec::new());
    for _ in 0..PATIENCE {
        look(x);
        surface.jets(&[x], &mut jets);
        let Some(foot) = Foot::new(x, &jets[0]) else { break };
        if foot.depth.abs() <= 1e-5 * spacing && p.distance_squared(x) < p.distance_squared(best) {
            best = x;
        }
        let normal = side * foot.inward;
        planes.push(Plane {
            normal,
            offset: side * foot.depth - normal.dot(x),
        });
        if planes.len() > PLANES {
            planes.remove(0);
        }
        let next = nearest_in(&planes, p);
        if next.distance(x) <= 1e-6 * spacing || next.distance(p) > reach {
            break;
        }
        x = next;
    }
    best
}

/// The place nearest to `p` on the inner side of at most three planes: the nearest of those on one, two or three of them.
fn nearest_in(planes: &[Plane], p: DVec3) -> DVec3 {
    let mut best: Option<(f64, DVec3)> = None;
    for set in 1usize..1 << planes.len() {
        let used: Vec<&Plane> = (0..planes.len())
            .filter(|i| set >> i & 1 == 1)
            .map(|i| &planes[i])
            .collect();
        let Some(y) = on_all(&used, p) else { continue };
        let holds = |plane: &Plane| plane.normal.dot(y) + plane.offset >= -1e-9;
        let far = p.distance_squared(y);
        if planes.iter().all(holds) && best.is_none_or(|(least, _)| far < least) {
            best = Some((far, y));
        }
    }
    // Planes that leave nothing over are of a surface that is not convex: the last one counts.
    let last = planes[planes.len() - 1];
    best.map_or(p - (last.normal.dot(p) + last.offset) * last.normal, |(_, y)| y)
}

/// The place nearest to `p` that lies on all of some planes; none where they are nearly parallel.
fn on_all(planes: &[&Plane], p: DVec3) -> Option<DVec3> {
    let n = |i: usize| planes.get(i).map_or(DVec3::ZERO, |plane| plane.normal);
    let gram = |i: usize, j: usize| if i == j { 1.0 } else { n(i).dot(n(j)) };
    // Rows of planes that are not there are those of the unit matrix.
    let m = DMat3::from_cols(
        DVec3::new(gram(0, 0), gram(1, 0), gram(2, 0)),
        DVec3::new(gram(0, 1), gram(1, 1), gram(2, 1)),
        DVec3::new(gram(0, 2), gram(1, 2), gram(2, 2)),
    );
    if m.determinant() < 1e-6 {
        return None;
    }
    let short = |i: usize| {
        planes
            .get(i)
            .map_or(0.0, |plane| -(plane.normal.dot(p) + plane.offset))
    };
    let mu = m.inverse() * DVec3::new(short(0), short(1), short(2));
    Some(p + mu.x * n(0) + mu.y * n(1) + mu.z * n(2))
}
