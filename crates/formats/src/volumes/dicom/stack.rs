//! Planes in order: how they stand to each other, and what is refused.
//!
//! All lengths come from the positions of the planes, never from a thickness, a slice location or a number.

use glam::{DMat3, DVec3};

use super::plane::Plane;
use super::{DicomOptions, Tilt, Uneven};
use crate::volumes::several::Several;
use crate::{Choice, Fault};

/// Planes of a volume in order along their normal.
#[derive(Debug)]
pub(super) struct Stack {
    /// One plane a position, in order.
    pub planes: Vec<Plane>,
    /// Planes at the position of another, with its index: they have to show the same.
    pub copies: Vec<(usize, Plane)>,
    pub grid: Grid,
    pub notes: Vec<String>,
}

/// What is made of the planes.
#[derive(Debug)]
pub(super) struct Grid {
    /// Columns, rows, slices.
    pub dims: [usize; 3],
    /// Centre of the first voxel, LPS, mm.
    pub origin: DVec3,
    /// Steps along columns, rows, slices, LPS, mm.
    pub steps: [DVec3; 3],
    pub slices: Vec<Slice>,
}

/// One slice of the volume out of the planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slice {
    /// The plane at or below.
    pub below: usize,
    /// Share of the plane above it, `0..1`.
    pub above: f64,
    /// Pixels by which the slice is shifted against the grid, along columns and rows.
    pub shift: [f64; 2],
}

/// Deviation of a position that is no deviation, in shares of the distance between slices.
const EVEN: f64 = 0.01;
/// Two planes nearer than this share of the usual distance are at the same place.
const SAME: f64 = 1e-3;
/// Pixels by which a plane may be off the line through the first of all.
const ASIDE: f64 = 0.05;
/// Tangent of the tilt that is none: 0.2 mm in 2 m.
const UPRIGHT: f64 = 1e-4;
/// Degrees of tilt that a stack may have; gantries do 30.
const STEEPEST: f64 = 60.0;
/// Pixels that an upright grid may be wider than the pictures.
const MOST_GROWN: f64 = 1e6;
/// Cosines that are equal, and spacings relative to each other.
const EQUAL: f64 = 1e-4;

/// Orders planes and looks at their distances. `name` is how a plane is called; `dims` are columns and rows; `volume`
/// is which of several at the same positions is meant.
///
/// # Errors
/// [`Fault::Value`] for planes of different orientation or spacing, for several at one position, for displaced
/// ones, and for distances that are not even, unless they are to be resampled.
pub(super) fn arrange(
    mut planes: Vec<Plane>,
    dims: [usize; 2],
    single_step: Option<f64>,
    options: &DicomOptions,
    volume: Option<usize>,
    name: &dyn Fn(&Plane) -> String,
) -> Result<Stack, Fault> {
    same_directions(&planes, name)?;
    let normal = planes[0].normal();
    let along = |p: &Plane| normal.dot(p.position);
    // Equal positions keep the order of the files.
    planes.sort_by(|a, b| along(a).total_cmp(&along(b)));
    let mut notes = Vec::new();
    if let Some(wanted) = volume {
        planes = one_volume(planes, &along, wanted, &mut notes)?;
    }
    let (planes, copies) = part_copies(planes, &along, name)?;
    if !copies.is_empty() {
        notes.push(format!(
            "{} of the pictures repeat another at the same position, {} first; they are left out, as they are equal",
            copies.len(),
            name(&copies[0].1)
        ));
    }
    let steps = planes[0].steps;
    if planes.len() == 1 {
        let step = single_step.ok_or_else(|| Fault::Value {
            what: "the number of slices",
            value: "1, and nothing says how thick it is".into(),
            remedy: "give the directory of the whole series",
        })?;
        notes.push(format!(
            "there is one slice; its thickness, {step} mm, was taken from the header"
        ));
        let grid = Grid {
            dims: [dims[0], dims[1], 1],
            origin: planes[0].position,
            steps: [steps[0], steps[1], normal * step],
            slices: vec![Slice::whole(0)],
        };
        return Ok(Stack {
            planes,
            copies,
            grid,
            notes,
        });
    }
    on_a_line(&planes, &along, name)?;
    let (first, last) = (planes[0].position, planes[planes.len() - 1].position);
    let (slices, step) = match uneven(&planes, &along, name) {
        None => {
            let step = (last - first) / (planes.len() - 1) as f64;
            ((0..planes.len()).map(Slice::whole).collect(), step)
        }
        Some(what) if options.uneven == Uneven::Refuse => {
            return Err(Fault::Choose {
                what: "the distance between slices",
                value: what,
                remedy: "look for missing files, or ask for resampling along the normal",
                choice: Choice::Uneven,
            });
        }
        Some(what) => {
            let slices = resampled(&planes, &along);
            let step = (last - first) / (slices.len() - 1) as f64;
            let made = slices.iter().filter(|s| s.above > 0.0).count();
            notes.push(format!(
                "the distance between slices is {what}; {made} of {} slices, {:.6} mm apart, were interpolated \
                 linearly",
                slices.len(),
                step.dot(normal)
            ));
            (slices, step)
        }
    };
    let mut grid = Grid {
        dims: [dims[0], dims[1], slices.len()],
        origin: first,
        steps: [steps[0], steps[1], step],
        slices,
    };
    tilt(&mut grid, normal, options.tilt, &mut notes)?;
    Ok(Stack {
        planes,
        copies,
        grid,
        notes,
    })
}

impl Slice {
    fn whole(plane: usize) -> Self {
        Self {
            below: plane,
            above: 0.0,
            shift: [0.0; 2],
        }
    }
}

/// All planes look the same way and have pixels of the same size. The odd ones out are named.
fn same_directions(planes: &[Plane], name: &dyn Fn(&Plane) -> String) -> Result<(), Fault> {
    let agree = |a: &Plane, b: &Plane| {
        (0..2).all(|i| (a.steps[i] - b.steps[i]).length() <= EQUAL * a.steps[i].length())
    };
    if planes.iter().all(|p| agree(&planes[0], p)) {
        return Ok(());
    }
    // The first plane may be the odd one: the one in the middle is rarely a localizer.
    let usual = &planes[planes.len() / 2];
    let odd: Vec<&Plane> = planes.iter().filter(|p| !agree(usual, p)).collect();
    let show = |p: &Plane| {
        let [c, r] = p.steps;
        format!(
            "rows along {:.4}, columns along {:.4}, pixels of {:.4} x {:.4} mm",
            c.normalize(),
            r.normalize(),
            c.length(),
            r.length()
        )
    };
    Err(Fault::Value {
        what: "the orientation or pixel spacing of the series",
        value: format!(
            "mixed: {} of {} pictures differ ({}: {}; the others: {})",
            odd.len(),
            planes.len(),
            some(odd.iter().map(|p| name(p))),
            show(odd[0]),
            show(usual)
        ),
        remedy: "move the pictures of one kind to a directory of their own (localizers often share a series)",
    })
}

/// At most three of some names.
pub(super) fn some(names: impl Iterator<Item = String>) -> String {
    let mut names: Vec<String> = names.take(4).collect();
    if names.len() == 4 {
        names[3] = "…".into();
    }
    names.join(", ")
}

/// Distance along the normal below which two planes are at the same place.
fn same_place(sorted: &[Plane], along: &dyn Fn(&Plane) -> f64) -> f64 {
    let extent = along(&sorted[sorted.len() - 1]) - along(&sorted[0]);
    // Median of the distances that are one: what files round to is far below.
    let mut distances: Vec<f64> = sorted.windows(2).map(|w| along(&w[1]) - along(&w[0])).collect();
    distances.retain(|d| *d > 1e-6 * extent && *d > 1e-6);
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).map_or(1e-6, |m| SAME * m)
}

/// The planes of volume number `wanted` of those that stand at the same positions, in their order in time.
fn one_volume(
    sorted: Vec<Plane>,
    along: &dyn Fn(&Plane) -> f64,
    wanted: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<Plane>, Fault> {
    let same = same_place(&sorted, along);
    let mut groups: Vec<Vec<Plane>> = Vec::new();
    for p in sorted {
        match groups.last_mut() {
            Some(group) if along(&p) - along(&group[0]) <= same => group.push(p),
            _ => groups.push(vec![p]),
        }
    }
    let least = groups.iter().map(Vec::len).min().unwrap_or(0);
    let most = groups.iter().map(Vec::len).max().unwrap_or(0);
    if least != most {
        return Err(Fault::Value {
            what: "the number of pictures at each position",
            value: format!("{least} to {most}"),
            remedy: "volumes can be told apart where each position has as many pictures; give the files of one volume",
        });
    }
    let number = Several::choose(most as u64, Some(wanted))?.map_or(0, |s| s.number);
    if most > 1 {
        notes.push(format!(
            "volume {number} of {most}, counted from 0: at each position the pictures were taken in the order of \
             temporal position, trigger time, acquisition, echo time and instance"
        ));
    }
    let in_time = |a: &Plane, b: &Plane| {
        let keys = a.order.iter().zip(&b.order).map(|(a, b)| a.total_cmp(b));
        keys.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
    };
    let chosen = groups.into_iter().map(|mut group| {
        // Equal ones keep the order of the files.
        group.sort_by(in_time);
        group.swap_remove(number)
    });
    Ok(chosen.collect())
}

/// One plane a position, and those that stand where another is.
fn part_copies(
    sorted: Vec<Plane>,
    along: &dyn Fn(&Plane) -> f64,
    name: &dyn Fn(&Plane) -> String,
) -> Result<(Vec<Plane>, Vec<(usize, Plane)>), Fault> {
    let same = same_place(&sorted, along);
    let (mut planes, mut copies) = (Vec::<Plane>::new(), Vec::new());
    let count = sorted.len();
    for p in sorted {
        match planes.last() {
            Some(q) if along(&p) - along(q) <= same => {
                if (p.position - q.position).length()
                    > ASIDE * p.steps[0].length().min(p.steps[1].length()) + same
                {
                    return Err(Fault::Value {
                        what: "the position of the pictures",
                        value: format!(
                            "beside each other in one plane: {} at {} and {} at {}",
                            name(q),
                            q.position,
                            name(&p),
                            p.position
                        ),
                        remedy: "tiles of one slice are not joined; give the files of one stack only",
                    });
                }
                copies.push((planes.len() - 1, p));
            }
            _ => planes.push(p),
        }
    }
    if copies.len() >= planes.len() && planes.len() > 1 {
        return Err(Fault::Choose {
            what: "the number of pictures at each position",
            value: format!(
                "{} on average ({count} at {})",
                count / planes.len(),
                planes.len()
            ),
            remedy: "a time series, several echoes or phases: choose one volume by its number, counted from 0",
            choice: Choice::Volume,
        });
    }
    Ok((planes, copies))
}

/// The first pixels of all planes lie on one line, at a right angle to them or not.
fn on_a_line(
    planes: &[Plane],
    along: &dyn Fn(&Plane) -> f64,
    name: &dyn Fn(&Plane) -> String,
) -> Result<(), Fault> {
    let (first, last) = (&planes[0], &planes[planes.len() - 1]);
    let (from, to) = (along(first), along(last));
    let pixel = first.steps[0].length().min(first.steps[1].length());
    for p in planes {
        let on_line = first
            .position
            .lerp(last.position, (along(p) - from) / (to - from));
        let aside = (p.position - on_line).length();
        if aside > ASIDE * pixel {
            return Err(Fault::Value {
                what: "the position of a picture",
                value: format!(
                    "{aside:.4} mm aside of the others in {}, where a pixel has {pixel:.4} mm",
                    name(p)
                ),
                remedy: "the table moved or two stacks were mixed; move the odd pictures to another directory",
            });
        }
    }
    Ok(())
}

/// What is uneven about the distances, or `None`.
fn uneven(
    planes: &[Plane],
    along: &dyn Fn(&Plane) -> f64,
    name: &dyn Fn(&Plane) -> String,
) -> Option<String> {
    let at: Vec<f64> = planes.iter().map(along).collect();
    let distances: Vec<f64> = at.windows(2).map(|w| w[1] - w[0]).collect();
    let step = (at[at.len() - 1] - at[0]) / distances.len() as f64;
    if (0..at.len()).all(|i| (at[i] - at[0] - step * i as f64).abs() <= EVEN * step) {
        return None;
    }
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[(sorted.len() - 1) / 2];
    let between = |i: usize| format!("between {} and {}", name(&planes[i]), name(&planes[i + 1]));
    let multiple = |d: &f64| (d / usual).round();
    let are_multiples = distances
        .iter()
        .all(|d| multiple(d) >= 1.0 && (d - multiple(d) * usual).abs() <= EVEN * usual);
    if are_multiples {
        let gaps = || (0..distances.len()).filter(|i| multiple(&distances[*i]) > 1.0);
        let missing: f64 = distances.iter().map(|d| multiple(d) - 1.0).sum();
        return Some(format!(
            "{usual:.6} mm, with {missing} missing {}",
            some(gaps().map(between))
        ));
    }
    let extreme = |better: fn(f64, f64) -> bool| {
        let start = 0;
        (1..distances.len()).fold(
            start,
            |b, i| if better(distances[i], distances[b]) { i } else { b },
        )
    };
    let (least, most) = (extreme(|a, b| a < b), extreme(|a, b| a > b));
    Some(format!(
        "uneven: {:.6} mm {} and {:.6} mm {}",
        distances[least],
        between(least),
        distances[most],
        between(most)
    ))
}

/// As many slices as the smallest distance asks for, though not more than four times those that are there.
fn resampled(planes: &[Plane], along: &dyn Fn(&Plane) -> f64) -> Vec<Slice> {
    let at: Vec<f64> = planes.iter().map(along).collect();
    let extent = at[at.len() - 1] - at[0];
    let least = at.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    let intervals = (extent / least).round().clamp(1.0, 4.0 * planes.len() as f64) as usize;
    let step = extent / intervals as f64;
    let mut below = 0;
    (0..=intervals)
        .map(|k| {
            let target = if k == intervals {
                at[at.len() - 1]
            } else {
                at[0] + step * k as f64
            };
            while below + 1 < at.len() && at[below + 1] <= target + EVEN * SAME * step {
                below += 1;
            }
            let above = match at.get(below + 1) {
                Some(next) => (target - at[below]) / (next - at[below]),
                None => 0.0,
            };
            // Nearer than positions are rounded: the plane itself.
            let above = if above < SAME * EVEN { 0.0 } else { above };
            Slice {
                above,
                ..Slice::whole(below)
            }
        })
        .collect()
}

/// Tells of a tilt, and straightens the grid if asked: each slice is then shifted within its plane, on a grid that
/// holds all of them.
fn tilt(grid: &mut Grid, normal: DVec3, tilt: Tilt, notes: &mut Vec<String>) -> Result<(), Fault> {
    let step = grid.steps[2];
    let upright = normal * step.dot(normal);
    let tangent = (step - upright).length() / upright.length();
    if tangent <= UPRIGHT {
        return Ok(());
    }
    let degrees = tangent.atan().to_degrees();
    if degrees > STEEPEST {
        return Err(Fault::Value {
            what: "the tilt of the slices against their stack",
            value: format!("{degrees:.3} degrees"),
            remedy: "no gantry tilts as far; the positions or orientations are damaged, export the series again",
        });
    }
    if tilt == Tilt::Keep {
        notes.push(format!(
            "the slices are tilted by {degrees:.3} degrees against their stack (gantry tilt); every voxel stays where \
             it was measured, on an oblique grid"
        ));
        return Ok(());
    }
    // The drift of a slice against the one before it, in pixels: (step − upright) = drift₀ s₀ + drift₁ s₁.
    let [s0, s1, _] = grid.steps;
    let plane = DMat3::from_cols(s0, s1, normal).inverse();
    let drift = (plane * (step - upright)).to_array();
    for axis in 0..2 {
        let last = drift[axis] * (grid.slices.len() - 1) as f64;
        // Whole pixels that the grid grows by, at the end or before its begin.
        let grown = (last.abs() - 1e-9).max(0.0).ceil();
        if grown > MOST_GROWN {
            return Err(Fault::Value {
                what: "the width of the upright grid",
                value: format!("{grown:e} pixels more than a picture's"),
                remedy: "the positions and the spacing of the pixels contradict each other; keep the slices tilted",
            });
        }
        let before = if last < 0.0 { grown } else { 0.0 };
        grid.dims[axis] += grown as usize;
        grid.origin -= [s0, s1][axis] * before;
        for (k, slice) in grid.slices.iter_mut().enumerate() {
            slice.shift[axis] = before + drift[axis] * k as f64;
        }
    }
    grid.steps[2] = upright;
    notes.push(format!(
        "the slices are tilted by {degrees:.3} degrees against their stack (gantry tilt); they were interpolated \
         linearly on an upright grid, which holds no data outside of the slices"
    ));
    Ok(())
}
