//! The cells of a fit, as wire frames: coloured by how fine they are, or by their error.

use bspline::hierarchical::Lattice;
use fitting::{FitReport, Leaf};
use glam::{DAffine3, DVec3};

use super::{Legend, Stretch};
use crate::check::viridis;
use crate::cli::quantity::{human_count, human_number};

/// Most cells that are drawn.
const MOST: usize = 12_000;
/// How much lines hide.
const OPAQUE: u8 = 200;

/// The sides of cells on their finest level, each once, and what their colours mean; places are told from `origin`.
pub fn cells(
    lattice: &Lattice,
    report: &FitReport,
    by_error: bool,
    unit: &str,
    (placed, origin): (DAffine3, DVec3),
) -> (Vec<Stretch>, Legend, String) {
    let all: Vec<&Leaf> = report.leaves.iter().filter(|l| l.sample_count > 0).collect();
    let step = all.len().div_ceil(MOST).max(1);
    let drawn = || all.iter().step_by(step);
    let finest = drawn().map(|l| l.level).max().unwrap_or(0);
    let coarsest = drawn().map(|l| l.level).min().unwrap_or(0);
    let scale = ErrorScale::of(report);
    let share = |leaf: &Leaf| match by_error {
        true => scale.share(leaf.rms),
        false => f64::from(leaf.level - coarsest) / f64::from((finest - coarsest).max(1)),
    };
    let mut sides = Vec::new();
    for leaf in drawn() {
        let size = 1_u64 << (finest - leaf.level);
        let low = leaf.cell.map(|n| u64::from(n) * size);
        let color = viridis(share(leaf));
        for axis in 0..3 {
            for corner in 0..4 {
                let mut start = low;
                start[(axis + 1) % 3] += size * (corner & 1);
                start[(axis + 2) % 3] += size * (corner >> 1);
                sides.push((start, axis, size, color));
            }
        }
    }
    sides.sort_unstable();
    sides.dedup_by_key(|(start, axis, size, _)| (*start, *axis, *size));
    let unit_cell = 1.0 / (1_u64 << finest) as f64;
    let world = |at: [u64; 3]| {
        let q = DVec3::from_array(at.map(|n| n as f64)) * unit_cell;
        let p = placed.transform_point3(lattice.world_from_lattice.transform_point3(q));
        (p - origin).as_vec3().to_array()
    };
    let stretch = |(start, axis, size, [r, g, b]): ([u64; 3], usize, u64, [u8; 3])| {
        let mut end = start;
        end[axis] += size;
        Stretch {
            start: world(start),
            end: world(end),
            color: [r, g, b, OPAQUE],
        }
    };
    let stretches = sides.into_iter().map(stretch).collect();
    let legend = match by_error {
        true => scale.legend("Rms error of cells", unit),
        false => {
            let side = |level: u8| short(lattice.spacing(level.into()).max_element());
            Legend {
                title: titled("Side of cells", unit),
                colors: band(),
                marks: match coarsest == finest {
                    true => vec![(0.0, side(coarsest))],
                    false => vec![(0.0, side(coarsest)), (1.0, side(finest))],
                },
            }
        }
    };
    let told = match step {
        1 => format!("{} cells with samples", human_count(all.len())),
        _ => format!(
            "{} of {} cells with samples, one in {step}",
            human_count(drawn().count()),
            human_count(all.len())
        ),
    };
    (stretches, legend, told)
}

/// A name with its unit, if it has one.
pub fn titled(name: &str, unit: &str) -> String {
    match unit {
        "" => name.into(),
        unit => format!("{name}, {unit}"),
    }
}

/// A number of three digits at most, as there is room for under a band of colours.
pub fn short(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return human_number(x);
    }
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{x:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// The colours of the scale from its lower end on.
pub fn band() -> Vec<[u8; 3]> {
    (0..32).map(|n| viridis(f64::from(n) / 31.0)).collect()
}

/// Colours of errors: the tolerance lies in the middle, as in the maps of `picture --errors`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    middle: f64,
    has_tolerance: bool,
}

impl ErrorScale {
    /// Of a fit.
    pub fn of(report: &FitReport) -> Self {
        // An interpolating fit aims at no tolerance.
        let has_tolerance = report.tolerance > 0.0;
        Self {
            middle: if has_tolerance {
                report.tolerance
            } else {
                0.5 * report.max
            },
            has_tolerance,
        }
    }

    /// Where an error is on it.
    pub fn share(self, rms: f32) -> f64 {
        (f64::from(rms) / (2.0 * self.middle).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }

    /// What its colours mean.
    pub fn legend(self, what: &str, unit: &str) -> Legend {
        let most = format!("> {}", short(2.0 * self.middle));
        let mut marks = vec![(0.0, "0".to_string()), (1.0, most)];
        if self.has_tolerance {
            marks.insert(1, (0.5, short(self.middle)));
        }
        Legend {
            title: titled(what, unit),
            colors: band(),
            marks,
        }
    }
}

#[cfg(test)]
mod tests {
    use fitting::StopReason;

    use super::*;

    fn leaf(level: u8, cell: [u32; 3], rms: f32) -> Leaf {
        Leaf {
            level,
            cell,
            sample_count: 1,
            rms,
            max: rms,
            reason: StopReason::Tolerance,
        }
    }

    #[test]
    fn cells_share_the_sides_between_them_and_lie_where_the_lattice_has_them() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_scale(DVec3::splat(2.0)),
            cells: [4; 3],
        };
        let report = FitReport {
            tolerance: 0.5,
            leaves: vec![
                leaf(0, [1, 0, 0], 0.0),
                leaf(0, [2, 0, 0], 1.0),
                leaf(1, [6, 0, 0], 0.5),
            ],
            ..FitReport::default()
        };
        let placed = (DAffine3::IDENTITY, DVec3::ZERO);
        let (sides, legend, told) = cells(&lattice, &report, false, "mm", placed);
        // Two cubes with a face between them have 20 sides; the small one none in common with them.
        assert_eq!(sides.len(), 20 + 12);
        assert!(told.starts_with("3 cells"), "{told}");
        let length = |s: &Stretch| glam::Vec3::from(s.start).distance(glam::Vec3::from(s.end));
        assert_eq!(sides.iter().filter(|s| length(s) == 2.0).count(), 20);
        assert_eq!(legend.marks[0].1, "2");
        assert_eq!(legend.marks[1].1, "1");
        let (sides, legend, _) = cells(&lattice, &report, true, "mm", placed);
        let of = |share| {
            let [r, g, b] = viridis(share);
            [r, g, b, OPAQUE]
        };
        for color in [of(0.0), of(0.5), of(1.0)] {
            assert!(sides.iter().any(|s| s.color == color), "{color:?}");
        }
        assert_eq!(legend.marks[1], (0.5, "0.5".into()));
        assert_eq!(legend.title, "Rms error of cells, mm");
        for (x, text) in [
            (0.000_157_64, "0.000158"),
            (1234.5, "1234"),
            (20.0, "20"),
            (0.5, "0.5"),
        ] {
            assert_eq!(short(x), text);
        }
    }
}
