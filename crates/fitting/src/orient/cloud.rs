//! The points, made ready: checked, without doubles, in Morton order in a unit box.

use glam::DVec3;

use crate::FitError;
use crate::points::far_points::drop_far_outliers;
use crate::points::samples::{extent, finite, is_collinear, morton};

/// Usable points in Morton order.
#[derive(Debug)]
pub(crate) struct Cloud {
    /// Positions in the unit box.
    pub positions: Vec<DVec3>,
    /// Place of each among the points given.
    pub source: Vec<u32>,
    /// Points given that coincide with one of `positions`, with its place there.
    pub doubles: Vec<(u32, u32)>,
    /// World length of the box's edge.
    pub scale: f64,
    /// World position of the box's corner.
    pub origin: DVec3,
    /// How many of the points given can have no normal.
    pub left_out: usize,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// Fewest points that can stand for a surface; as for fits.
pub(crate) const FEWEST: usize = 10;

impl Cloud {
    /// Checks, scales, sorts, and merges points that coincide.
    ///
    /// # Errors
    /// [`FitError::NotEnoughSamples`] if fewer than 10 different points are usable; [`FitError::Degenerate`] if
    /// they lie on one line.
    pub fn prepare(given: &[DVec3]) -> Result<Self, FitError> {
        let total = given.len();
        let mut kept: Vec<u32> = (0..total as u32)
            .filter(|&i| finite(&given[i as usize]))
            .collect();
        let mut notes = Vec::new();
        let mut note = |count: usize, what: &str| {
            if count > 0 {
                notes.push(format!("{count} of {total} points have no normal: {what}"));
            }
        };
        let finite_count = kept.len();
        note(total - finite_count, "a coordinate is not finite");
        drop_far_outliers(given, &mut kept);
        note(
            finite_count - kept.len(),
            "farther than ten extents from the bulk of the points",
        );
        let too_few = |found| FitError::NotEnoughSamples {
            found,
            needed: FEWEST,
        };
        if kept.len() < FEWEST {
            return Err(too_few(kept.len()));
        }
        let (min, max) = extent(given, &kept);
        let longest = (max - min).max_element();
        if longest <= 1e-12 * min.abs().max(max.abs()).max_element() || longest == 0.0 {
            return Err(FitError::Degenerate(format!(
                "all {} points lie at {min}",
                kept.len()
            )));
        }
        if is_collinear(given, &kept, longest) {
            return Err(FitError::Degenerate(
                "the points lie on one line: a solid needs a surface around it".into(),
            ));
        }
        let unit = |i: u32| (given[i as usize] - min) / longest;
        let mut keyed: Vec<(u64, [u64; 3], u32)> = kept
            .iter()
            .map(|&i| {
                let p = unit(i);
                // Not negative, so their bits are ordered as they are.
                (morton(p), p.to_array().map(|x| (x + 0.0).to_bits()), i)
            })
            .collect();
        keyed.sort_unstable();
        let (mut positions, mut source, mut doubles) = (Vec::new(), Vec::new(), Vec::new());
        let mut last = None;
        for (_, bits, i) in keyed {
            if last == Some(bits) {
                doubles.push((i, source.len() as u32 - 1));
                continue;
            }
            last = Some(bits);
            positions.push(unit(i));
            source.push(i);
        }
        if positions.len() < FEWEST {
            return Err(too_few(positions.len()));
        }
        Ok(Self {
            positions,
            source,
            doubles,
            scale: longest,
            origin: min,
            left_out: total - kept.len(),
            notes,
        })
    }

    /// World position.
    pub fn world(&self, index: usize) -> DVec3 {
        self.origin + self.positions[index] * self.scale
    }
}
