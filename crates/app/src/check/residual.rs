use bspline::{Field, Frame};
use serde::Serialize;

/// Summary of absolute errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ErrorStatistics {
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

impl ErrorStatistics {
    /// Statistics of `errors`, whose signs do not matter; reorders them. All zero without errors.
    pub fn of(errors: &mut [f64]) -> Self {
        if errors.is_empty() {
            return Self::default();
        }
        errors.iter_mut().for_each(|e| *e = e.abs());
        let n = errors.len();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / n as f64).sqrt();
        // Nearest rank: the smallest error that the share does not exceed.
        let mut rank = |share: f64| {
            let k = ((share * n as f64).ceil() as usize).clamp(1, n) - 1;
            *errors.select_nth_unstable_by(k, f64::total_cmp).1
        };
        Self {
            rms,
            p95: rank(0.95),
            p99: rank(0.99),
            max: rank(1.0),
        }
    }
}

/// Differences `f(voxel centre) - d` of all voxels, in the order of `data`, x fastest.
///
/// `frame`'s nodes are the voxel centres, `n[a]` of them along axis `a`. One slab of values is held at a time.
///
/// # Panics
/// If `data` is not `n[0]·n[1]·n[2]` long.
pub fn voxel_residuals(field: &dyn Field, frame: &Frame, n: [usize; 3], data: &[f32]) -> Vec<f64> {
    assert_eq!(data.len(), n[0] * n[1] * n[2], "one datum a node");
    let mut residuals = vec![0.0; data.len()];
    const SLAB: usize = 16;
    let mut values = vec![0.0; SLAB * n[1] * n[2]];
    for x0 in (0..n[0]).step_by(SLAB) {
        let thick = SLAB.min(n[0] - x0);
        let slab = &mut values[..thick * n[1] * n[2]];
        field.frame_values(frame, [x0 as i64, 0, 0], [thick, n[1], n[2]], slab);
        for z in 0..n[2] {
            for y in 0..n[1] {
                for x in 0..thick {
                    let at = x0 + x + n[0] * (y + n[1] * z);
                    residuals[at] = slab[(x * n[1] + y) * n[2] + z] - f64::from(data[at]);
                }
            }
        }
    }
    residuals
}

#[cfg(test)]
mod tests {
    use super::*;
    use bspline::{Aabb, Interval, Jet};
    use glam::{DMat3, DVec3};

    /// `f = x + 10 y + 100 z`.
    struct Ramp;

    impl Field for Ramp {
        fn value(&self, p: DVec3) -> f64 {
            p.dot(DVec3::new(1.0, 10.0, 100.0))
        }
        fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
            (self.value(p), DVec3::new(1.0, 10.0, 100.0))
        }
        fn jet(&self, p: DVec3) -> Jet {
            let (value, gradient) = self.value_gradient(p);
            Jet {
                value,
                gradient,
                hessian: DMat3::ZERO,
            }
        }
        fn bounds(&self, _: &Aabb) -> Interval {
            Interval::EVERYTHING
        }
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        let mut errors: Vec<f64> = (1..=100)
            .rev()
            .map(|i| if i % 2 == 0 { i as f64 } else { -(i as f64) })
            .collect();
        let s = ErrorStatistics::of(&mut errors);
        assert_eq!((s.p95, s.p99, s.max), (95.0, 99.0, 100.0));
        assert!((s.rms - (338350.0f64 / 100.0).sqrt()).abs() < 1e-12);
        assert_eq!(ErrorStatistics::of(&mut []), ErrorStatistics::default());
    }

    #[test]
    fn residuals_keep_the_order_of_the_volume() {
        let n = [19usize, 3, 2];
        let frame = Frame::over(
            &Aabb::new(DVec3::ZERO, DVec3::new(18.0, 2.0, 1.0)),
            [n[0] as u32 - 1, n[1] as u32 - 1, n[2] as u32 - 1],
        );
        let mut data = Vec::new();
        for z in 0..n[2] {
            for y in 0..n[1] {
                for x in 0..n[0] {
                    data.push((x + 10 * y + 100 * z) as f32 - 0.5);
                }
            }
        }
        let r = voxel_residuals(&Ramp, &frame, n, &data);
        for (i, r) in r.iter().enumerate() {
            assert!((r - 0.5).abs() < 1e-12, "voxel {i}: {r}");
        }
    }
}
