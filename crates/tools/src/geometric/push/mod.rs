//! A surface pushed in or drawn out by a brush, as fast as the force says \[Kim03 §6.2.1\].
//!
//! Each step makes an intermediate surface: what lies under the brush moves along the normal at its place, and the next step begins on
//! what that one left. The paper lets densities approach those of a ball at the tool's tip; here the way of a step is a length, speed times force.

mod cover;
mod way;

use bspline::{Aabb, Field, HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::FieldFitReport;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::GeometricError;
use super::band::FULL;
use super::moved::Moved;
use super::write::{Fineness, TOLERANCE, Writer};
use crate::force::nearest_surface;
use crate::limits::Limits;
use crate::number::{Numbers, Point, Positive};
use cover::Cover;
use way::Way;

/// Radii in which a place has to have the surface.
const NEAR: f64 = 2.0;

/// Radii between places at which the brush acts on its way through a step.
const APART: f64 = 0.25;

/// Share of a step that may be lost: functions that change by less are left out.
const LOST: f64 = 0.0025;

/// Radii of a bend of the wall. Steps add up what each is off by: of eight, on four intervals across the wall, it is 0.8 % of the depth and 9°
/// of its normals, on eight 0.2 % and 2°.
const BEND: f64 = 0.25;

/// Knot intervals of the object's detail that a step moves the surface by at least, or it does nothing: single precision has no more.
const LEAST: f64 = 1e-4;

/// Most steps of a stroke, and most places of a step.
const MOST: u32 = 10_000;

/// Moves a surface as a thumb does, step by step: all under the brush goes along the normal at its place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Push {
    /// The brush's way; each place is drawn to the surface as it is then.
    pub along: Vec<Point>,
    /// It acts whole within half of this of its axis, the normal at its place, and not at all beyond; along its axis whole within this.
    pub radius: Positive,
    /// Length that a force of 1 moves the surface by in one step.
    pub speed: Positive,
    /// How hard it is pushed, into the solid, or out of it if negative; 1 if missing. By hand one for all steps, or one a step.
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    pub force: Numbers,
    /// Steps of equal length that the way takes; one if missing. By hand each place is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<u32>,
    /// As for [`Geometric`](super::Geometric); a 400th of the way of a step at most.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
    /// Levels finer than the object's detail that may be added; as many as show the brush if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<u8>,
}

impl Push {
    /// What the last step leaves of a field whose surface lies at `iso`, and how close it is to the surface moved.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        let count = self.steps.unwrap_or(1);
        if !(1..=MOST).contains(&count) {
            return wrong(format!("steps is {count}; write 1 to {MOST}"));
        }
        let force = match self.force.0[..] {
            [] => 1.0,
            [one] => one.0,
            _ => {
                return wrong(
                    "a force for each place is that of a hand; write one force, or paced = true".into(),
                );
            }
        };
        let by = force * self.speed.0;
        if by.abs() > FULL * self.radius.0 {
            return wrong(format!(
                "a force of {force} moves the surface by {} in a step, more than half the radius {}; push less hard, or in more steps",
                by.abs(),
                self.radius.0
            ));
        }
        let mut way = Way::through(&self.along)?;
        let mut left = (field.clone(), FieldFitReport::default());
        for step in 0..count {
            control.step("pushing", f64::from(step) / f64::from(count))?;
            let writer = Writer {
                field: &left.0,
                iso,
                limits,
            };
            if by.abs() < LEAST * writer.spacing() {
                break;
            }
            let part = [step, step + 1].map(|n| f64::from(n) / f64::from(count));
            let (places, drawn) = self.drawn(&writer, &way.part(part, APART * self.radius.0)?)?;
            if let Way::Place(at) = &mut way {
                // It stays on the surface that it moves.
                let [place, inward] = drawn[0];
                *at = place + by * inward;
            }
            let cover = Cover {
                share: 1.0 / places as f64,
                places: drawn,
                radius: self.radius.0,
                by,
            };
            left = self.stepped(&writer, cover, control)?;
        }
        Ok(left)
    }

    /// The number of places, and those of them that have a surface: there, and the way into the solid.
    fn drawn<T: Real>(
        &self,
        writer: &Writer<T>,
        places: &[DVec3],
    ) -> Result<(usize, Vec<[DVec3; 2]>), GeometricError> {
        let about = Aabb::about(places.iter().copied()).expect("a place");
        writer.within(&about.widened(self.radius.0))?;
        let reach = NEAR * self.radius.0;
        let drawn = places
            .iter()
            .map(|p| nearest_surface(writer.field, writer.iso, *p, reach));
        // Where the brush goes over an edge the rest of it acts.
        let inward = |at| writer.field.value_gradient(at).1.normalize_or_zero();
        let drawn: Vec<_> = drawn.filter_map(Result::ok).map(|at| [at, inward(at)]).collect();
        match drawn.is_empty() {
            true => Err(GeometricError::Nowhere {
                at: places[0].to_array(),
                reach,
            }),
            false => Ok((places.len(), drawn)),
        }
    }

    /// One intermediate surface.
    fn stepped<T: Real>(
        &self,
        writer: &Writer<T>,
        cover: Cover,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        let within = writer.within(&cover.within().expect("a place"))?;
        let tolerance = self.tolerance.map_or(TOLERANCE * writer.spacing(), |t| t.0);
        let fineness = writer.shown(&Fineness {
            tolerance: Some(Positive(tolerance.min(LOST * cover.by.abs()))),
            finer: self.finer,
            feature: Some(BEND * self.radius.0),
            densities: Some(1.0),
        });
        let moved = Moved::new(writer.field, cover, 1e-4 * self.radius.0);
        writer.written(&moved, &within, &fineness, control)
    }
}

fn wrong<R>(why: String) -> Result<R, GeometricError> {
    Err(GeometricError::Shape(why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::Finite;

    /// However the time of a way is cut into steps, a brush acts as long on every place of it.
    #[test]
    fn steps_share_the_time_of_a_way() {
        let along = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 4.0, 0.0]].map(|p| Point(p.into()));
        let way = Way::through(&along).unwrap();
        let radius = 1.0;
        let acted = |count: u32, p: DVec3| -> f64 {
            let steps = (0..count).map(|n| {
                let part = [n, n + 1].map(|n| f64::from(n) / f64::from(count));
                let places = way.part(part, APART * radius).unwrap();
                let places: Vec<_> = places.into_iter().map(|at| [at, DVec3::Z]).collect();
                let share = 1.0 / places.len() as f64;
                let cover = Cover {
                    places,
                    share,
                    radius,
                    by: 1.0,
                };
                cover.share_at(p).z / f64::from(count)
            });
            steps.sum()
        };
        for p in [[1.5, 0.0, 0.0], [1.5, 0.6, 0.0], [3.0, 2.0, 0.3]].map(DVec3::from) {
            let all = acted(1, p);
            for count in [2, 7, 50] {
                assert!((acted(count, p) - all).abs() < 0.005 * all, "{count} {p}");
            }
        }
        // Full over one radius, fading over half a radius before and behind, of a way of seven.
        let middle = acted(1, DVec3::new(1.5, 0.0, 0.0));
        assert!((middle - 1.5 / 7.0).abs() < 0.005 * middle, "{middle}");
        assert_eq!(acted(3, DVec3::new(1.5, 1.0, 0.0)), 0.0);
    }

    #[test]
    fn forces_are_one_number_or_many() {
        let text = "along = [[0, 0, 0]]\nradius = 1\nspeed = 0.1\n";
        let read = |force: &str| toml::from_str::<Push>(&format!("{text}{force}"));
        assert_eq!(read("").unwrap().force, Numbers::default());
        assert_eq!(read("force = -2").unwrap().force, Numbers(vec![Finite(-2.0)]));
        assert_eq!(read("force = [1, 2.5]").unwrap().force.0.len(), 2);
        for bad in ["force = nan", "force = 'hard'", "force = [[1]]"] {
            assert!(read(bad).unwrap_err().to_string().contains("line 4"), "{bad}");
        }
    }
}
