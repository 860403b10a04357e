//! Outward normals for points that come without any.
//!
//! The direction of a normal is read from the neighbours of its point; its sign is a question about the whole
//! cloud, answered on one of two [`Route`]s. What is not certain is told: a confidence for every point, the points
//! that belong to no surface, and where the doubtful ones lie.

mod band;
mod cloud;
mod confidence;
mod estimated;
pub(crate) mod kernel;
mod local;
mod outliers;
mod sampling;
mod sheets;
mod surface;
mod tagging;
pub(crate) mod tree;
mod winding;

use glam::DVec3;

use crate::{Control, FitError};
use cloud::Cloud;
use confidence::Sides;
pub use confidence::leaf_confidence;
pub use estimated::EstimatedCloud;
use kernel::{Gradient, Target};
use surface::{Surface, total};
use tree::Tree;
use winding::Widths;

/// How inside is told from outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Route {
    /// Consistency of the winding number with the normals \[Lin24\].
    #[default]
    WindingNumber,
    /// Unsigned distance on an octree, the exterior tagged from outside \[Zhao01\].
    Tagging,
}

impl Route {
    /// Both.
    pub const ALL: [Self; 2] = [Self::WindingNumber, Self::Tagging];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::WindingNumber => "winding number",
            Self::Tagging => "tagging",
        }
    }
}

/// What the caller may choose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrientOptions {
    /// How inside is told from outside.
    pub route: Route,
}

/// Normals, and how far to trust them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Orientation {
    /// Outward unit normals, one a point; zero where none could be given, which are outliers too.
    pub normals: Vec<DVec3>,
    /// Confidence in the sign of each, 0 to 1: how far the winding number is from ½ on both sides of the point, on
    /// the right side each.
    pub confidence: Vec<f32>,
    /// How far to trust the direction of each, 0 to 1; see [`OrientedPoints::certainty`](crate::points::OrientedPoints).
    pub certainty: Vec<f32>,
    /// Points that no surface passes through.
    pub outlier: Vec<bool>,
    /// How it was done.
    pub route: Route,
    /// Standard deviation of the noise, if any was found; world units.
    pub noise: Option<f64>,
    /// Points that are no outliers and whose confidence is below [`UNSURE`].
    pub unsure_count: usize,
    /// Repairs and doubts, each a sentence with its figures.
    pub notes: Vec<String>,
}

impl Orientation {
    /// Of a list with an entry for every point, those of points that are no outliers.
    pub fn on_surface<T: Copy>(&self, all: &[T]) -> Vec<T> {
        let kept = all.iter().zip(&self.outlier).filter(|p| !p.1);
        kept.map(|p| *p.0).collect()
    }
}

/// Confidence below which a sign is called unsure.
pub const UNSURE: f32 = 0.3;

/// Bytes held at once for a point: neighbour lists, two trees, normals.
const BYTES_PER_POINT: u64 = 500;
/// Rounds with all points.
const FULL_ROUNDS: usize = 2;

/// Estimates outward normals.
///
/// # Errors
/// [`FitError::NotEnoughSamples`] if fewer than 10 different points are usable, [`FitError::Degenerate`] if they lie
/// on one line, [`FitError::MemoryLimit`], [`FitError::Cancelled`].
pub fn orient_points(
    positions: &[DVec3],
    options: &OrientOptions,
    control: &mut Control,
) -> Result<Orientation, FitError> {
    control.step("looking at neighbours", 0.0)?;
    control.reserve(BYTES_PER_POINT * positions.len() as u64)?;
    let cloud = Cloud::prepare(positions)?;
    let is_lone = outliers::lone(&cloud.positions);
    let mut kept: Vec<usize> = (0..is_lone.len()).filter(|&i| !is_lone[i]).collect();
    let mut points: Vec<DVec3> = kept.iter().map(|&i| cloud.positions[i]).collect();
    control.step("looking at neighbours", 0.1)?;
    let surface = Surface::estimate(&mut points, &mut kept);
    if points.len() < cloud::FEWEST {
        return Err(FitError::NotEnoughSamples {
            found: points.len(),
            needed: cloud::FEWEST,
        });
    }
    let mut signed = match options.route {
        Route::WindingNumber => by_winding(&points, &surface, control)?,
        Route::Tagging => by_tagging(&points, &surface, control)?,
    };
    control.step("measuring confidence", 0.9)?;
    let told = confidence::sides(&points, &signed, &surface);
    let mut confidence = told.iter().map(Sides::confidence).collect();
    let on_sheets = sheets::align(&points, &surface, &mut signed, &mut confidence);
    let mut orientation = assemble(&cloud, &kept, &signed, &confidence, &surface, options.route);
    if on_sheets > 0 {
        orientation.notes.push(format!(
            "{on_sheets} points lie on open sheets, which have no inside: their normals follow those of their neighbours"
        ));
    }
    Ok(orientation)
}

/// Normals from the winding field of representatives, then of all points.
fn by_winding(points: &[DVec3], surface: &Surface, control: &mut Control) -> Result<Vec<DVec3>, FitError> {
    let n = points.len();
    let single: Vec<[f32; 3]> = points.iter().map(|p| p.as_vec3().to_array()).collect();
    let (chosen, areas) = sampling::representatives(&surface.areas);
    let few = Tree::new(chosen.iter().map(|&i| single[i]).collect(), &areas);
    let widths = |which| areas.iter().map(|&a| surface.width(which, a)).collect();
    let schedule = Widths {
        first: widths(0),
        last: widths(1),
    };
    let normals = winding::iterate(&few, &areas, &schedule, 0.2..0.7, control)?;
    // Their field at all points.
    let share = total(&areas) / areas.len() as f64 / (total(&surface.areas) / n as f64);
    let at = |which: usize, factor: f64| -> Vec<Target> {
        single
            .iter()
            .zip(&surface.areas)
            .map(|(&position, &a)| Target {
                position,
                width: surface.width(which, a * factor as f32),
            })
            .collect()
    };
    let all = Tree::new(single.clone(), &surface.areas);
    let strengths = winding::weighted(&normals, &areas);
    let mut down = few.sum(&Gradient, &strengths, &at(1, share), all.leaves());
    let targets = at(2, 1.0);
    let mut signed = vec![DVec3::ZERO; n];
    for round in 0..=FULL_ROUNDS {
        control.step("orienting", 0.7 + 0.2 * round as f64 / (FULL_ROUNDS + 1) as f64)?;
        for i in 0..n {
            let along = DVec3::from_array(down[i].map(f64::from)).normalize_or_zero();
            let local = surface.around[i].normal;
            let local = if local.dot(along) < 0.0 { -local } else { local };
            // With noise the field is the better average, and both together better than each.
            signed[i] = match surface.noise {
                Some(_) => (local + along).normalize_or(local),
                None => local,
            };
        }
        if round < FULL_ROUNDS {
            let strengths: Vec<[f32; 3]> = signed
                .iter()
                .zip(&surface.areas)
                .map(|(v, &a)| (v.as_vec3() * a).to_array())
                .collect();
            down = all.sum(&Gradient, &strengths, &targets, all.leaves());
            // A point's own share always agrees with it.
            for (g, (s, t)) in down.iter_mut().zip(strengths.iter().zip(&targets)) {
                let own = 1.0 / (4.0 * std::f32::consts::PI * t.width * t.width * t.width);
                (0..3).for_each(|k| g[k] -= s[k] * own);
            }
        }
    }
    Ok(signed)
}

/// Normals by the tags of the cells round each point.
fn by_tagging(points: &[DVec3], surface: &Surface, control: &mut Control) -> Result<Vec<DVec3>, FitError> {
    let mut sorted = surface.areas.clone();
    let rank = sorted.len() * 9 / 10;
    let spacing = f64::from(*sorted.select_nth_unstable_by(rank, f32::total_cmp).1).sqrt();
    let cell =
        (tagging::CELL_BY_SPACING * spacing).max(tagging::CELL_BY_NOISE * surface.noise.unwrap_or(0.0));
    let band = band::Band::new(points, cell);
    control.step("tagging the exterior", 0.5)?;
    let tags = tagging::tag(&band);
    let normals: Vec<DVec3> = surface.around.iter().map(|s| s.normal).collect();
    let signs = tagging::signs(&band, &tags, points, &normals);
    Ok(normals.iter().zip(signs).map(|(n, s)| *n * s).collect())
}

/// Back in the order of the points given.
fn assemble(
    cloud: &Cloud,
    kept: &[usize],
    signed: &[DVec3],
    confidence: &[f32],
    surface: &Surface,
    route: Route,
) -> Orientation {
    let given = cloud.source.len() + cloud.doubles.len() + cloud.left_out;
    let mut out = Orientation {
        normals: vec![DVec3::ZERO; given],
        confidence: vec![0.0; given],
        certainty: vec![0.0; given],
        outlier: vec![true; given],
        route,
        noise: surface.noise.map(|s| s * cloud.scale),
        unsure_count: 0,
        notes: cloud.notes.clone(),
    };
    for (k, &i) in kept.iter().enumerate() {
        let at = cloud.source[i] as usize;
        out.normals[at] = signed[k];
        out.confidence[at] = confidence[k];
        out.certainty[at] = surface.certainty(k);
        out.outlier[at] = false;
    }
    for &(double, i) in &cloud.doubles {
        let (at, first) = (double as usize, cloud.source[i as usize] as usize);
        out.normals[at] = out.normals[first];
        out.confidence[at] = out.confidence[first];
        out.certainty[at] = out.certainty[first];
        out.outlier[at] = out.outlier[first];
    }
    out.unsure_count = (0..given)
        .filter(|&i| !out.outlier[i] && out.confidence[i] < UNSURE)
        .count();
    let lone = cloud.source.len() - kept.len();
    if lone > 0 {
        out.notes.push(format!(
            "{lone} of {given} points lie on no surface and were given no normal"
        ));
    }
    out.notes.push(format!(
        "normals estimated and oriented by {}; the sign of {} of {given} ({:.2} %) is unsure",
        route.name(),
        out.unsure_count,
        100.0 * out.unsure_count as f64 / given as f64
    ));
    out.notes.extend(confidence::places(cloud, kept, confidence));
    out
}
