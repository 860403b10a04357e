//! Solids carried along curves.

use std::sync::Arc;

use bspline::{Aabb, Field, HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::FieldFitReport;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::chain::Chain;
use super::shape::Shape;
use super::swept::Pose;
use super::write::{Fineness, Writer};
use super::{Combined, GeometricError, Operation, rotation_of};
use crate::curve::Along;
use crate::limits::Limits;
use crate::number::{NonNegative, Point, Positive};

/// Cosine of the turn from which on a curve has a corner, at which the solid turns on the spot.
const CORNER: f64 = 0.9;
/// Share of the tolerance by which chords may be off the curve.
const CHORD: f64 = 0.25;
/// Legs at most.
const MOST: usize = 1 << 14;

/// A solid carried along a free curve \[Hua04 §6.1\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Whether what it runs through is taken out or put on.
    pub operation: Operation,
    /// The solid.
    pub shape: Shape,
    /// Where its centre goes.
    pub along: Along,
    /// How it is turned at the start: the axis of the turn, as long as its angle in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<Point>,
    /// Whether it turns with the curve. If not it keeps its direction.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub follow: bool,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default)]
    pub blend: NonNegative,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<u8>,
}

impl Sweep {
    /// What the tool leaves of a field whose surface lies at `iso`, and how close it is.
    ///
    /// A solid that follows the curve is carried without a turn about it (by a rotation-minimizing frame \[Bishop75\]); on a closed
    /// curve what is missing to its first pose is made up for evenly along the way.
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
        let writer = Writer { field, iso, limits };
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: Some(self.shape.feature()),
            densities: None,
        };
        let lines = self.along.lines(&field.lattice().world_box());
        let chord = CHORD * writer.tolerance(&fineness);
        let start = rotation_of(self.turn.map_or(DVec3::ZERO, |t| t.0)).map_err(GeometricError::Shape)?;
        let mut solids: Vec<Arc<dyn Field>> = Vec::new();
        let mut reach: Option<Aabb> = None;
        for line in lines.map_err(GeometricError::Shape)? {
            let line = chords(&line, chord);
            if line.len() > MOST {
                return Err(GeometricError::Shape(format!(
                    "the curve has {} pieces at this tolerance, and {MOST} are allowed; give a larger tolerance, or sweep a part \
                     after the other",
                    line.len()
                )));
            }
            let poses = match self.follow {
                true => framed(&line, start),
                false => line.iter().map(|at| Pose { at: *at, turn: start }).collect(),
            };
            let (legs, size) = self.shape.legs(&poses).map_err(GeometricError::Shape)?;
            solids.push(Arc::new(Chain::new(legs, size)));
            let own = Aabb::about(line).map(|b| b.widened(size));
            reach = reach.into_iter().chain(own).reduce(Aabb::hull);
        }
        let combined = Combined {
            operation: self.operation,
            solids,
            reach: reach.expect("a curve has a place"),
            blend: self.blend.0,
        };
        combined.written(&writer, &fineness, control)
    }
}

/// The fewest points of a line, about, between which it is nowhere farther than `off` from the chord \[Douglas73\].
fn chords(line: &[DVec3], off: f64) -> Vec<DVec3> {
    let mut line = line.to_vec();
    line.dedup();
    let mut kept = vec![false; line.len()];
    let mut open = vec![(0, line.len() - 1)];
    while let Some((a, b)) = open.pop() {
        (kept[a], kept[b]) = (true, true);
        let way = line[b] - line[a];
        let away = |p: DVec3| {
            let share = (p - line[a]).dot(way) / way.length_squared().max(f64::MIN_POSITIVE);
            p.distance(line[a] + share.clamp(0.0, 1.0) * way)
        };
        let far = (a + 1..b).map(|i| (away(line[i]), i));
        let far = far.fold((0.0, a), |far, now| if now.0 > far.0 { now } else { far });
        if far.0 > off {
            open.extend([(far.1, b), (a, far.1)]);
        }
    }
    let kept = line.iter().zip(kept).filter(|(_, kept)| *kept);
    kept.map(|(p, _)| *p).collect()
}

/// Poses along a line that turn with it and not about it; `start` is the turn of the first.
fn framed(line: &[DVec3], start: DQuat) -> Vec<Pose> {
    let ways: Vec<DVec3> = line.windows(2).map(|w| (w[1] - w[0]).normalize()).collect();
    let (Some(first), Some(last)) = (ways.first(), ways.last()) else {
        return vec![Pose {
            at: line[0],
            turn: start,
        }];
    };
    let is_closed = line.len() > 3 && line[0] == line[line.len() - 1];
    // Directions of the solid: at corners that of the leg before, then that of the leg behind.
    let mut stops: Vec<(DVec3, DVec3)> = Vec::new();
    let mut stop = |at: DVec3, before: DVec3, behind: DVec3| match before.dot(behind) < CORNER {
        true => stops.extend([(at, before), (at, behind)]),
        false => stops.push((at, (before + behind).normalize())),
    };
    let is_round = is_closed && first.dot(*last) >= CORNER;
    let end = (*first + *last).normalize_or_zero();
    let [begin, end] = if is_round { [end; 2] } else { [*first, *last] };
    stop(line[0], begin, begin);
    for (i, way) in ways.windows(2).enumerate() {
        stop(line[i + 1], way[0], way[1]);
    }
    stop(line[line.len() - 1], end, end);
    if is_closed && !is_round {
        stops.push((line[0], *first));
    }
    let mut turn = DQuat::IDENTITY;
    let mut turns = vec![turn];
    for pair in stops.windows(2) {
        turn = DQuat::from_rotation_arc(pair[0].1, pair[1].1) * turn;
        turns.push(turn);
    }
    if is_closed {
        // About the direction at the end, which is that of the start.
        let missing = turn.inverse();
        let sine = missing.xyz().dot(stops[stops.len() - 1].1);
        let angle = 2.0 * libm::atan2(sine, missing.w);
        let angle = angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round();
        let mut gone = vec![0.0];
        gone.extend(stops.windows(2).map(|pair| pair[0].0.distance(pair[1].0)));
        for i in 1..gone.len() {
            gone[i] += gone[i - 1];
        }
        let whole = gone[gone.len() - 1];
        for ((turn, gone), (_, way)) in turns.iter_mut().zip(&gone).zip(&stops) {
            let half = 0.5 * angle * gone / whole;
            let about = *way * libm::sin(half);
            *turn = DQuat::from_xyzw(about.x, about.y, about.z, libm::cos(half)) * *turn;
        }
    }
    let poses = stops.iter().zip(turns);
    poses
        .map(|((at, _), turn)| Pose {
            at: *at,
            turn: (turn * start).normalize(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Round a closed curve in space the frame comes back to its first pose, and no pose is far from the next.
    #[test]
    fn frames_of_closed_curves_close() {
        let at = |i: usize| {
            let t = std::f64::consts::TAU * i as f64 / 400.0;
            let (r, z) = (3.0 + libm::cos(3.0 * t), libm::sin(2.0 * t));
            DVec3::new(r * libm::cos(t), r * libm::sin(t), z)
        };
        let mut line: Vec<DVec3> = (0..400).map(at).collect();
        line.push(line[0]);
        let poses = framed(&line, DQuat::IDENTITY);
        let [first, last] = [&poses[0], &poses[poses.len() - 1]].map(|pose| pose.turn);
        assert!(first.dot(last).abs() > 1.0 - 1e-12, "{first} {last}");
        for (pose, pair) in poses.iter().zip(poses.windows(2).zip(line.windows(2))) {
            let (pair, ways) = pair;
            let by = pair[1].turn * pair[0].turn.inverse();
            assert!(by.w.abs() > 0.999, "{by}");
            // The direction at the start goes along with the curve.
            let ahead = (pose.turn * poses[0].turn.inverse())
                * (line[1] - line[0] + line[400] - line[399]).normalize();
            assert!(ahead.dot((ways[1] - ways[0]).normalize()) > 0.995);
        }
    }

    /// Without a turn about itself: along a plane curve the frame only turns in the plane.
    #[test]
    fn frames_do_not_turn_about_the_curve() {
        let corner = [DVec3::ZERO, DVec3::X * 3.0, DVec3::new(3.0, 4.0, 0.0)];
        let poses = framed(&corner, DQuat::IDENTITY);
        assert_eq!(poses.len(), 4, "a corner is turned on the spot");
        assert!(
            poses
                .iter()
                .all(|pose| (pose.turn * DVec3::Z - DVec3::Z).length() < 1e-12)
        );
        assert!((poses[3].turn * DVec3::X - DVec3::Y).length() < 1e-12);
        assert_eq!(poses[1].at, poses[2].at);
    }

    #[test]
    fn chords_stay_near_the_line() {
        let line: Vec<DVec3> = (0..=1000)
            .map(|i| {
                let t = std::f64::consts::TAU * f64::from(i) / 1000.0;
                DVec3::new(libm::cos(t), libm::sin(t), 0.0)
            })
            .collect();
        let few = chords(&line, 1e-3);
        assert!(few.len() > 50 && few.len() < 150, "{}", few.len());
        assert!(
            few.windows(2)
                .all(|w| (0.5 * (w[0] + w[1])).length() > 1.0 - 1.1e-3)
        );
    }
}
