//! Strokes that happen on both sides of a plane.

use std::collections::BTreeSet;

use bspline::hierarchical::DiffError;
use bspline::{Field, HierarchicalSpline};
use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};

use crate::canvas::Canvas;
use crate::coefficients::{Functions, changed, coefficient, support, with_functions};
use crate::force::ForceError;
use crate::geometric::{GeometricError, TOLERANCE, reflection};
use crate::number::Point;
use crate::tool::{Tool, ToolError};

/// Share of a finest knot interval that an even surface may be off by on the other side: a quarter of what tools are off by.
const EVEN: f64 = 0.25 * TOLERANCE;

/// Share of its largest change at which a stroke counts as acting on both sides at once.
const OVERLAP: f64 = 0.25;

/// A plane on both sides of which a stroke happens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Symmetry {
    /// A place on it.
    pub at: Point,
    /// Across it; of a stroke over the plane itself, the side it points to is the one that counts.
    pub normal: Point,
}

/// A plane of the lattice: knots on one side have partners on the other.
struct Plane {
    axis: usize,
    /// Twice its place on the axis, in cells of level 0.
    twice: i64,
    /// Side of the normal: the numbers of its functions are larger (1) or smaller (-1).
    side: i64,
}

impl Symmetry {
    /// What a stroke of `tool`, done by `once`, leaves of a canvas if it happens on both sides, and what is left to say of it; `paints` if
    /// it changes what is painted.
    ///
    /// The other side is that of the mirrored canvas, which is the same coefficients on a mirrored lattice, so any tool can be used. Where the
    /// plane is one of the lattice's and the field is even about it, the coefficients of one side are those of the other to the bit: they
    /// are copied. Holds are on their own side alone, so what they keep is not copied.
    ///
    /// Tools whose changes would add up begin on both sides with the surface as the stroke found it; where both sides reach, the one that
    /// changes more there counts. On fields that are not even, that is so where the stroke reaches over the plane.
    ///
    /// # Errors
    /// Those of the tool; [`GeometricError`](crate::geometric::GeometricError) for a normal without direction.
    pub(crate) fn apply(
        &self,
        before: Canvas,
        tool: Tool,
        paints: bool,
        mut once: impl FnMut(Canvas) -> Result<(Canvas, Vec<String>), ToolError>,
    ) -> Result<(Canvas, Vec<String>), ToolError> {
        let mirror = reflection(self.at.0, self.normal.0)?;
        let field = &before.field;
        let is_held =
            matches!(tool, Tool::Force(_) | Tool::Extrude(_) | Tool::Bend(_)) && !before.holds.is_empty();
        let plane = Plane::of(field, &mirror, self.normal.0).filter(|_| !is_held);
        let (one, notes) = once(before.clone())?;
        // Only fields are copied.
        let has_more = match tool {
            Tool::Move(_) => !(one.layers.is_empty() && one.holds.is_empty()),
            _ => paints,
        };
        let adds_up = matches!(
            tool,
            Tool::Force(_)
                | Tool::Extrude(_)
                | Tool::Bend(_)
                | Tool::Move(_)
                | Tool::Smooth(_)
                | Tool::Inflate(_)
                | Tool::Push(_)
        );
        let copied = plane.as_ref().and_then(|plane| {
            let copied = plane.copied(field, &one.field);
            // What is carried along passes the plane twice, and so does the surface then.
            let is_carried = matches!(tool, Tool::Move(_)) && has_more;
            copied.or_else(|| (adds_up && !is_carried).then(|| plane.once(field, &one.field))?)
        });
        if let (Some(field), false) = (&copied, has_more) {
            return Ok((
                Canvas {
                    field: field.clone(),
                    ..one
                },
                notes,
            ));
        }
        let lattice = field.lattice().world_from_lattice;
        let mut other_side = |canvas: &Canvas| {
            let (other, notes) =
                once(canvas.placed(mirror * lattice, &mirror)).map_err(|e| there(e, &mirror, field))?;
            Ok::<_, ToolError>((other.placed(lattice, &mirror), notes))
        };
        // A motion carries holds and paint on, so its sides follow each other; and so do those that lie apart, as each then finds what the
        // other left beside it.
        if adds_up
            && !paints
            && !matches!(tool, Tool::Move(_))
            && overlaps(field, &one.field, &mirror).map_err(GeometricError::shape)?
        {
            let (other, more) = other_side(&before)?;
            let field = larger(field, &one.field, &other.field).map_err(GeometricError::shape)?;
            let new = more.into_iter().filter(|note| !notes.contains(note)).collect();
            return Ok((Canvas { field, ..one }, [notes, new].concat()));
        }
        let (mut both, notes) = other_side(&one)?;
        if !matches!(tool, Tool::Move(_)) {
            both.holds = one.holds;
        }
        let even = || plane.as_ref()?.evened(field, &both.field);
        if let Some(even) = copied.or_else(even) {
            both.field = even;
        }
        Ok((both, notes))
    }
}

/// Where functions have their knots.
fn knots(field: &HierarchicalSpline<f32>, functions: &[(usize, [u32; 3])]) -> Vec<DVec3> {
    let knot = |(level, function): &(usize, [u32; 3])| support(field, *level, *function).0;
    functions.iter().map(knot).collect()
}

/// How much two versions of a field differ at places.
fn differences(old: &HierarchicalSpline<f32>, new: &HierarchicalSpline<f32>, places: &[DVec3]) -> Vec<f64> {
    let [old, new] = [old, new].map(|field| {
        let mut values = vec![(0.0, DVec3::ZERO); places.len()];
        field.values_gradients(places, &mut values);
        values
    });
    old.iter()
        .zip(&new)
        .map(|(old, new)| (new.0 - old.0).abs())
        .collect()
}

/// Whether a change is somewhere large on both sides of a mirror.
fn overlaps(
    old: &HierarchicalSpline<f32>,
    new: &HierarchicalSpline<f32>,
    mirror: &DAffine3,
) -> Result<bool, DiffError> {
    let functions = changed(old, new)?.into_keys();
    let knots: Vec<DVec3> = functions.map(|(level, s)| support(old, level, s).0).collect();
    let mirrored: Vec<DVec3> = knots.iter().map(|p| mirror.transform_point3(*p)).collect();
    let [own, other] = [&knots, &mirrored].map(|places| differences(old, new, places));
    let largest = own.iter().copied().fold(0.0, f64::max);
    let both = own.iter().zip(&other).map(|(own, other)| own.min(*other));
    Ok(both.fold(0.0, f64::max) > OVERLAP * largest)
}

/// Two changes of a field in one: each function is as in the version that changes more at its knot.
fn larger(
    old: &HierarchicalSpline<f32>,
    one: &HierarchicalSpline<f32>,
    other: &HierarchicalSpline<f32>,
) -> Result<HierarchicalSpline<f32>, DiffError> {
    let mut functions = changed(old, one)?;
    functions.extend(changed(old, other)?);
    let functions: Vec<_> = functions.into_keys().collect();
    let places = knots(old, &functions);
    let changes = differences(old, one, &places)
        .into_iter()
        .zip(differences(old, other, &places));
    let of_other = functions
        .iter()
        .zip(changes)
        .filter(|(_, (one, other))| other > one);
    let of_other = of_other.map(|((level, s), _)| ((*level, *s), coefficient(other, *level, *s)));
    with_functions(one, &of_other.collect())
}

/// An error of the other side, where that side is.
fn there(error: ToolError, mirror: &DAffine3, field: &HierarchicalSpline<f32>) -> ToolError {
    let to = |at: [f64; 3]| mirror.transform_point3(DVec3::from_array(at)).to_array();
    let whole = field.lattice().world_box();
    let own = [whole.min.to_array(), whole.max.to_array()];
    match error {
        ToolError::Force(ForceError::Outside { at, .. }) => ForceError::Outside {
            at: to(at),
            field: own,
        }
        .into(),
        ToolError::Force(ForceError::Nowhere { at, reach }) => {
            ForceError::Nowhere { at: to(at), reach }.into()
        }
        ToolError::Geometric(GeometricError::Nowhere { at, reach }) => {
            GeometricError::Nowhere { at: to(at), reach }.into()
        }
        ToolError::Geometric(GeometricError::Leaves { at, face }) => {
            GeometricError::Leaves { at: to(at), face }.into()
        }
        other => other,
    }
}

impl Plane {
    /// The mirror as a plane of the lattice, if it is one.
    fn of(field: &HierarchicalSpline<f32>, mirror: &DAffine3, normal: DVec3) -> Option<Self> {
        let local = *field.lattice_from_world() * *mirror * field.lattice().world_from_lattice;
        let axis = (0..3).find(|a| local.matrix3.col(*a)[*a] < 0.0)?;
        let mut expected = DAffine3::IDENTITY;
        expected.matrix3.col_mut(axis)[axis] = -1.0;
        let twice = local.translation[axis].round();
        expected.translation[axis] = twice;
        let along = field.lattice_from_world().transform_vector3(normal)[axis];
        local.abs_diff_eq(expected, 1e-9).then_some(Self {
            axis,
            twice: twice as i64,
            side: if along > 0.0 { 1 } else { -1 },
        })
    }

    /// The function on the other side, and on which side this one is: 1, -1 or 0.
    fn partner(&self, level: usize, function: [u32; 3]) -> (i64, Option<[u32; 3]>) {
        let own = i64::from(function[self.axis]);
        // Function `s` is centred on knot `s - 1`.
        let other = (self.twice << level) + 2 - own;
        let mut partner = function;
        let found = u32::try_from(other).ok().map(|other| {
            partner[self.axis] = other;
            partner
        });
        ((own - other).signum() * self.side, found)
    }

    /// Whether `field` is even in all functions of a list, but for rounding; not if one of them has no partner in the lattice.
    fn is_even(&self, field: &HierarchicalSpline<f32>, functions: &Functions<f32>) -> bool {
        let most = EVEN * field.slope() * field.finest_spacing();
        functions.keys().all(|(level, function)| {
            let count = field.lattice().cells_at(*level)[self.axis] + 3;
            match self.partner(*level, *function).1 {
                Some(other) if other[self.axis] < count => {
                    let value = |s| coefficient(field, *level, s).map_or(0.0, f64::from);
                    (value(*function) - value(other)).abs() <= most
                }
                _ => false,
            }
        })
    }

    /// A change on one side of an even field, on both.
    fn copied(
        &self,
        old: &HierarchicalSpline<f32>,
        new: &HierarchicalSpline<f32>,
    ) -> Option<HierarchicalSpline<f32>> {
        let functions = changed(old, new).ok()?;
        // Supports that reach over the plane count for both sides.
        let side = |(level, function): &(usize, [u32; 3])| {
            let reach = |by: i64| {
                let mut end = *function;
                end[self.axis] = (i64::from(end[self.axis]) + by).max(0) as u32;
                self.partner(*level, end).0
            };
            if reach(-1) == reach(1) { reach(1) } else { 0 }
        };
        let sides: BTreeSet<i64> = functions.keys().map(side).collect();
        if sides.len() > 1 || sides.contains(&0) || !self.is_even(old, &functions) {
            return None;
        }
        let mirrored = functions.iter().map(|((level, function), value)| {
            let (_, partner) = self.partner(*level, *function);
            ((*level, partner.expect("checked before")), *value)
        });
        with_functions(new, &mirrored.collect()).ok()
    }

    /// Functions of a change of an even field with their partners, that on the side of the normal first.
    fn pairs(
        &self,
        old: &HierarchicalSpline<f32>,
        new: &HierarchicalSpline<f32>,
    ) -> Option<BTreeSet<[(usize, [u32; 3]); 2]>> {
        let functions = changed(old, new).ok()?;
        let is_even = self.is_even(old, &functions);
        let pairs = functions.keys().map(|(level, function)| {
            let (side, partner) = self.partner(*level, *function);
            let partner = partner.expect("checked before");
            match side < 0 {
                true => [(*level, partner), (*level, *function)],
                false => [(*level, *function), (*level, partner)],
            }
        });
        is_even.then(|| pairs.collect())
    }

    /// A change over the plane of an even field, on both: each function and its partner are as the one of them at whose knot the
    /// field changes more.
    fn once(
        &self,
        old: &HierarchicalSpline<f32>,
        new: &HierarchicalSpline<f32>,
    ) -> Option<HierarchicalSpline<f32>> {
        let pairs = self.pairs(old, new)?;
        let functions: Vec<_> = pairs.iter().flatten().copied().collect();
        let changes = differences(old, new, &knots(old, &functions));
        let mut even = Functions::new();
        for (pair, change) in pairs.iter().zip(changes.as_chunks::<2>().0) {
            // Of equal ones the side of the normal counts.
            let (level, function) = pair[usize::from(change[1] > change[0])];
            let value = coefficient(new, level, function);
            even.extend(pair.map(|function| (function, value)));
        }
        with_functions(new, &even).ok()
    }

    /// A change on both sides of an even field, the weaker side replaced by the other.
    fn evened(
        &self,
        old: &HierarchicalSpline<f32>,
        new: &HierarchicalSpline<f32>,
    ) -> Option<HierarchicalSpline<f32>> {
        let pairs = self.pairs(old, new)?.into_iter();
        let even = pairs.map(|[(level, first), second]| (second, coefficient(new, level, first)));
        with_functions(new, &even.collect()).ok()
    }
}
