//! Where strokes of the palette may act: view state that goes into every stroke.

use bspline::Aabb;
use glam::DVec3;
use serde_json::{Value, json};
use tools::session::Stroke;

/// Where strokes of the palette may act. Places and lengths are those of the chosen object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    /// A place on the plane on both sides of which strokes happen, and the axis across it.
    pub symmetry: Option<(DVec3, DVec3)>,
    /// Thickness of the shell below the outer surface that stays.
    pub wall: Option<f64>,
    /// Finest level that changes.
    pub coarse: Option<usize>,
    /// What may change lies in these, or outside of them.
    pub boxes: Vec<Aabb>,
    /// Or where this formula is above 0, or is not.
    pub lasso: Option<String>,
    /// Whether boxes and lasso name what stays.
    pub keeps: bool,
    /// Length inwards from their border over which strokes grow to their whole.
    pub soft: Option<f64>,
}

impl Limits {
    /// The stroke within these limits, as far as its tool knows them.
    pub fn on(&self, mut stroke: Stroke) -> Stroke {
        let has_place = stroke.hold.is_none();
        if let Some((at, normal)) = self.symmetry.filter(|_| has_place) {
            let plane = json!({ "at": at.to_array(), "normal": normal.to_array() });
            stroke.symmetry = Some(serde_json::from_value(plane).expect("finite places"));
        }
        if !has_place {
            return stroke;
        }
        let wall = self
            .wall
            .map(|wall| serde_json::from_value(wall.into()).expect("a length above 0"));
        stroke.wall = wall.or(stroke.wall);
        stroke.coarse = self.coarse.or(stroke.coarse);
        if let Some(mask) = self.mask() {
            stroke.mask = Some(serde_json::from_value(mask).expect("boxes or a formula"));
        }
        stroke
    }

    fn mask(&self) -> Option<Value> {
        let region = |b: &Aabb| json!({ "min": b.min.to_array(), "max": b.max.to_array() });
        let mut mask = match (&self.lasso, &self.boxes[..]) {
            (Some(formula), _) => json!({ "formula": formula }),
            (None, []) => return None,
            (None, boxes) => json!({ "boxes": boxes.iter().map(region).collect::<Vec<_>>() }),
        };
        mask["outside"] = self.keeps.into();
        if let Some(soft) = self.soft {
            mask["soft"] = soft.into();
        }
        Some(mask)
    }
}
