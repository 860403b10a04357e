use std::sync::Arc;

use bspline::{Field, HierarchicalSpline, Real};
use fitting::Control;
use serde::{Deserialize, Serialize};

use super::toward::{STAGE, Toward};
use super::{ForceError, Holding, How};
use crate::limits::Region;
use crate::number::{Finite, Point, Positive};
use crate::paint::Layers;
use crate::warp::{Warp, Warped};

/// Bends a solid by forces on its surface: it ends where the bend of space of the same numbers has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bend {
    /// Middle of the hinge.
    pub at: Point,
    /// Direction of the hinge's pin; it turns anticlockwise as seen from its tip.
    pub axis: Point,
    /// To the side that turns.
    pub direction: Point,
    /// By how much, in degrees.
    pub angle: Finite,
    /// Length over which the bend is spread.
    pub length: Positive,
    /// Box of what is taken hold of; all that turns if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<Region>,
    /// Standard deviation of the spread of its force, a world length.
    pub radius: Positive,
    /// How it works.
    #[serde(default)]
    pub how: How,
}

impl Bend {
    /// What it leaves of a field whose surface lies at `iso`, and what is left to say of it, in sentences.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        layers: &Layers,
        holding: &Holding,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, Vec<String>), ForceError> {
        let whole = field.lattice().world_box();
        let warp = |share: f64| {
            let angle = share * self.angle.0.to_radians();
            Warp::bend(
                self.at.0,
                self.axis.0,
                self.direction.0,
                angle,
                self.length.0,
                &whole,
            )
            .map_err(|e| ForceError::tool(e.to_string()))
        };
        let all = warp(1.0)?;
        let zone = match &self.region {
            Some(region) => region.aabb().map_err(ForceError::Tool)?,
            None => whole,
        };
        let zone = bspline::Aabb {
            min: zone.min.max(whole.min),
            max: zone.max.min(whole.max),
        };
        if !zone.min.cmplt(zone.max).all() {
            return Err(ForceError::tool("the region of the bend lies beside the field"));
        }
        let toward = Toward {
            field,
            iso,
            layers,
            holding,
            radius: self.radius.0,
            how: &self.how,
        };
        let farthest = toward.farthest(&zone, |p| all.forth(p))?;
        let stages = (farthest / (STAGE * self.radius.0)).ceil().max(1.0);
        if stages > 1000.0 {
            return Err(ForceError::tool(format!(
                "the bend carries the surface {farthest} far, {stages} stages of {STAGE} radii; take a smaller angle or a larger radius"
            )));
        }
        let now: Arc<dyn Field> = Arc::new(field.clone());
        let bent = |share: f64| Ok(Box::new(Warped::new(now.clone(), warp(share)?)) as Box<dyn Field>);
        let (left, worst) = toward.driven(stages as usize, &zone, bent, control)?;
        let worst = worst.filter(|(off, _)| *off > 0.25 * self.radius.0);
        let note = worst.map(|(off, at)| {
            format!(
                "at {:?} the surface is {off:.3} from where the bend of space has it; where that matters use the motion bend",
                at.to_array().map(|c| (c * 1e3).round() / 1e3)
            )
        });
        Ok((left, note.into_iter().collect()))
    }
}
