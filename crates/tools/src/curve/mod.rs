//! Curves of tools and constraints: drawn from point to point, as a spline, by formulas of a parameter, or where two formulas
//! of place vanish.

mod meet;
mod spline;

use bspline::Aabb;
use glam::DVec3;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

pub use meet::Meet;
pub use spline::Spline;

use crate::number::{Finite, Point};
use crate::scene::Formula;

/// Pieces that a curve of formulas is cut into. Half a circle is then too short by less than a ten-thousandth of a percent.
const PIECES: usize = 1024;

/// Where a tool goes: places from one to the next, or a curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Along {
    /// A polyline, or one place.
    Points(Vec<Point>),
    /// Another curve.
    Curve(Curve),
}

/// A curve that is no polyline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "lowercase")]
pub enum Curve {
    /// Smoothly through points.
    Spline(Spline),
    /// By formulas of a parameter.
    Formulas(Formulas),
    /// Where two formulas of place vanish.
    Meet(Meet),
}

/// The curve `(x(t), y(t), z(t))`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Formulas {
    /// Formula of `t`.
    pub x: String,
    /// Formula of `t`.
    pub y: String,
    /// Formula of `t`.
    pub z: String,
    /// `t` at the start.
    pub from: Finite,
    /// `t` at the end.
    pub to: Finite,
}

impl Formulas {
    fn line(&self) -> Result<Vec<DVec3>, String> {
        let of = |text: &String| Formula::parse_parameter(text);
        let [x, y, z] = [of(&self.x)?, of(&self.y)?, of(&self.z)?];
        let at = |i: usize| {
            let share = i as f64 / PIECES as f64;
            let t = (1.0 - share) * self.from.0 + share * self.to.0;
            let at = |f: &Formula| f.at_parameter(t);
            Ok(DVec3::new(at(&x)?, at(&y)?, at(&z)?))
        };
        (0..=PIECES).map(at).collect()
    }
}

impl Default for Along {
    fn default() -> Self {
        Self::Points(Vec::new())
    }
}

impl Along {
    /// Whether it is no place at all.
    pub fn is_empty(&self) -> bool {
        matches!(self, Self::Points(points) if points.is_empty())
    }

    /// The points, if it is given by them.
    pub fn points(&self) -> &[Point] {
        match self {
            Self::Points(points) => points,
            Self::Curve(_) => &[],
        }
    }

    /// Goes on to a point; of a curve that is no polyline nothing is left.
    pub fn push(&mut self, p: Point) {
        match self {
            Self::Points(points) => points.push(p),
            Self::Curve(_) => *self = Self::Points(vec![p]),
        }
    }

    /// Polylines of all parts; of a closed part the last point is the first. Curves of formulas of place are looked for in `whole`
    /// where they name no box.
    ///
    /// # Errors
    /// A sentence: for no points, formulas that cannot be read or are not finite, and curves that are nowhere.
    pub fn lines(&self, whole: &Aabb) -> Result<Vec<Vec<DVec3>>, String> {
        let lines = match self {
            Self::Points(points) => vec![points.iter().map(|p| p.0).collect()],
            Self::Curve(Curve::Spline(spline)) => vec![spline.line()?],
            Self::Curve(Curve::Formulas(formulas)) => vec![closed(formulas.line()?)],
            Self::Curve(Curve::Meet(meet)) => meet.lines(whole)?,
        };
        match lines.iter().any(Vec::is_empty) {
            true => Err("along has no place; write at least one point".into()),
            false => Ok(lines),
        }
    }

    /// The only part.
    ///
    /// # Errors
    /// As [`lines`](Self::lines), and where the curve has several parts.
    pub fn line(&self, whole: &Aabb) -> Result<Vec<DVec3>, String> {
        let mut lines = self.lines(whole)?;
        match (lines.pop(), lines.len()) {
            (Some(line), 0) => Ok(line),
            (_, others) => Err(format!(
                "the curve has {} parts; make the box within smaller, so that it holds one",
                others + 1
            )),
        }
    }
}

/// With its last point exactly the first where they are the same but for rounding.
fn closed(mut line: Vec<DVec3>) -> Vec<DVec3> {
    let size = line.iter().fold(0.0_f64, |m, p| m.max(p.distance(line[0])));
    if let [first, .., last] = &mut line[..]
        && first.distance(*last) <= 1e-9 * size
    {
        *last = *first;
    }
    line
}

impl<'de> Deserialize<'de> for Along {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;
        impl<'de> Visitor<'de> for Read {
            type Value = Along;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("points [[x, y, z], ...], or one of { spline }, { formulas } and { meet }")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Along, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(Along::Points)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Along, A::Error> {
                Curve::deserialize(MapAccessDeserializer::new(map)).map(Along::Curve)
            }
        }
        deserializer.deserialize_any(Read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Result<Vec<Vec<DVec3>>, String> {
        #[derive(Deserialize)]
        struct Holder {
            along: Along,
        }
        let read: Holder = toml::from_str(text).map_err(|e| e.to_string())?;
        read.along
            .lines(&Aabb::new(DVec3::splat(-3.0), DVec3::splat(3.0)))
    }

    fn length(line: &[DVec3]) -> f64 {
        line.windows(2).map(|w| w[0].distance(w[1])).sum()
    }

    #[test]
    fn circles_are_the_same_by_any_description() {
        let (tau, sine) = (std::f64::consts::TAU, 0.5_f64.sqrt());
        let by_parameter = "along = { formulas = { x = '1.5*cos(t)', y = '1.5*sin(t)', z = '1', from = 0, to = 6.283185307179586 } }";
        let by_place = "along = { meet = { formulas = ['x*x + y*y - 2.25', 'z - 1'] } }";
        // One that meets the nodes of the grid, and one that lies across it.
        let through = "along = { meet = { formulas = ['x^2 + y^2 + z^2 - 2.25', 'z'] } }";
        let oblique = "along = { meet = { formulas = ['x^2 + y^2 + z^2 - 2.25', 'x + 0.7*y - 0.3*z'] } }";
        for text in [by_parameter, by_place, through, oblique] {
            let lines = lines(text).unwrap();
            assert_eq!(lines.len(), 1, "{text}");
            let line = &lines[0];
            assert_eq!(line.first(), line.last(), "{text}");
            assert!(
                (length(line) / (1.5 * tau) - 1.0).abs() < 1e-3,
                "{text}: {}",
                length(line)
            );
            let middle = DVec3::Z
                * if text == by_parameter || text == by_place {
                    1.0
                } else {
                    0.0
                };
            let off = line
                .iter()
                .map(|p| (p.distance(middle) - 1.5).abs())
                .fold(0.0, f64::max);
            assert!(off < 1e-12, "{text}: {off}");
        }
        let points: Vec<String> = (0..8)
            .map(|i| {
                let turn = tau * f64::from(i) / 8.0;
                format!("[{}, {}, 0]", libm::cos(turn), libm::sin(turn))
            })
            .collect();
        let spline = format!(
            "along = {{ spline = {{ through = [{}], closed = true }} }}",
            points.join(", ")
        );
        let line = &lines(&spline).unwrap()[0];
        assert_eq!(line.first(), line.last());
        assert!(line.iter().all(|p| (p.length() - 1.0).abs() < 0.01));
        assert!(
            line.iter()
                .any(|p| p.distance(DVec3::new(sine, sine, 0.0)) < 1e-15)
        );
    }

    #[test]
    fn all_parts_are_found_each_once() {
        // Two circles, and a line through the whole box.
        let two = lines("along = { meet = { formulas = ['(x^2 + y^2 - 4)^2 - 1', 'z - 0.1'] } }").unwrap();
        assert_eq!(two.len(), 2);
        let mut sizes: Vec<f64> = two.iter().map(|l| length(l) / std::f64::consts::TAU).collect();
        sizes.sort_by(f64::total_cmp);
        assert!((sizes[0] / 3_f64.sqrt() - 1.0).abs() < 1e-3 && (sizes[1] / 5_f64.sqrt() - 1.0).abs() < 1e-3);
        let open = lines(
            "along = { meet = { formulas = ['x - y', 'z + 0.25*x'], within = { min = [-1, -1, -1], max = [1, 1, 1] } } }",
        );
        let open = open.unwrap();
        assert_eq!(open.len(), 1);
        let ends = [open[0][0], open[0][open[0].len() - 1]];
        assert!((length(&open[0]) - 2.0 * (2.0_f64 + 0.0625).sqrt()).abs() < 1e-9);
        assert!(ends.iter().all(|p| (p.x.abs() - 1.0).abs() < 1e-9), "{ends:?}");
    }

    #[test]
    fn what_is_no_curve_is_refused() {
        for (text, word) in [
            ("along = []", "at least one point"),
            ("along = [[nan, 0, 0]]", "finite"),
            ("along = 3", "points"),
            ("along = { circle = 1 }", "circle"),
            ("along = { spline = { through = [[0, 0, 0]] } }", "two"),
            ("along = { spline = { through = [[0, 0, 0], [0, 0, 0]] } }", "two"),
            (
                "along = { formulas = { x = 't', y = '1/t', z = '0', from = 0, to = 1 } }",
                "finite",
            ),
            (
                "along = { formulas = { x = 'x', y = 't', z = '0', from = 0, to = 1 } }",
                "no variable",
            ),
            ("along = { meet = { formulas = ['x', 'd'] } }", "d;"),
            ("along = { meet = { formulas = ['x', 'y +'] } }", "ends too early"),
            ("along = { meet = { formulas = ['x', '1/y'] } }", "finite"),
            ("along = { meet = { formulas = ['x - 9', 'y'] } }", "nowhere"),
            ("along = { meet = { formulas = ['x', 'x'] } }", "surface"),
            (
                "along = { meet = { formulas = ['x', 'y'], within = { min = [0, 0, 0], max = [0, 1, 1] } } }",
                "no size",
            ),
        ] {
            let told = lines(text).expect_err(text);
            assert!(told.contains(word), "{text}: {told}");
        }
    }
}
