use bspline::{KnotVector, TensorSpline};

use crate::geometric::{GeometricError, Refine, band};
use crate::limits::Limits;

/// Most coefficients of the field that comes out.
const MOST: usize = 1 << 24;

impl Refine {
    /// The field with every knot interval that the brush meets, on each axis, halved as often as asked for.
    ///
    /// Its values change by the rounding of the coefficients alone: they are found in double precision. Knots go through the
    /// whole block, so a stroke that is kept within a part of it is refused.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub(super) fn on_knots(
        &self,
        field: &TensorSpline<f32>,
        limits: &Limits,
    ) -> Result<TensorSpline<f32>, GeometricError> {
        let wrong = |why: String| Err(GeometricError::Shape(why));
        if !limits.is_none() {
            return wrong(
                "knots go through the whole block, so refine cannot keep within a part of it; leave within and mask out".into(),
            );
        }
        if !(1..=8).contains(&self.finer) {
            return wrong(format!("finer is {}; write 1 to 8", self.finer));
        }
        let (_, reach) = band(&self.along, self.radius.0)?;
        let local = reach.transformed(field.parameter_from_world());
        let new: [Vec<f64>; 3] =
            std::array::from_fn(|a| halved(&field.knots()[a], [local.min[a], local.max[a]], self.finer));
        if new.iter().any(Vec::is_empty) {
            let whole = field.world_box();
            let corners = |b: &bspline::Aabb| [b.min.to_array(), b.max.to_array()];
            return Err(GeometricError::Outside {
                tool: corners(&reach),
                field: corners(&whole),
            });
        }
        let shape = field.shape();
        let after = (0..3).fold(1usize, |n, a| n.saturating_mul(shape[a] + new[a].len()));
        if after > MOST {
            return wrong(format!(
                "{after} coefficients would be more than the {MOST} that are handled; use a smaller brush, or a lower finer"
            ));
        }
        with_knots(field, &new)
    }
}

/// What splits the intervals that share more than an end with a range, each into `2^finer`.
fn halved(knots: &KnotVector, [from, to]: [f64; 2], finer: u8) -> Vec<f64> {
    let inner = &knots.knots()[knots.degree()..=knots.coefficient_count()];
    let met = inner
        .windows(2)
        .filter(|w| w[0] < w[1] && w[1] > from && w[0] < to);
    let parts = 1u32 << finer;
    let splits = |w: &[f64]| {
        let [start, length] = [w[0], w[1] - w[0]];
        (1..parts).map(move |i| start + length * f64::from(i) / f64::from(parts))
    };
    met.flat_map(splits).collect()
}

/// The same field with more knots on its axes.
fn with_knots(field: &TensorSpline<f32>, new: &[Vec<f64>; 3]) -> Result<TensorSpline<f32>, GeometricError> {
    let double = field.coefficients().iter().map(|c| f64::from(*c)).collect();
    let (map, slope) = (*field.world_from_parameter(), field.slope());
    let mut fine =
        TensorSpline::new(field.knots().clone(), double, map, slope).map_err(GeometricError::shape)?;
    for (axis, new) in new.iter().enumerate() {
        fine = fine.insert_knots(axis, new).map_err(GeometricError::shape)?;
    }
    let single = fine.coefficients().iter().map(|c| *c as f32).collect();
    TensorSpline::new(fine.knots().clone(), single, map, slope).map_err(GeometricError::shape)
}
