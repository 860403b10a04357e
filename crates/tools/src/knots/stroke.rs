use bspline::TensorSpline;
use fitting::Control;

use super::in_levels;
use crate::body::Body;
use crate::canvas::Canvas;
use crate::limits::Limits;
use crate::malleable::Malleable;
use crate::session::Stroke;
use crate::tool::{Tool, ToolError};

/// A canvas on knots of its own.
type Uneven = Canvas<TensorSpline<f32>>;

impl Stroke {
    /// What the stroke leaves of an object, whatever its field is made of, and what is left to say of it, in sentences.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn applied(
        &self,
        canvas: Canvas<Body>,
        control: &mut Control,
    ) -> Result<(Canvas<Body>, Vec<String>), ToolError> {
        let uneven = match &canvas.field {
            Body::Levels(_) => None,
            Body::Knots(field) => Some(canvas.clone().with_field(field.clone())),
        };
        if let Some(uneven) = uneven
            && let Some(left) = self.on_knots(uneven)?
        {
            let body = Body::Knots(left.field.clone());
            return Ok((left.with_field(body), Vec::new()));
        }
        let (canvas, told) = canvas.in_levels(control)?;
        let (left, notes) = self.apply(canvas, control)?;
        Ok((left.into(), told.into_iter().chain(notes).collect()))
    }

    /// The same on knots of its own; none for what works by levels.
    fn on_knots(&self, canvas: Uneven) -> Result<Option<Uneven>, ToolError> {
        let works_by_levels = self.coarse.is_some() || self.wall.is_some() || self.symmetry.is_some();
        if works_by_levels || self.paced || !self.during.is_empty() {
            return Ok(None);
        }
        let stroke = self.of(canvas.material);
        let tool = stroke.tool().map_err(ToolError::Stroke)?;
        let whole = canvas.field.whole();
        let limits = Limits::new(self.within.as_ref(), self.mask.as_ref(), &canvas.others, &whole);
        let limits = limits.map_err(ToolError::Stroke)?.at_detail(canvas.detail);
        tool.on_knots(canvas, &limits)
    }
}

impl Tool<'_> {
    /// What the tool leaves of a canvas on knots of its own; none if it works by levels.
    fn on_knots(&self, canvas: Uneven, limits: &Limits) -> Result<Option<Uneven>, ToolError> {
        let mut left = canvas;
        match self {
            Self::Place(place) => left.placement = place.apply(&left).map_err(ToolError::Stroke)?,
            Self::Material(material) => left.material = **material,
            Self::Surface(surface) => left.iso = surface.apply(&left).map_err(ToolError::Stroke)?,
            Self::Copy(copy) => left.copies.push(copy.to.clone()),
            Self::Free(free) => left.holds = free.left(&left.holds).map_err(ToolError::Stroke)?,
            Self::Hold(hold) => {
                let joined = hold.joined(&left.field, left.iso, &left.holds);
                left.holds = joined.map_err(ToolError::Stroke)?;
            }
            Self::Paint(paint) => {
                let layer = left.painted(paint, limits)?;
                left.layers.insert(paint.layer, layer);
            }
            Self::Refine(refine) => left.field = refine.on_knots(&left.field, limits)?,
            _ => return Ok(None),
        }
        Ok(Some(left))
    }
}

impl Canvas<Body> {
    /// The canvas with its field in levels, and a sentence where it was not.
    ///
    /// # Errors
    /// [`ToolError::Geometric`].
    pub fn in_levels(self, control: &mut Control) -> Result<(Canvas, Option<String>), ToolError> {
        let (field, told) = match &self.field {
            Body::Levels(field) => (field.clone(), None),
            Body::Knots(field) => {
                let (field, told) = in_levels(field, self.iso, control)?;
                (field, Some(told))
            }
        };
        Ok((self.with_field(field), told))
    }
}

impl From<Canvas> for Canvas<Body> {
    fn from(canvas: Canvas) -> Self {
        let body = Body::Levels(canvas.field.clone());
        canvas.with_field(body)
    }
}
