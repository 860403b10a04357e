//! Strokes that a hand makes step by step.

use glam::DVec3;
use serde_json::{Map, Value, json};
use tools::session::Stroke;

use super::{Filter, Kind, Tool};

/// Where a stroke begins, in the world of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// On the surface.
    pub at: DVec3,
    /// Outwards.
    pub normal: DVec3,
    /// Away from the eye.
    pub along: DVec3,
    /// Where the line from the eye leaves the solid; none if that is beyond the object's box.
    pub beyond: Option<DVec3>,
}

impl Start {
    /// At a place of which no more is known.
    pub fn at(at: DVec3) -> Self {
        Self {
            at,
            normal: DVec3::Z,
            along: -DVec3::Z,
            beyond: None,
        }
    }
}

/// A stroke of a tool and what is told to it.
pub(super) fn stroke_of(tool: &str, told: Value) -> Stroke {
    let all = Map::from_iter([(tool.to_string(), told)]);
    serde_json::from_value(all.into()).expect("the palette's strokes are strokes")
}

impl Tool {
    /// The stroke that a brush begins at a place of the surface, or a tool that takes hold there.
    pub fn stroke(&self, start: &Start) -> Stroke {
        let (r, sign) = (self.radius, self.sign());
        match (self.kind, self.inverted) {
            (Kind::Carve, false) | (Kind::Add, true) => stroke_of("carve", self.ball()),
            (Kind::Carve, true) | (Kind::Add, false) => stroke_of("add", self.ball()),
            (Kind::Inflate, _) => stroke_of("inflate", self.brush("by", (sign * 0.3 * self.depth()).into())),
            (Kind::Push, _) => {
                let speed = 0.05 * self.depth();
                stroke_of(
                    "push",
                    json!({ "along": [], "radius": r, "speed": speed, "force": sign }),
                )
            }
            // The bump of a pull is some three times as wide as the spread of its force.
            (Kind::Pull, _) => self.forced(
                "pull",
                json!({ "along": [start.at.to_array()], "radius": r / 3.0 }),
            ),
            (Kind::Pad, _) => {
                let disc = json!({ "along": [start.at.to_array()], "disc": r, "radius": r / 3.0 });
                self.forced("pull", disc)
            }
            (Kind::Grab, _) => {
                let mut grab = json!({ "along": [], "radius": r });
                if self.settings.falloff < 1.0 {
                    grab["rigid"] = ((1.0 - self.settings.falloff) * r).into();
                }
                stroke_of("move", json!({ "motion": { "grab": grab } }))
            }
            (Kind::Chisel, false) | (Kind::Squirt, true) => self.forced("chisel", self.groove()),
            (Kind::Chisel, true) | (Kind::Squirt, false) => self.forced("squirt", self.groove()),
            (Kind::Drill, _) => {
                let through = start.beyond.map_or(2.0 * r, |to| to.distance(start.at) + r);
                let by = (through * start.along).to_array();
                self.forced("drill", json!({ "along": [], "by": by, "radius": r / 3.0 }))
            }
            _ => match self.painted() {
                Some((layer, value)) => {
                    let mut brush = self.brush("value", value.into());
                    if self.settings.falloff < 1.0 {
                        brush["fade"] = self.settings.falloff.into();
                    }
                    stroke_of("paint", json!({ "layer": layer, "brush": brush }))
                }
                None => {
                    let level = 1.0 + (4.0 * self.strength).round();
                    let mut smooth = self.brush("level", (level as u32).into());
                    if self.settings.keeps_volume {
                        smooth["keep-volume"] = true.into();
                    }
                    stroke_of("smooth", smooth)
                }
            },
        }
    }

    /// What it paints, and on which layer, if it paints.
    pub fn painted(&self) -> Option<(&'static str, f64)> {
        let factor = libm::exp2(self.sign() * 4.0 * self.strength);
        let felt = |most: f64| if self.inverted { 0.0 } else { most * self.strength };
        Some(match self.kind {
            Kind::Stiffen => ("stiffness", factor),
            Kind::Mass => ("mass", factor),
            Kind::Damping => ("damping", factor),
            Kind::RestLength => ("rest-length", 1.0 + 0.5 * self.sign() * self.strength),
            Kind::SurfaceStiffness => ("surface-stiffness", felt(2000.0)),
            Kind::Friction => ("friction", felt(1.0)),
            _ => return None,
        })
    }

    fn ball(&self) -> Value {
        let mut ball = json!({ "shape": { "sphere": { "radius": self.radius } }, "along": [] });
        self.blend(&mut ball);
        ball
    }

    /// Rounds the crease as it is set.
    pub(super) fn blend(&self, told: &mut Value) {
        if self.settings.blend > 0.0 {
            told["blend"] = (self.settings.blend * self.radius).into();
        }
    }

    fn brush(&self, key: &str, value: Value) -> Value {
        json!({ "along": [], "radius": self.radius, key: value })
    }

    fn groove(&self) -> Value {
        json!({ "along": [], "depth": 0.5 * self.depth(), "radius": 0.5 * self.radius })
    }

    /// A stroke of a force tool that works as it is set.
    pub(super) fn forced(&self, tool: &str, mut told: Value) -> Stroke {
        let mut how = Map::new();
        if self.settings.filter != Filter::Gaussian {
            let filter = Filter::ALL.iter().find(|(f, _)| *f == self.settings.filter);
            let name = filter.map_or("gaussian".into(), |(_, name)| name.to_lowercase());
            how.insert("filter".into(), name.into());
        }
        if self.settings.gives_way {
            how.insert("rule".into(), "compliance".into());
        }
        if let Some(elastic) = self.settings.elastic {
            how.insert("solid".into(), if elastic { "elastic" } else { "clay" }.into());
        }
        if !how.is_empty() {
            told["how"] = how.into();
        }
        stroke_of(tool, told)
    }
}
