//! How often which density is there.

use bspline::{Aabb, Field, Frame};
use glam::{DAffine3, DVec3};

/// Samples along the longest side of the box.
const SAMPLES: f64 = 48.0;
/// Bars.
const BARS: usize = 64;

/// How often which density is there, in bars of one width.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// The least and the largest density that was found; the first is below the second.
    pub range: [f64; 2],
    /// Samples in each bar.
    pub bars: Vec<u32>,
}

impl Histogram {
    /// Of a field in its box, sampled evenly.
    pub fn new(field: &dyn Field, within: &Aabb) -> Self {
        let step = within.size().max_element() / SAMPLES;
        let count = (within.size() / step)
            .ceil()
            .max(DVec3::ONE)
            .to_array()
            .map(|n| n as usize);
        let frame = Frame {
            world_from_grid: DAffine3::from_translation(within.min + 0.5 * step)
                * DAffine3::from_scale(DVec3::splat(step)),
            cells: count.map(|n| n.max(2) as u32 - 1),
        };
        let mut values = vec![0.0; count.iter().product()];
        field.frame_values(&frame, [0; 3], count, &mut values);
        Self::of(&values)
    }

    fn of(values: &[f64]) -> Self {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        let range = if low < high { [low, high] } else { [0.0, 1.0] };
        let mut bars = vec![0; BARS];
        for v in finite() {
            let share = (v - range[0]) / (range[1] - range[0]);
            bars[((share * BARS as f64) as usize).min(BARS - 1)] += 1;
        }
        Self { range, bars }
    }

    /// Density below which a share of all samples lie, to a bar's width.
    pub fn quantile(&self, share: f64) -> f64 {
        let all: u32 = self.bars.iter().sum();
        let mut left = share * f64::from(all);
        let below = self.bars.iter().take_while(|n| {
            left -= f64::from(**n);
            left > 0.0
        });
        let [low, high] = self.range;
        low + (below.count() + 1) as f64 / BARS as f64 * (high - low)
    }

    /// Densities that show black and white where the surface is at one: from that on, the highest few white.
    pub fn shown(&self, iso: f64) -> [f64; 2] {
        let [low, high] = self.range;
        let white = f64::max(self.quantile(0.995), iso + 0.05 * (high - low));
        [iso, white]
    }

    /// Heights of the bars, 0 to 1. A scan is mostly air: the square root lets the rest be seen.
    pub fn heights(&self) -> impl Iterator<Item = f32> {
        let most = self.bars.iter().copied().max().unwrap_or(1).max(1) as f32;
        self.bars.iter().map(move |n| (*n as f32 / most).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use bspline::primitives::HalfSpace;

    use super::*;

    #[test]
    fn a_ramp_fills_all_bars_alike() {
        let ramp = HalfSpace::new(DVec3::ZERO, DVec3::Z).unwrap();
        let b = Aabb::new(DVec3::splat(-6.0), DVec3::splat(6.0));
        let found = Histogram::new(&ramp, &b);
        assert!(
            (found.range[0] + 5.875).abs() < 1e-9 && (found.range[1] - 5.875).abs() < 1e-9,
            "{:?}",
            found.range
        );
        assert_eq!(found.bars.iter().sum::<u32>(), 48 * 48 * 48);
        // 48 layers in 64 bars: none or one in each.
        assert!(
            found.bars.iter().all(|n| [0, 48 * 48].contains(n)),
            "{:?}",
            found.bars
        );
    }

    #[test]
    fn what_is_one_density_everywhere_has_a_range() {
        let found = Histogram::of(&[f64::NAN, f64::INFINITY, 3.0, 3.0]);
        assert_eq!(found.range, [0.0, 1.0]);
        assert_eq!(found.heights().fold(0.0, f32::max), 1.0);
    }
}
