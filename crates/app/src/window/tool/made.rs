//! Strokes that are made at once, of a line, an outline, an arrow or a click.

use bspline::Aabb;
use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};
use tools::session::Stroke;

use super::stroke::stroke_of;
use super::{Kind, Start, Tool, Use};

/// Degrees beside an axis within which an arrow is meant to go along it.
const SNAP: f64 = 12.0;

/// What was drawn on the solid, in the world of the object.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Where the button went down.
    pub start: Start,
    /// Places of the surface on the way, that one first.
    pub line: Vec<DVec3>,
    /// Where the pointer is now: on the surface, or as far from the eye as the start.
    pub to: DVec3,
    /// The box of the object.
    pub whole: Aabb,
    /// A name that no constraint of it has.
    pub name: String,
    /// What was copied or cut out: of which object, and which box of it.
    pub part: Option<(String, Aabb)>,
    /// A name that no object has.
    pub free: String,
}

impl Drawn {
    /// What has begun at a place.
    pub fn new(start: Start, whole: Aabb) -> Self {
        Self {
            line: vec![start.at],
            to: start.at,
            start,
            whole,
            name: "pin 1".into(),
            part: None,
            free: "part".into(),
        }
    }

    /// Goes on; places nearer than `apart` to the last are left out.
    pub fn go_on(&mut self, on_surface: Option<DVec3>, to: DVec3, apart: f64) {
        self.to = on_surface.unwrap_or(to);
        let last = self.line[self.line.len() - 1];
        self.line.extend(on_surface.filter(|p| p.distance(last) >= apart));
    }

    fn line(&self) -> Vec<[f64; 3]> {
        self.line.iter().map(DVec3::to_array).collect()
    }

    fn outline(&self) -> Result<Value, String> {
        match self.line.len() {
            0..3 => Err("draw round an area: hold the button down on the way".into()),
            _ => Ok(json!({ "spline": { "through": self.line(), "closed": true } })),
        }
    }

    /// The way of an arrow across the line of sight.
    fn arrow(&self) -> Result<DVec3, String> {
        let way = self.to - self.start.at;
        let way = way - way.dot(self.start.along) * self.start.along;
        match way.length() > 1e-3 * self.whole.size().length() {
            true => Ok(way),
            false => Err("draw an arrow: hold the button down on the way".into()),
        }
    }

    /// The middle of the solid below the start.
    fn middle(&self) -> DVec3 {
        self.start
            .beyond
            .map_or(self.start.at, |to| 0.5 * (self.start.at + to))
    }
}

impl Tool {
    /// Whether it acts on what was drawn, at once.
    pub fn acts_at_once(&self) -> bool {
        !matches!(self.kind.by(), Use::Brush | Use::Grip)
    }

    /// The box about a place that it takes.
    pub fn region(&self, at: DVec3) -> Aabb {
        Aabb::new(at - self.radius, at + self.radius)
    }

    /// The stroke of what was drawn.
    ///
    /// # Errors
    /// What is missing of it.
    pub fn made(&self, drawn: &Drawn) -> Result<Stroke, String> {
        let (r, sign) = (self.radius, self.sign());
        let Start {
            at, normal, along, ..
        } = drawn.start;
        let angle = sign * self.settings.angle;
        let length = 2.0 * r;
        Ok(match self.kind {
            Kind::Stamp => {
                let out = (2.0 * self.strength - 1.0) * self.half_height();
                let place = (at + sign * out * normal).to_array();
                let mut solid = json!({ "shape": self.solid(), "along": [place], "turn": [upright(normal)] });
                self.blend(&mut solid);
                stroke_of(if self.inverted { "carve" } else { "add" }, solid)
            }
            Kind::Sweep => {
                let operation = if self.inverted { "carve" } else { "add" };
                let way = match drawn.line.len() {
                    1 => json!(drawn.line()),
                    _ => json!({ "spline": { "through": drawn.line() } }),
                };
                let mut sweep = json!({
                    "operation": operation, "shape": self.solid(), "along": way, "turn": upright(normal),
                    "follow": self.settings.follows && drawn.line.len() > 1,
                });
                self.blend(&mut sweep);
                stroke_of("sweep", sweep)
            }
            Kind::Trim => {
                let forth = drawn.arrow()?.normalize();
                let right = sign * along.cross(forth);
                let size = 4.0 * drawn.whole.size().length();
                let turn = DQuat::from_mat3(&DMat3::from_cols(right, forth, right.cross(forth)));
                let place = (at + 0.5 * size * right).to_array();
                let solid = json!({ "box": { "size": [size, size, size] } });
                stroke_of(
                    "carve",
                    json!({ "shape": solid, "along": [place], "turn": [turned(turn)] }),
                )
            }
            Kind::Crest => {
                let lift = sign * self.depth();
                self.forced(
                    "pull",
                    json!({ "along": drawn.line(), "lift": lift, "radius": r / 3.0 }),
                )
            }
            Kind::Plateau => {
                let lift = sign * self.depth();
                self.forced(
                    "pull",
                    json!({ "area": drawn.outline()?, "lift": lift, "radius": r / 3.0 }),
                )
            }
            Kind::Extrude => {
                let by = (2.0 * sign * self.depth() * normal).to_array();
                let across = 0.2 * width(&drawn.line, normal);
                let told = json!({ "area": drawn.outline()?, "by": by, "radius": across.min(r / 3.0) });
                self.forced("extrude", told)
            }
            Kind::Join => {
                let way = drawn.to - at;
                if way.dot(normal) <= 0.0 {
                    return Err(
                        "a bridge begins at a place that looks towards its end; begin elsewhere".into(),
                    );
                }
                let by = (1.1 * way).to_array();
                self.forced(
                    "join",
                    json!({ "along": [at.to_array()], "by": by, "radius": r / 3.0 }),
                )
            }
            Kind::Flex => {
                let mut bend = self.bend(drawn, angle, length)?;
                bend["radius"] = (r / 3.0).into();
                self.forced("bend", bend)
            }
            Kind::Bend => moved("bend", self.bend(drawn, angle, length)?),
            Kind::Twist => {
                let (at, axis) = (drawn.middle().to_array(), drawn.arrow()?.to_array());
                moved(
                    "twist",
                    json!({ "at": at, "axis": axis, "angle": angle, "length": length }),
                )
            }
            Kind::Whirl => {
                let (at, axis) = (at.to_array(), normal.to_array());
                moved(
                    "twist",
                    json!({ "at": at, "axis": axis, "angle": angle, "radius": r }),
                )
            }
            Kind::Shift => {
                let by = drawn.arrow()?.to_array();
                moved(
                    "shift",
                    json!({ "region": region(&self.region(at)), "by": by, "blend": 0.5 * r }),
                )
            }
            Kind::Mirror => {
                let normal = along_axis(drawn.arrow()?.normalize());
                moved(
                    "mirror",
                    json!({ "at": at.to_array(), "normal": normal.to_array() }),
                )
            }
            Kind::Cut => stroke_of(
                "cut",
                json!({ "region": region(&self.region(at)), "to": drawn.free }),
            ),
            Kind::Copy => return Err("copying is no edit".into()),
            Kind::Paste => {
                let (from, part) = drawn.part.as_ref().ok_or("copy or cut out something first")?;
                let by = (at - part.center()).to_array();
                stroke_of("paste", json!({ "from": from, "region": region(part), "by": by }))
            }
            Kind::Refine => stroke_of("refine", json!({ "along": drawn.line(), "radius": r })),
            Kind::Simplify => {
                let tolerance = 0.02 * self.depth();
                stroke_of(
                    "simplify",
                    json!({ "along": drawn.line(), "radius": r, "tolerance": tolerance }),
                )
            }
            Kind::PinBox => stroke_of("hold", json!({ "name": drawn.name, "points": drawn.line() })),
            Kind::PinLine => self.held(drawn, json!(drawn.line())),
            Kind::PinOutline => self.held(drawn, drawn.outline()?),
            _ => return Err(format!("{} is used step by step", self.kind.name())),
        })
    }

    fn solid(&self) -> Value {
        self.settings
            .solid
            .shape(self.radius, self.settings.height * self.radius)
    }

    fn half_height(&self) -> f64 {
        use super::Solid;
        let (r, height) = (self.radius, self.settings.height * self.radius);
        match self.settings.solid {
            Solid::Ball => r,
            Solid::Box | Solid::Cylinder => 0.5 * height,
            Solid::Capsule => 0.5 * height + r,
            Solid::Ring => (0.25 * height).min(0.9 * r),
        }
    }

    fn bend(&self, drawn: &Drawn, angle: f64, length: f64) -> Result<Value, String> {
        let (at, axis) = (drawn.middle().to_array(), (-drawn.start.along).to_array());
        let direction = drawn.arrow()?.to_array();
        Ok(json!({ "at": at, "axis": axis, "direction": direction, "angle": angle, "length": length }))
    }

    fn held(&self, drawn: &Drawn, sketch: Value) -> Stroke {
        let mut hold = json!({ "name": drawn.name, "sketch": sketch });
        if let Some(spring) = self.settings.spring {
            hold["spring"] = spring.into();
        }
        stroke_of("hold", hold)
    }
}

fn moved(motion: &str, told: Value) -> Stroke {
    stroke_of("move", json!({ "motion": { motion: told } }))
}

fn region(b: &Aabb) -> Value {
    json!({ "min": b.min.to_array(), "max": b.max.to_array() })
}

/// A turn as scripts write it: its axis, as long as its angle in degrees.
pub fn turned(turn: DQuat) -> [f64; 3] {
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let sine = turn.xyz().length();
    let angle = 2.0 * libm::atan2(sine, turn.w).to_degrees();
    (angle * turn.xyz().normalize_or_zero()).to_array()
}

/// The turn that puts a solid's axis along a normal.
fn upright(normal: DVec3) -> [f64; 3] {
    turned(DQuat::from_rotation_arc(DVec3::Z, normal.normalize_or(DVec3::Z)))
}

/// A direction, or the axis that it is about.
fn along_axis(way: DVec3) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .flat_map(|axis| [axis, -axis]);
    let near = axes
        .into_iter()
        .find(|axis| axis.angle_between(way).to_degrees() < SNAP);
    near.unwrap_or(way)
}

/// How wide an outline is where it is narrowest, about, seen along a normal.
fn width(line: &[DVec3], normal: DVec3) -> f64 {
    const WAYS: usize = 12;
    let (u, v) = normal.normalize_or(DVec3::Z).any_orthonormal_pair();
    let across = |n: usize| {
        let (sine, cosine) = (std::f64::consts::PI * n as f64 / WAYS as f64).sin_cos();
        let way = cosine * u + sine * v;
        let places = line.iter().map(|p| p.dot(way));
        let (low, high) = places.fold((f64::INFINITY, -f64::INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        high - low
    };
    (0..WAYS).map(across).fold(f64::INFINITY, f64::min)
}
