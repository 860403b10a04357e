//! The octree: each level corrects the one before where the signed distance is not met.

use bspline::{HierarchicalSpline, Real};
use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::Plan;
use super::base::{Base, KNOTS, base};
use super::conditions::{Around, Conditions, base_qualities, qualities};
use super::distance::MeshDistance;
use super::judge::{LeafCell, Quality, Verdict, verdict};
use super::probes::{Cell, Octants, Probe, around, center, child};
use super::summary::summary;
use super::thin::{Sheets, TooThin};
use crate::level::BASE_DEPTH;
use crate::level::assemble::{Level, assemble};
use crate::level::band::{Band, Coarser, active_count, count_bricks_near, key_of};
use crate::level::band_problem::{BandProblem, BandSample, Weights};
use crate::level::stencil::{Spot, gather};
use crate::points::cascade::level_bytes;
use crate::{Control, FitError, FitReport, SolverOutcome, StopReason};

/// Weight `β` of the gradient condition, in cells.
const BETA: f64 = 0.4;
/// Weight `μ` of the bending energy.
const BENDING: f64 = 1e-5;
/// Iterations of conjugate gradients, whatever residual they leave (5 to 11 % of the first): twelve, which leave 1 to 4 %,
/// lower no error.
const ITERATIONS: usize = 6;
/// How far coefficients are held round the active functions: all that the cells they reach read.
const REACH: u32 = 3;
/// A part of a cell is refined with it if the surface comes nearer to its centre than so many of its edges: those that
/// the surface only cuts a corner of (up to 0.87) cost a seventh more and gain nothing.
const TOUCH: f64 = 0.72;
/// Creases are left as they are once what they add to the mean square error of the whole surface is below the square
/// of so many tolerances.
const CREASE_SHARE: f64 = 0.25;
/// Coefficients that creases may have even where nothing else needs as many.
const CREASE_ROOM: usize = 200_000;

/// Bytes held at once with so many bricks and cells on a level.
pub(crate) fn bytes<T>(
    bricks: usize,
    cells: usize,
    settled: usize,
    triangles: usize,
    vertices: usize,
) -> u64 {
    let per_cell = size_of::<Cell>() + size_of::<Octants>() + 32 * size_of::<BandSample<T>>();
    let mesh = triangles * 600 + vertices * 64;
    let probes = settled * (size_of::<Probe>() + size_of::<BandSample<T>>());
    level_bytes::<T>(bricks, 0) + (cells * per_cell + probes + mesh) as u64 + (16 << 20)
}

/// State between levels.
struct Octree<'a> {
    mesh: &'a MeshDistance,
    plan: &'a Plan,
    /// Cells to refine on the level at hand.
    cells: Vec<Cell>,
    /// Conditions of leaves beside cells that were split.
    settled: Vec<Probe>,
    /// Corners of the surface.
    corners: Vec<Probe>,
    leaves: Vec<LeafCell>,
    /// How each level was solved.
    solves: Vec<SolverOutcome>,
    /// Points of the surface in leaves, leaf by leaf.
    feet: Vec<DVec3>,
    /// Coefficients on creases and elsewhere, about, and in all.
    on_creases: usize,
    elsewhere: usize,
    coefficients: usize,
    /// Sum over the creases left as they are of mean square error times area.
    left_at_creases: f64,
    too_thin: TooThin,
}

pub(crate) fn fit<T: Real>(
    mesh: &MeshDistance,
    plan: &Plan,
    triangles: usize,
    vertices: usize,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    control.step("fitting the coarse level", 0.1)?;
    let base = base(mesh);
    let mut tree = Octree {
        mesh,
        plan,
        cells: Vec::new(),
        settled: Vec::new(),
        corners: mesh.corners().map(Probe::corner).collect(),
        leaves: Vec::new(),
        solves: Vec::new(),
        feet: Vec::new(),
        on_creases: 0,
        elsewhere: 0,
        coefficients: base.grid.values.len(),
        left_at_creases: 0.0,
        too_thin: TooThin::default(),
    };
    let room = |bricks: usize, cells: usize, settled: usize, control: &Control| {
        control
            .reserve(bytes::<T>(bricks, cells, settled, triangles, vertices))
            .is_ok()
    };
    tree.judge_base(&base, |b, c, s| room(b, c, s, control));
    let mut levels: Vec<Level<T>> = Vec::new();
    let mut coarser: Option<Band<T>> = None;
    for depth in BASE_DEPTH + 1..=plan.max_depth {
        if tree.cells.is_empty() {
            break;
        }
        let share = 0.3f64.powi((plan.max_depth - depth) as i32);
        control.step("fitting finer levels", 0.2 + 0.7 * share)?;
        let below = coarser.as_ref().map_or(Coarser::Full(&base.grid), Coarser::Band);
        let (band, level) = tree.refine(depth, &below, |b, c, s| room(b, c, s, control));
        levels.push(level);
        coarser = Some(band);
    }
    control.step("measuring", 0.92)?;
    drop(coarser);
    let field = assemble(mesh.origin, mesh.scale, &base.grid, &levels);
    let mut report = summary(
        mesh,
        plan,
        &field,
        &tree.leaves,
        &tree.feet,
        &tree.too_thin,
        triangles,
    );
    report.smoothing = BENDING;
    report.told_solves(tree.solves);
    Ok((field, report))
}

/// Whether so many bricks, cells and conditions of leaves fit into the memory there is.
trait Room: Fn(usize, usize, usize) -> bool {}
impl<F: Fn(usize, usize, usize) -> bool> Room for F {}

impl Octree<'_> {
    /// Asks in the cells of the base level that the surface comes near, and marks their parts to be refined.
    fn judge_base(&mut self, base: &Base, room: impl Room) {
        let n = 1u32 << BASE_DEPTH;
        let h = 1.0 / f64::from(n);
        // Corner of a cell: its place and what was found there.
        let corner = |at: [u32; 3], c: usize| {
            let k: [usize; 3] = std::array::from_fn(|a| at[a] as usize + (c >> (2 - a) & 1));
            let place = DVec3::from_array(k.map(|k| k as f64)) * h;
            (
                place,
                &base.knots[((k[0] + 2) * KNOTS + k[1] + 2) * KNOTS + k[2] + 2],
            )
        };
        // A crease of the distance costs the base level less than a fifth of a cell, which is allowed farther out.
        let reach = self.plan.band + h;
        self.cells = (0..n.pow(3))
            .into_par_iter()
            .filter_map(|i| {
                let at = [i / (n * n), i / n % n, i % n];
                let nearest = (0..8)
                    .map(|c| corner(at, c))
                    .min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))?;
                (nearest.1.distance <= reach).then(|| Cell {
                    at,
                    center: self.mesh.at(center(at, BASE_DEPTH), Some(nearest)),
                    error_above: f32::INFINITY,
                })
            })
            .collect();
        let octants = self.ask(BASE_DEPTH);
        let m = base.grid.width();
        let field = |p: DVec3| {
            let at = super::probes::cell_of(p, BASE_DEPTH);
            let spot = Spot {
                start: (at[0] as usize * m + at[1] as usize) * m + at[2] as usize,
                t: std::array::from_fn(|a| p[a] * f64::from(n) - f64::from(at[a])),
            };
            let (f, g) = gather(&base.grid.values, spot, [m * m, m]);
            (f, DVec3::from_array(g) * f64::from(n))
        };
        let found = base_qualities(BASE_DEPTH, &self.cells, &octants, self.plan, field);
        self.judge(BASE_DEPTH, &octants, &found, room);
    }

    fn ask(&self, depth: usize) -> Vec<Octants> {
        self.cells.par_iter().map(|c| c.ask(self.mesh, depth)).collect()
    }

    /// Splits cells or makes them leaves.
    fn judge(&mut self, depth: usize, octants: &[Octants], found: &[Quality], room: impl Room) {
        let cells = std::mem::take(&mut self.cells);
        let h = 0.5f64.powi(depth as i32);
        let verdicts: Vec<Verdict> = cells
            .iter()
            .zip(found)
            .map(|(c, q)| verdict(q, c, self.plan))
            .collect();
        let splits_of =
            |kind: Verdict| -> Vec<usize> { (0..cells.len()).filter(|&i| verdicts[i] == kind).collect() };
        let plan = self.plan;
        let children = |parents: &[usize]| -> Vec<Cell> {
            let parts = parents
                .iter()
                .flat_map(|&i| parts(plan, depth, &cells[i], &octants[i], &found[i]));
            parts.collect()
        };
        let count = |parents: &[usize]| -> usize {
            active_count(&children(parents).iter().map(|c| c.at).collect::<Vec<_>>())
        };
        let mut reasons = vec![StopReason::Tolerance; cells.len()];
        let mut stop = |list: &[usize], reason: StopReason| list.iter().for_each(|&i| reasons[i] = reason);
        let (mut split, mut creased) = (splits_of(Verdict::Split), splits_of(Verdict::Crease));
        let budget = self
            .plan
            .coefficients
            .map(|c| c.saturating_sub(self.coefficients));
        let square = |&i: &usize| found[i].rms().powi(2) * found[i].area(h);
        let urgency = |&i: &usize| (found[i].is_lost(), found[i].rms());
        let mut reserved = 0;
        if depth == self.plan.max_depth {
            stop(&split, StopReason::Depth);
            stop(&creased, StopReason::Depth);
            split.clear();
        } else {
            let above = split.iter().chain(&creased);
            let of = |&i: &usize| (i, &cells[i], &octants[i], &found[i]);
            let sheets = Sheets::find(self.mesh, depth, above.map(of));
            let choice = sheets.choose(
                depth,
                plan.max_depth,
                budget,
                count,
                |i| (cells[i].at, found[i].area(h)),
                self.coefficients,
                &mut self.too_thin,
            );
            let mut is_refused = vec![false; cells.len()];
            choice.refused.iter().for_each(|&i| is_refused[i] = true);
            stop(&choice.refused, StopReason::Thin);
            split.retain(|&i| !is_refused[i]);
            creased.retain(|&i| !is_refused[i]);
            reserved = choice.reserved;

            let left: f64 = creased.iter().map(square).sum();
            let elsewhere = count(&split);
            self.elsewhere += elsewhere;
            let matters = self.left_at_creases + left > (CREASE_SHARE * plan.tolerance).powi(2) * plan.area;
            let room = self.elsewhere.max(CREASE_ROOM).saturating_sub(self.on_creases);
            let kept = match matters {
                true => affordable(creased.clone(), room, urgency, count),
                false => Vec::new(),
            };
            stop(&creased, StopReason::Crease);
            stop(&kept, StopReason::Tolerance);
            self.left_at_creases += left - kept.iter().map(square).sum::<f64>();
            split = [split, kept].concat();
            split.sort_unstable();
            self.on_creases += count(&split) - elsewhere;
        }
        if let Some(budget) = budget {
            let lost: Vec<usize> = split.iter().copied().filter(|&i| found[i].is_lost()).collect();
            let room = budget.saturating_sub(reserved).max(count(&lost).min(budget));
            let kept = affordable(split.clone(), room, urgency, count);
            let mut is_kept = vec![false; cells.len()];
            kept.iter().for_each(|&i| is_kept[i] = true);
            let refused: Vec<usize> = split.iter().copied().filter(|&i| !is_kept[i]).collect();
            stop(&refused, StopReason::Budget);
            split = kept;
        }
        let mut next = children(&split);
        let at: Vec<[u32; 3]> = next.iter().map(|c| c.at).collect();
        if !room(
            count_bricks_near(depth + 1, &at, REACH),
            next.len(),
            self.settled.len(),
        ) {
            stop(&split, StopReason::Memory);
            split.clear();
            next.clear();
        }
        self.settle(depth, &cells, octants, found, &split, &reasons);
        next.sort_unstable_by_key(|c| (key_of(c.at), c.at));
        self.cells = next;
    }

    /// Makes leaves of the cells that are not split, and keeps what is asked beside those that are.
    fn settle(
        &mut self,
        depth: usize,
        cells: &[Cell],
        octants: &[Octants],
        found: &[Quality],
        split: &[usize],
        reasons: &[StopReason],
    ) {
        let h = 0.5f64.powi(depth as i32);
        let mut is_split = vec![false; cells.len()];
        split.iter().for_each(|&i| is_split[i] = true);
        let split_cells: FxHashSet<[u32; 3]> = split.iter().map(|&i| cells[i].at).collect();
        let beside_split = |at| around(at).any(|cell| split_cells.contains(&cell));
        for (i, cell) in cells.iter().enumerate() {
            if is_split[i] {
                for (o, d) in octants[i].iter().enumerate() {
                    if !is_refined(self.plan, depth, o, d.distance, &found[i]) {
                        self.settled.push(Probe::new(cell.part(o, depth), d, 0.5 * h));
                    }
                }
                continue;
            }
            if beside_split(cell.at) {
                cell.conditions(&octants[i], depth, &mut self.settled);
            }
            let first = self.feet.len();
            self.feet.extend(cell.feet(&octants[i], depth));
            self.leaves.push(LeafCell {
                depth,
                at: cell.at,
                reason: reasons[i],
                area: found[i].area(h),
                feet: first..self.feet.len(),
            });
        }
    }

    /// Fits the corrections of one level, and judges its cells.
    fn refine<T: Real>(
        &mut self,
        depth: usize,
        coarser: &Coarser<'_, T>,
        room: impl Room,
    ) -> (Band<T>, Level<T>) {
        let octants = self.ask(depth);
        let at: Vec<[u32; 3]> = self.cells.iter().map(|c| c.at).collect();
        let mut band = Band::around_reaching(depth, &at, REACH, coarser);
        let around = Around {
            settled: &self.settled,
            corners: &self.corners,
        };
        let conditions = Conditions::new(depth, &band, &self.cells, &octants, &around);
        let problem = BandProblem::new(
            &band,
            &conditions.samples,
            &conditions.bricks,
            Weights {
                beta: BETA * 0.5f64.powi(depth as i32),
                mu: BENDING,
            },
        );
        let (x, outcome) = problem.solve(0.0, ITERATIONS);
        self.solves.push(outcome);
        drop(conditions);
        band.add_active(&x);
        self.coefficients += x.len();
        let found = qualities(depth, &band, &self.cells, &octants, &self.corners, self.plan);
        self.judge(depth, &octants, &found, room);
        let level = Level {
            keys: band.keys.clone(),
            masks: band.masks.clone(),
            x,
        };
        (band, level)
    }
}

/// The parts of a cell that are refined when it is split.
fn parts<'a>(
    plan: &'a Plan,
    depth: usize,
    cell: &'a Cell,
    octants: &'a Octants,
    found: &'a Quality,
) -> impl Iterator<Item = Cell> + 'a {
    let refined = octants
        .iter()
        .enumerate()
        .filter(move |(o, d)| is_refined(plan, depth, *o, d.distance, found));
    refined.map(move |(o, d)| Cell {
        at: child(cell.at, o),
        center: *d,
        error_above: found.rms() as f32,
    })
}

/// Whether a part of a cell that is split is refined: one that the band passes through belongs to it whole.
fn is_refined(plan: &Plan, depth: usize, octant: usize, distance: f64, found: &Quality) -> bool {
    let half = 0.5f64.powi(depth as i32 + 1);
    found.lost >> octant & 1 == 1 || distance <= plan.band + TOUCH * half
}

/// As many of `list` as have room for their coefficients, those first that `urgency` puts first.
fn affordable(
    mut list: Vec<usize>,
    budget: usize,
    urgency: impl Fn(&usize) -> (bool, f64),
    count: impl Fn(&[usize]) -> usize,
) -> Vec<usize> {
    if count(&list) <= budget {
        return list;
    }
    list.sort_unstable_by(|a, b| {
        let (p, q) = (urgency(a), urgency(b));
        q.0.cmp(&p.0).then(q.1.total_cmp(&p.1)).then(a.cmp(b))
    });
    let (mut fits, mut too_many) = (0, list.len());
    while too_many - fits > 1 + list.len() / 64 {
        let middle = (fits + too_many) / 2;
        if count(&list[..middle]) <= budget {
            fits = middle;
        } else {
            too_many = middle;
        }
    }
    list.truncate(fits);
    list.sort_unstable();
    list
}
