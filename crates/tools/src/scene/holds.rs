//! Constraints of a scene on its region.

use bspline::{Field, HierarchicalSpline, Real};
use dynamics::constraints::{Constraint, Hold as How, On, curve};

use super::error::{SimulateError, wrong};
use super::place::Samples;
use super::script::{Hold, Scene};

/// All constraints of a scene, and which of them hold.
#[derive(Clone, Debug)]
pub struct Holds {
    all: Vec<(Hold, Vec<Constraint>)>,
    active: Vec<bool>,
}

impl Holds {
    /// The constraints of `scene` on `field`, none of them holding yet. `cell` is the least edge of a cell.
    pub fn new<T: Real>(
        scene: &Scene,
        field: &HierarchicalSpline<T>,
        iso: Option<f64>,
        samples: &Samples,
        cell: f64,
    ) -> Result<Self, SimulateError> {
        let all = scene.constraint.iter().enumerate().map(|(i, hold)| {
            let name = hold.name.clone().unwrap_or_else(|| format!("{}", i + 1));
            let place = |key: &str| format!("[[constraint]] {name}{key}");
            hold.when.check().map_err(|e| wrong(place(" when"), e))?;
            let Some(density) = hold.density.map(|d| d.0).or(iso) else {
                return Err(wrong(
                    place(" density"),
                    "is missing, and the field names no surface; write density here or iso above all tables",
                ));
            };
            if let Some(p) = hold.along.iter().find(|p| !samples.contains(p.0)) {
                return Err(wrong(
                    place(" along"),
                    format!("{} lies outside the region; move it, or enlarge the region", p.0),
                ));
            }
            let how = hold.spring.map_or(How::Hard, |k| How::Spring(k.0));
            let rows = match &hold.along[..] {
                [] => {
                    return Err(wrong(
                        place(" along"),
                        "has no points; give one, or several for a curve",
                    ));
                }
                [p] => vec![Constraint {
                    label: name.clone(),
                    on: On::Point {
                        at: samples.local(p.0),
                        field: field.value(p.0),
                    },
                    density,
                    hold: how,
                }],
                points => {
                    let line: Vec<[f64; 3]> = points.iter().map(|p| samples.local(p.0)).collect();
                    let spacing = hold.spacing.map_or(0.5 * cell, |s| s.0);
                    curve(&name, &line, spacing, density, how, |at| {
                        field.value(samples.world(at))
                    })
                    .map_err(|e| wrong(place(""), e))?
                }
            };
            Ok((hold.clone(), rows))
        });
        let all = all.collect::<Result<Vec<_>, SimulateError>>()?;
        Ok(Self {
            active: vec![false; all.len()],
            all,
        })
    }

    /// The constraints that hold from `t` on for `dt`, if they are not those that held before.
    pub fn changed(&mut self, t: f64, dt: f64) -> Option<Vec<Constraint>> {
        let now: Vec<bool> = self
            .all
            .iter()
            .map(|(h, _)| h.when.strength(t, dt) > 0.0)
            .collect();
        if now == self.active {
            return None;
        }
        let held = self.all.iter().zip(&now).filter(|(_, on)| **on);
        let list = held.flat_map(|((_, rows), _)| rows.iter().cloned()).collect();
        self.active = now;
        Some(list)
    }
}
