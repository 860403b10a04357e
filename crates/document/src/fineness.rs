//! How fine a mesh is to be, and the search for the octree that makes it so.

use std::ops::ControlFlow;

use bspline::hierarchical::Lattice;
use bspline::polygonize::{
    AdaptiveMesh, AdaptiveMesher, AdaptiveOptions, AdaptiveReport, Mesh, PolygonizeError,
};
use bspline::{Field, Frame};
use fitting::FitReport;
use formats::field::{FieldMeta, SourceKind};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::{human_count, human_number};

/// What bounds the size of the triangles.
#[derive(Clone, Copy, Debug)]
pub enum Fineness {
    /// Half the tolerance of the fit; less where that is the noise of the samples.
    OfTheFit,
    /// A chord error, a world length.
    Error(f64),
    /// A chord error, as a share of the solid's diagonal.
    Share(f64),
    /// A number of triangles.
    Triangles(usize),
}

/// Chord error that a cell is divided at over the one that 95 % of the centres and sides of settled triangles keep.
const SPARE: f64 = 3.6;
/// Distance of a fit from the surface over the noise of its samples, which is its tolerance then: it averages them.
const OF_NOISE: f64 = 0.125;
/// The same of a fit to a mesh, which leaves less of its tolerance to be spent again: bunny within 1.0 u both ways.
const OF_MESH: f64 = 0.75;
/// The same over what 95 % of the surface keep, where that is more: triangles half as far off add a tenth to it.
const OF_REACHED: f64 = 0.9;
/// Share of the triangles asked for that is aimed at.
const AIM: f64 = 0.96;
/// Least share of the triangles asked for.
const LEAST: f64 = 0.8;
/// Trials until the best found is taken.
const TRIALS: usize = 12;
/// Factor by which a trial lies between the errors of cells that kept what is wanted and that did not; nearer ones are not told apart.
const BETWEEN: f64 = 1.15;
/// Triangles whose chord error is measured; of larger meshes as many, evenly spread.
const MEASURED: usize = 1 << 12;

/// A surface to be meshed, and what is known of its field.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// The field.
    pub field: &'a dyn Field,
    /// Its box and coarsest cells.
    pub lattice: &'a Lattice,
    /// Levels of its cells.
    pub levels: usize,
    /// Its fall per world length at the surface.
    pub slope: f64,
    /// What it was fitted to, with the provenance.
    pub meta: &'a FieldMeta,
    /// What the fit said of itself.
    pub report: &'a FitReport,
    /// The surface is `{ f = iso }`, the solid `{ f > iso }`.
    pub iso: f64,
    /// Leaves the surface open where it meets the box, instead of closing it.
    pub open: bool,
}

/// Why there is no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// The mesher says so.
    #[error(transparent)]
    Mesher(#[from] PolygonizeError),
    /// The chord error is too small.
    #[error("the tolerance asked for needs more cells than can be meshed; raise the tolerance")]
    Tolerance,
    /// The triangles are too few.
    #[error("the surface has no mesh of {} triangles or fewer that keeps all of its parts; allow more triangles", human_count(*.0))]
    Triangles(usize),
}

impl Surface<'_> {
    /// Meshes the surface. `watch` is told the share of the work that is done, and may break it off; what is to be told of the
    /// mesh goes to `notes`.
    ///
    /// # Errors
    /// Any [`SurfaceError`].
    pub fn mesh(
        &self,
        fineness: Fineness,
        notes: &mut Vec<String>,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Meshed, SurfaceError> {
        Search::new(self, fineness, watch)?.mesh(fineness, notes)
    }

    /// The grid of so many cells over the lattice's box.
    fn frame(&self, cells: [u32; 3]) -> Frame {
        let step = self.lattice.extent() / DVec3::from_array(cells.map(f64::from));
        Frame {
            world_from_grid: self.lattice.world_from_lattice * DAffine3::from_scale(step),
            cells,
        }
    }
}

/// Whether a field says that it was fitted to a mesh.
pub fn is_of_mesh(meta: &FieldMeta) -> bool {
    let stored: serde_json::Value = serde_json::from_str(&meta.provenance).unwrap_or_default();
    stored["input_kind"] == "mesh"
}

/// A surface being meshed as finely as it needs.
struct Search<'a> {
    mesher: AdaptiveMesher<'a>,
    surface: &'a Surface<'a>,
    options: AdaptiveOptions,
    frame: Frame,
    watch: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
}

/// A mesh with what is to be told of it.
#[derive(Clone, Debug)]
pub struct Meshed {
    /// The triangles.
    pub mesh: Mesh,
    /// What the mesher met.
    pub report: AdaptiveReport,
    /// Chord error that 95 % of the centres and sides of the triangles keep.
    pub error: f64,
}

impl<'a> Search<'a> {
    fn new(
        surface: &'a Surface<'a>,
        fineness: Fineness,
        watch: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, SurfaceError> {
        let mut cells = surface.lattice.cells;
        // Larger cells than the lattice's own, where they are whole: the fewest triangles are few.
        let mut above = 0;
        while cells.iter().all(|n| n % 2 == 0 && *n >= 8) {
            cells = cells.map(|n| n / 2);
            above += 1;
        }
        // Voxels lie no closer than the finest knots; a cloud's surface bends within their intervals.
        let beyond = match (surface.meta.source, fineness) {
            (SourceKind::Volume, Fineness::OfTheFit) => 0,
            _ => 2,
        };
        let finest = surface.levels - 1 + above;
        let longest = cells.into_iter().max().unwrap_or(1);
        let options = AdaptiveOptions {
            iso: surface.iso,
            open: surface.open,
            // Room for cells of half the size.
            depth: (finest + beyond).min(AdaptiveOptions::most_depth(2 * longest)),
            detection: finest + 1,
            // Their first mesh is nearly always the last.
            frugal: !matches!(fineness, Fineness::Error(_) | Fineness::Share(_)),
            ..AdaptiveOptions::default()
        };
        let frame = surface.frame(cells);
        let mesher = AdaptiveMesher::new(surface.field, &frame, &options, &mut part(watch, 0.0, 0.1))?;
        Ok(Self {
            mesher,
            surface,
            options,
            frame,
            watch,
        })
    }

    /// Starts again with the coarsest cells `finer` times as fine: what bends evenly all over needs cells of one size,
    /// and halving alone would leave a factor of four between the numbers of triangles.
    fn rescale(&mut self, finer: f64) -> Result<(), SurfaceError> {
        let cells = self
            .frame
            .cells
            .map(|n| ((f64::from(n) * finer).round() as u32).clamp(1, 2 * n));
        self.frame = self.surface.frame(cells);
        let progress = &mut part(self.watch, 0.1, 0.2);
        self.mesher = AdaptiveMesher::new(self.surface.field, &self.frame, &self.options, progress)?;
        Ok(())
    }

    fn mesh(&mut self, fineness: Fineness, notes: &mut Vec<String>) -> Result<Meshed, SurfaceError> {
        let surface = self.surface;
        let diagonal = self
            .frame
            .world_box([0; 3], self.frame.cells.map(i64::from))
            .size()
            .length();
        match fineness {
            Fineness::OfTheFit => {
                let tolerance = surface.report.tolerance;
                let length = match surface.meta.source {
                    SourceKind::Volume => tolerance / surface.slope,
                    SourceKind::Cloud if surface.report.noise.is_some() => OF_NOISE * tolerance,
                    _ if is_of_mesh(surface.meta) => of_mesh(surface.report, notes),
                    _ => tolerance,
                };
                let wanted = if length > 0.0 {
                    0.5 * length
                } else {
                    1e-4 * diagonal
                };
                self.within(wanted, true, notes)
            }
            Fineness::Error(wanted) => self.within(wanted, false, notes),
            Fineness::Share(share) => {
                // A coarse mesh tells the solid's diagonal well enough.
                let around = self.at(1e-3 * diagonal, false)?.mesh.bounding_box();
                let size = around.map_or(diagonal, |b| b.size().length());
                self.within(share * size, false, notes)
            }
            Fineness::Triangles(most) => self.with_triangles(most, 1e-4 * diagonal, notes),
        }
    }

    /// The mesh whose cells keep a chord error.
    fn at(&mut self, error: f64, settled: bool) -> Result<Meshed, SurfaceError> {
        let made = self.mesher.mesh(error, settled, &mut part(self.watch, 0.1, 0.95));
        let (AdaptiveMesh { mesh, .. }, report) = made?;
        let error = self.chord_error(&mesh);
        Ok(Meshed { mesh, report, error })
    }

    /// The coarsest mesh found of which 95 % keep the error `wanted`; with `any`, the first.
    fn within(&mut self, wanted: f64, any: bool, notes: &mut Vec<String>) -> Result<Meshed, SurfaceError> {
        let mut of_cells = SPARE * wanted;
        let mut best: Option<Meshed> = None;
        // Errors of cells that kept what is wanted and that did not.
        let (mut met, mut missed) = (0.0, f64::INFINITY);
        let mut is_rescaled = false;
        for _ in 0..TRIALS {
            let trial = self.at(of_cells, true)?;
            let (error, count) = (trial.error, trial.mesh.triangles.len());
            if count == 0 {
                return Ok(trial);
            }
            let is_met = error <= wanted;
            // More than 5 % of the cells are as small as they may be and too coarse: smaller ones elsewhere do not help.
            let report = &trial.report;
            let exhausted = !is_met && 20 * report.leaves_at_limit > report.crossed_leaves
                || report.leaves_at_limit > 0 && of_cells < 1e-2 * wanted;
            let coarser = best.as_ref().is_none_or(|b| count < b.mesh.triangles.len());
            if (is_met && coarser) || (exhausted && best.is_none()) {
                best = Some(trial);
            }
            if (is_met && (any || error > 0.66 * wanted)) || exhausted {
                break;
            }
            if is_met {
                met = of_cells;
            } else {
                missed = of_cells;
            }
            // Errors of the cells and of the triangles rise together.
            let next = of_cells * (0.85 * wanted / error).clamp(0.1, 4.0);
            if met > 0.0 && met * BETWEEN > missed / BETWEEN {
                let kept = best.as_ref().map_or(wanted, |b| b.error);
                if is_rescaled || kept > 0.66 * wanted {
                    break;
                }
                self.rescale((kept / (0.8 * wanted)).sqrt())?;
                is_rescaled = true;
                (met, missed, of_cells) = (0.0, f64::INFINITY, met);
                continue;
            }
            of_cells = next.clamp(met * BETWEEN, missed / BETWEEN);
        }
        let best = best.ok_or(SurfaceError::Tolerance)?;
        notes.push(format!(
            "95 % of the centres and sides of the triangles lie within {} of the surface",
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
    fn with_triangles(
        &mut self,
        most: usize,
        start: f64,
        notes: &mut Vec<String>,
    ) -> Result<Meshed, SurfaceError> {
        let target = AIM * most as f64;
        // Errors with too many triangles, and with few enough and how many.
        let (mut fine, mut coarse): (Option<f64>, Option<(f64, f64)>) = (None, None);
        let (mut error, mut last) = (start, None);
        let mut is_rescaled = false;
        for _ in 0..4 * TRIALS {
            let count = self.mesher.estimate(error, &mut part(self.watch, 0.1, 0.5))? as f64;
            let share = count / most as f64;
            if count == 0.0 || (AIM - 0.05..=AIM + 0.03).contains(&share) {
                coarse = Some((error, count));
                break;
            }
            if count > target {
                fine = Some(error);
            } else {
                coarse = Some((error, count));
                // Nothing is left to divide.
                if last == Some(count) && fine.is_none() {
                    break;
                }
            }
            last = Some(count);
            error = match (fine, coarse) {
                (Some(f), Some((c, few))) if c / f < 1.001 => {
                    if is_rescaled || few > LEAST * most as f64 {
                        break;
                    }
                    self.rescale((target / few).sqrt())?;
                    is_rescaled = true;
                    (fine, coarse, last) = (None, None, None);
                    c
                }
                (Some(f), Some((c, _))) => {
                    (error * (count / target)).clamp(f * (c / f).powf(0.1), f * (c / f).powf(0.9))
                }
                _ => error * (count / target).clamp(0.2, 8.0),
            };
        }
        let coarse = coarse.map(|c| c.0);
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
                    "95 % of the centres and sides of the triangles lie within {} of the surface",
                    human_number(made.error)
                ));
                return Ok(made);
            }
            error *= (1.1 * count as f64 / most as f64).clamp(1.05, 8.0);
        }
        Err(SurfaceError::Triangles(most))
    }

    /// 95th percentile of the distances to the surface, by two steps of Newton's method, of the centres of the triangles
    /// and the middles of their sides. What lies on the frame's box belongs to the cut and does not count.
    fn chord_error(&self, mesh: &Mesh) -> f64 {
        let grid = self.frame.world_from_grid.inverse();
        let end = DVec3::from_array(self.frame.cells.map(f64::from));
        let step = mesh.triangles.len().div_ceil(MEASURED).max(1);
        let (field, iso) = (self.surface.field, self.options.iso);
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
                let (mut feet, mut answers) = (points, [(0.0, DVec3::ZERO); 4]);
                // One step says too little where the triangles are as large as the bends of the field.
                for _ in 0..2 {
                    field.values_gradients(&feet, &mut answers);
                    for (foot, (f, g)) in feet.iter_mut().zip(answers) {
                        *foot += g * ((iso - f) / g.length_squared());
                    }
                }
                Some(std::array::from_fn::<_, 4, _>(|k| points[k].distance(feet[k])))
            })
            .flatten_iter()
            .collect();
        if errors.is_empty() {
            return 0.0;
        }
        let rank = (errors.len() * 95 / 100).min(errors.len() - 1);
        *errors.select_nth_unstable_by(rank, f64::total_cmp).1
    }
}

/// Twice the chord error for a fit to a mesh. Where its coefficients were spent before the tolerance was met, triangles made
/// for that would show its ripples and no more of the mesh.
fn of_mesh(report: &FitReport, notes: &mut Vec<String>) -> f64 {
    if report.p95 > report.tolerance {
        notes.push(format!(
            "the fit is farther off than its tolerance, by {} at 95 % of the surface; triangles are made for that",
            human_number(report.p95)
        ));
    }
    (OF_MESH * report.tolerance).max(OF_REACHED * report.p95)
}

/// Tells `watch` of a part of the work, between two shares of the whole.
fn part(
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    from: f64,
    to: f64,
) -> impl FnMut(f64) -> ControlFlow<()> {
    move |fraction| watch(from + (to - from) * fraction)
}
