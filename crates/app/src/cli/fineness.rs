//! How fine a mesh is to be, and the search for the octree that makes it so.

use std::ops::ControlFlow;

use bspline::polygonize::{
    AdaptiveMesh, AdaptiveMesher, AdaptiveOptions, AdaptiveReport, Mesh, PolygonizeError,
};
use bspline::{Field, Frame};
use fitting::Cancel;
use formats::field::SourceKind;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::failure::{Failure, Outcome};
use super::field::OpenField;
use super::progress::Bar;
use super::quantity::{Tolerance, human_count, human_number};

/// What bounds the size of the triangles.
#[derive(Clone, Copy, Debug)]
pub enum Fineness {
    /// Half the tolerance of the fit.
    OfTheFit,
    /// A chord error.
    Error(Tolerance),
    /// A number of triangles.
    Triangles(usize),
}

/// Chord error that a cell is divided at over the one that 95 % of the settled triangles keep: 3.4 to 5 on scans and
/// phantoms.
const SPARE: f64 = 3.6;
/// Share of the triangles asked for that is aimed at.
const AIM: f64 = 0.93;
/// Least share of the triangles asked for.
const LEAST: f64 = 0.8;
/// Trials until the best found is taken.
const TRIALS: usize = 12;
/// Triangles whose chord error is measured; of larger meshes as many, evenly spread.
const MEASURED: usize = 1 << 14;

/// A field being meshed as finely as it needs.
pub struct Adaptive<'a> {
    mesher: AdaptiveMesher<'a>,
    field: &'a dyn Field,
    iso: f64,
    frame: Frame,
    cancel: &'a Cancel,
    bar: &'a Bar,
}

/// A mesh with what is to be told of it.
pub struct Meshed {
    pub mesh: Mesh,
    pub report: AdaptiveReport,
    /// Chord error that 95 % of the triangles keep.
    pub error: f64,
}

impl<'a> Adaptive<'a> {
    /// Prepares the surface `{ f = iso }` of an open field.
    pub fn new(
        open: &'a OpenField,
        iso: f64,
        capped: bool,
        fineness: Fineness,
        cancel: &'a Cancel,
        bar: &'a Bar,
    ) -> Outcome<Self> {
        let lattice = open.lattice();
        // Larger cells than the lattice's own, where they are whole: the fewest triangles are few.
        let (mut cells, mut above) = (lattice.cells, 0);
        while cells.iter().all(|n| n % 2 == 0 && *n >= 8) {
            cells = cells.map(|n| n / 2);
            above += 1;
        }
        let frame = Frame {
            world_from_grid: lattice.world_from_lattice
                * DAffine3::from_scale(DVec3::splat((1u64 << above) as f64)),
            cells,
        };
        let finest = open.level_count() - 1 + above;
        // Voxels lie no closer than the finest knots; a cloud's surface bends within their intervals.
        let beyond = match (open.source(), fineness) {
            (SourceKind::Volume, Fineness::OfTheFit) => 0,
            _ => 2,
        };
        let longest = cells.into_iter().max().unwrap_or(1);
        let options = AdaptiveOptions {
            iso,
            open: !capped,
            depth: (finest + beyond).min(AdaptiveOptions::most_depth(longest)),
            detection: finest + 1,
            ..AdaptiveOptions::default()
        };
        let mesher = AdaptiveMesher::new(open.field(), &frame, &options, &mut watch(cancel, bar, 0.0, 0.1));
        Ok(Self {
            mesher: mesher.map_err(failed)?,
            field: open.field(),
            iso,
            frame,
            cancel,
            bar,
        })
    }

    /// Makes the mesh.
    pub fn mesh(&mut self, open: &OpenField, fineness: Fineness, notes: &mut Vec<String>) -> Outcome<Meshed> {
        let diagonal = self
            .frame
            .world_box([0; 3], self.frame.cells.map(i64::from))
            .size()
            .length();
        match fineness {
            Fineness::OfTheFit => {
                let tolerance = open.report().tolerance;
                let length = match open.source() {
                    SourceKind::Volume => tolerance / open.slope(),
                    _ => tolerance,
                };
                let wanted = if length > 0.0 {
                    0.5 * length
                } else {
                    1e-4 * diagonal
                };
                self.within(wanted, notes)
            }
            Fineness::Error(tolerance) => {
                // Per cent are of the solid's own diagonal, which a coarse mesh tells well enough.
                let around = self.at(1e-3 * diagonal, false)?.mesh.bounding_box();
                let size = around.map_or(diagonal, |b| b.size().length());
                let wanted = tolerance.length(size, open.unit()).map_err(Failure::usage)?;
                self.within(wanted, notes)
            }
            Fineness::Triangles(most) => self.with_triangles(most, 1e-4 * diagonal, notes),
        }
    }

    /// The mesh whose cells keep a chord error.
    fn at(&mut self, error: f64, settled: bool) -> Outcome<Meshed> {
        let (cancel, bar) = (self.cancel, self.bar);
        let made = self
            .mesher
            .mesh(error, settled, &mut watch(cancel, bar, 0.1, 0.95));
        let (AdaptiveMesh { mesh, .. }, report) = made.map_err(failed)?;
        let error = self.chord_error(&mesh);
        Ok(Meshed { mesh, report, error })
    }

    /// The coarsest mesh found of which 95 % keep the error `wanted`.
    fn within(&mut self, wanted: f64, notes: &mut Vec<String>) -> Outcome<Meshed> {
        let mut of_cells = SPARE * wanted;
        let mut best: Option<Meshed> = None;
        for _ in 0..TRIALS {
            let trial = self.at(of_cells, true)?;
            if trial.mesh.triangles.is_empty() {
                return Ok(trial);
            }
            let error = trial.error;
            let at_limit = trial.report.leaves_at_limit > 0 && error > wanted;
            let met = error <= wanted;
            let coarser = met
                && best
                    .as_ref()
                    .is_none_or(|b| trial.mesh.triangles.len() < b.mesh.triangles.len());
            let had = best.is_some();
            if coarser || (at_limit && best.is_none()) {
                best = Some(trial);
            }
            // Within a third of what will do, or as fine as the cells may be, or finer than one that did.
            if (met && error > 0.66 * wanted) || (!met && had) {
                break;
            }
            // Errors of the cells and of the triangles rise together.
            let factor = (0.85 * wanted / error).clamp(0.1, 4.0);
            if at_limit && of_cells < 1e-3 * wanted {
                break;
            }
            of_cells *= factor;
        }
        let best = best.ok_or_else(|| {
            Failure::limit("the tolerance asked for needs more cells than can be meshed; raise --tolerance")
        })?;
        notes.push(format!(
            "95 % of the triangles lie within {} of the surface, at their centres and sides",
            human_number(best.error)
        ));
        if best.error > wanted {
            notes.push(format!(
                "{} cells are as small as the knots allow and still coarser than asked; {} was wanted",
                human_count(best.report.leaves_at_limit as usize),
                human_number(wanted)
            ));
        }
        Ok(best)
    }

    /// The finest mesh found of no more than `most` triangles.
    fn with_triangles(&mut self, most: usize, start: f64, notes: &mut Vec<String>) -> Outcome<Meshed> {
        let (cancel, bar) = (self.cancel, self.bar);
        let target = AIM * most as f64;
        // Errors with too many triangles and with few enough.
        let (mut fine, mut coarse): (Option<f64>, Option<f64>) = (None, None);
        let (mut error, mut last) = (start, None);
        for _ in 0..3 * TRIALS {
            let count = self
                .mesher
                .estimate(error, &mut watch(cancel, bar, 0.1, 0.5))
                .map_err(failed)? as f64;
            if count == 0.0
                || (LEAST.max(AIM - 0.05) * most as f64..=(AIM + 0.04) * most as f64).contains(&count)
            {
                coarse = Some(error);
                break;
            }
            if count > target {
                fine = Some(error);
            } else {
                coarse = Some(error);
                // Nothing is left to divide.
                if last == Some(count) && fine.is_none() {
                    break;
                }
            }
            last = Some(count);
            error = match (fine, coarse) {
                (Some(f), Some(c)) if c / f < 1.001 => break,
                (Some(f), Some(c)) => {
                    (error * (count / target)).clamp(f * (c / f).powf(0.1), f * (c / f).powf(0.9))
                }
                _ => error * (count / target).clamp(0.2, 8.0),
            };
        }
        let mut error = coarse.or(fine).unwrap_or(start);
        for _ in 0..TRIALS {
            let made = self.at(error, true)?;
            let count = made.mesh.triangles.len();
            if count <= most {
                if (count as f64) < LEAST * most as f64 && count > 0 {
                    notes.push(format!(
                        "the surface takes {} triangles, not {}: smaller cells would show no more of it",
                        human_count(count),
                        human_count(most)
                    ));
                }
                notes.push(format!(
                    "95 % of the triangles lie within {} of the surface, at their centres and sides",
                    human_number(made.error)
                ));
                return Ok(made);
            }
            error *= (1.1 * count as f64 / most as f64).clamp(1.05, 8.0);
        }
        Err(Failure::limit(format!(
            "the surface has no mesh of {} triangles or fewer that keeps all of its parts; raise --triangles",
            human_count(most)
        )))
    }

    /// 95th percentile over the triangles of the largest distance to the surface, to first order, of their centres and
    /// the middles of their sides. What lies on the frame's box belongs to the cut and does not count.
    fn chord_error(&self, mesh: &Mesh) -> f64 {
        let grid = self.frame.world_from_grid.inverse();
        let end = DVec3::from_array(self.frame.cells.map(f64::from));
        let step = mesh.triangles.len().div_ceil(MEASURED).max(1);
        let mut errors: Vec<f64> = (0..mesh.triangles.len().div_ceil(step))
            .into_par_iter()
            .with_min_len(256)
            .filter_map(|n| {
                let [a, b, c] = mesh.corners(n * step);
                let points = [(a + b + c) / 3.0, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
                let q = grid.transform_point3(points[0]);
                if q.min(end - q).min_element() < 1e-6 {
                    return None;
                }
                let mut answers = [(0.0, DVec3::ZERO); 4];
                self.field.values_gradients(&points, &mut answers);
                let off = answers.map(|(f, g)| (f - self.iso).abs() / g.length());
                Some(off.into_iter().fold(0.0, f64::max))
            })
            .collect();
        if errors.is_empty() {
            return 0.0;
        }
        let rank = (errors.len() * 95 / 100).min(errors.len() - 1);
        *errors.select_nth_unstable_by(rank, f64::total_cmp).1
    }
}

/// Shows progress between two shares of the whole and listens for the user's wish to stop.
fn watch<'a>(
    cancel: &'a Cancel,
    bar: &'a Bar,
    from: f64,
    to: f64,
) -> impl FnMut(f64) -> ControlFlow<()> + 'a {
    move |fraction| {
        bar.show("meshing", from + (to - from) * fraction);
        if cancel.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// What a failure of the mesher means to the user.
pub fn failed(e: PolygonizeError) -> Failure {
    match e {
        PolygonizeError::Cancelled => fitting::FitError::Cancelled.into(),
        PolygonizeError::TooManyBlocks { .. } | PolygonizeError::TooManyVertices { .. } => Failure::limit(
            format!("{e}: lower --resolution or --triangles, or raise --tolerance"),
        ),
        PolygonizeError::Cells { .. } => Failure::usage(format!("{e}: lower --resolution")),
        _ => Failure::input(e),
    }
}
