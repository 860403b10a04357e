//! Box, Sphere, Cone and Cylinder as polygons, about the origin and along y [ISO/IEC 14772-1:1997, 6.7 to 6.13, 6.42].

use glam::{DVec2, DVec3};

use super::tokens::{Token, Tokens};
use crate::Fault;

/// Sides of everything round; a sphere has half as many rings. The polygons lie inside of the true surface by at most
/// 1 − cos²(π/64) = 0.24 % of the radius.
const SIDES: usize = 64;

/// Corners, and faces that end with −1, counterclockwise seen from outside.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    pub points: Vec<DVec3>,
    pub indices: Vec<i32>,
}

/// Whether `kind` is one of the four.
pub(super) fn is_primitive(kind: &[u8]) -> bool {
    matches!(kind, b"Box" | b"Sphere" | b"Cone" | b"Cylinder")
}

/// Reads the fields of a primitive after its brace, up to the other one.
pub(super) fn read(kind: &[u8], tokens: &mut Tokens) -> Result<Polygons, Fault> {
    let mut size = [2.0; 3];
    let (mut radius, mut height) = (1.0, 2.0);
    let [mut side, mut top, mut bottom] = [true; 3];
    loop {
        match tokens.next() {
            Some(Token::CloseNode) => break,
            Some(Token::Word(b"size")) => size = tokens.numbers()?,
            Some(Token::Word(b"radius" | b"bottomRadius")) => radius = tokens.number()?,
            Some(Token::Word(b"height")) => height = tokens.number()?,
            Some(Token::Word(b"side")) => side = tokens.word("TRUE or FALSE")? != b"FALSE",
            Some(Token::Word(b"top")) => top = tokens.word("TRUE or FALSE")? != b"FALSE",
            Some(Token::Word(b"bottom")) => bottom = tokens.word("TRUE or FALSE")? != b"FALSE",
            Some(other) => {
                return Err(tokens.bad(
                    format!("{other} in a {}", String::from_utf8_lossy(kind)),
                    "its fields are size, radius, bottomRadius, height, side, top and bottom",
                ));
            }
            None => return Err(tokens.cut("the end of a primitive")),
        }
    }
    let lengths = match kind {
        b"Box" => size,
        _ => [radius, height, height],
    };
    if let Some(bad) = lengths.iter().find(|l| !(**l > 0.0 && l.is_finite())) {
        return Err(tokens.bad(
            format!("a {} of length {bad}", String::from_utf8_lossy(kind)),
            "its lengths are above 0",
        ));
    }
    Ok(match kind {
        b"Box" => cuboid(DVec3::from_array(size) * 0.5),
        b"Sphere" => sphere(radius),
        b"Cone" => cone(radius, height * 0.5, side, bottom),
        _ => cylinder(radius, height * 0.5, [side, top, bottom]),
    })
}

/// Points of the unit circle at equal angles, by halving: only roots, which are the same on every machine.
fn circle() -> [DVec2; SIDES] {
    let mut all = [DVec2::ZERO; SIDES];
    let quarter = SIDES / 4;
    for (k, p) in [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y]
        .into_iter()
        .enumerate()
    {
        all[k * quarter] = p;
    }
    let mut step = quarter;
    while step > 1 {
        for k in (step / 2..SIDES).step_by(step) {
            all[k] = (all[k - step / 2] + all[(k + step / 2) % SIDES]).normalize();
        }
        step /= 2;
    }
    all
}

impl Polygons {
    fn face(&mut self, corners: impl IntoIterator<Item = usize>) {
        self.indices.extend(corners.into_iter().map(|c| c as i32));
        self.indices.push(-1);
    }

    /// A ring about y, seen from above counterclockwise; the number of its first point.
    fn ring(&mut self, radius: f64, y: f64) -> usize {
        let first = self.points.len();
        let at = |c: DVec2| DVec3::new(c.x * radius, y, -c.y * radius);
        self.points.extend(circle().map(at));
        first
    }

    /// The band between two rings.
    fn band(&mut self, low: usize, high: usize) {
        for k in 0..SIDES {
            let next = (k + 1) % SIDES;
            self.face([low + k, low + next, high + next, high + k]);
        }
    }

    /// Triangles from a ring to a point above it, or below.
    fn fan(&mut self, ring: usize, apex: usize, is_above: bool) {
        for k in 0..SIDES {
            let (a, b) = (ring + k, ring + (k + 1) % SIDES);
            self.face(if is_above { [a, b, apex] } else { [b, a, apex] });
        }
    }
}

fn cuboid(half: DVec3) -> Polygons {
    let mut out = Polygons::default();
    let sign = |bit: usize| if bit & 1 == 1 { 1.0 } else { -1.0 };
    out.points
        .extend((0..8).map(|i| half * DVec3::new(sign(i), sign(i >> 1), sign(i >> 2))));
    for face in [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ] {
        out.face(face);
    }
    out
}

fn sphere(radius: f64) -> Polygons {
    let mut out = Polygons::default();
    let polar = circle();
    let mut last = None;
    for k in 1..SIDES / 2 {
        // From the lower pole up: the cosine of the angle is −y.
        let ring = out.ring(radius * polar[k].y, -radius * polar[k].x);
        if let Some(low) = last {
            out.band(low, ring);
        }
        last = Some(ring);
    }
    let top = out.points.len();
    out.points.push(DVec3::Y * radius);
    out.points.push(DVec3::NEG_Y * radius);
    out.fan(top - SIDES, top, true);
    out.fan(0, top + 1, false);
    out
}

fn cone(radius: f64, half: f64, side: bool, bottom: bool) -> Polygons {
    let mut out = Polygons::default();
    let ring = out.ring(radius, -half);
    let apex = out.points.len();
    out.points.push(DVec3::Y * half);
    if side {
        out.fan(ring, apex, true);
    }
    if bottom {
        out.face((ring..ring + SIDES).rev());
    }
    out
}

fn cylinder(radius: f64, half: f64, [side, top, bottom]: [bool; 3]) -> Polygons {
    let mut out = Polygons::default();
    let low = out.ring(radius, -half);
    let high = out.ring(radius, half);
    if side {
        out.band(low, high);
    }
    if top {
        out.face(high..high + SIDES);
    }
    if bottom {
        out.face((low..low + SIDES).rev());
    }
    out
}
