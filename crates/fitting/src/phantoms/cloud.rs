use bspline::{Aabb, Field};
use glam::DVec3;

use super::SplitMix64;

/// How a cloud is drawn from a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudOptions {
    /// Points wanted before holes are cut.
    pub count: usize,
    /// Standard deviation of the Gaussian noise on each coordinate of a position; normals stay exact.
    pub noise: f64,
    /// Balls cut out round points of the cloud, each with `hole_share` of the points.
    pub hole_count: usize,
    /// Share of all points in one hole, `0..1`.
    pub hole_share: f64,
    /// Ratio of the largest to the smallest density, along the longest side of the box; 1 is even.
    pub density_ratio: f64,
    /// Seed of all randomness.
    pub seed: u64,
}

impl Default for CloudOptions {
    fn default() -> Self {
        Self {
            count: 20_000,
            noise: 0.0,
            hole_count: 0,
            hole_share: 0.06,
            density_ratio: 1.0,
            seed: 1,
        }
    }
}

/// Points of a zero set with its outward normals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampledCloud {
    /// Positions, with noise if any was asked.
    pub positions: Vec<DVec3>,
    /// Unit normals `-∇f/|∇f|` at the positions before noise.
    pub normals: Vec<DVec3>,
    /// Holes as centre and radius.
    pub holes: Vec<(DVec3, f64)>,
}

/// Distance from the surface within which candidates are drawn, as a share of the box's diagonal.
const BAND: f64 = 0.005;
/// Candidates tried for each point wanted before giving up.
const TRIES: usize = 100_000;

/// Draws points evenly from the zero set of `field` inside `within`.
///
/// Uniform candidates of the box that lie within a thin band of the surface are projected on it by Newton's
/// method, `x ← x - f∇f/|∇f|²`. A candidate counts only if it lies on the normal of its foot and its mirror image
/// sees the same normal, so that each patch of the surface collects the candidates of its own normals and edges are
/// not crowded.
///
/// `None` if the box seems to hold no surface.
pub fn sample_cloud(field: &dyn Field, within: &Aabb, options: &CloudOptions) -> Option<SampledCloud> {
    let mut random = SplitMix64::new(options.seed);
    let (size, longest) = (within.size(), longest_axis(within));
    let band = BAND * size.length();
    let mut cloud = SampledCloud::default();
    let mut tries = 0;
    while cloud.positions.len() < options.count {
        tries += 1;
        if tries > TRIES && tries / TRIES > cloud.positions.len() {
            return None;
        }
        let candidate = within.min + size * random.uniform3();
        let keep = random.uniform();
        let Some((foot, normal)) = project(field, candidate, band) else {
            continue;
        };
        let t = (foot[longest] - within.min[longest]) / size[longest];
        if keep < options.density_ratio.powf(-t.clamp(0.0, 1.0)) {
            cloud.positions.push(foot);
            cloud.normals.push(normal);
        }
    }
    for p in &mut cloud.positions {
        *p += options.noise * random.normal3();
    }
    cut_holes(&mut cloud, options, &mut random);
    Some(cloud)
}

/// Foot and outward normal of `start` on the zero set, if it lies within `band` of it along that normal.
fn project(field: &dyn Field, start: DVec3, band: f64) -> Option<(DVec3, DVec3)> {
    let mut x = start;
    for _ in 0..24 {
        let (f, g) = field.value_gradient(x);
        let g2 = g.length_squared();
        let step = g * (f / g2);
        // Not a number where the gradient vanishes.
        if step.length().is_nan() || step.length() > 2.0 * band {
            return None;
        }
        x -= step;
        if step.length() <= 1e-12 * band {
            let normal = -g / g2.sqrt();
            let offset = start - x;
            let across = offset - normal * offset.dot(normal);
            let is_foot = offset.length() <= band
                && across.length() <= 0.05 * offset.length().max(1e-9 * band)
                // On an edge the mirror image belongs to a face.
                && field.value_gradient(x - offset).1.normalize_or_zero().dot(normal) < -0.99;
            return is_foot.then_some((x, normal));
        }
    }
    None
}

fn longest_axis(b: &Aabb) -> usize {
    let s = b.size();
    (0..3)
        .max_by(|&i, &j| s[i].total_cmp(&s[j]).then(j.cmp(&i)))
        .expect("three axes")
}

/// Cuts balls round random points that are still there, each holding the same share of the original count.
fn cut_holes(cloud: &mut SampledCloud, options: &CloudOptions, random: &mut SplitMix64) {
    let share = (options.hole_share * cloud.positions.len() as f64) as usize;
    for _ in 0..options.hole_count {
        if share == 0 || cloud.positions.len() <= share {
            return;
        }
        let center = cloud.positions[(random.uniform() * cloud.positions.len() as f64) as usize];
        let mut distances: Vec<f64> = cloud.positions.iter().map(|p| p.distance(center)).collect();
        let radius = *distances.select_nth_unstable_by(share, f64::total_cmp).1;
        let keep: Vec<bool> = cloud
            .positions
            .iter()
            .map(|p| p.distance(center) >= radius)
            .collect();
        let mut flags = keep.iter();
        cloud
            .positions
            .retain(|_| *flags.next().expect("one flag a point"));
        let mut flags = keep.iter();
        cloud.normals.retain(|_| *flags.next().expect("one flag a point"));
        cloud.holes.push((center, radius));
    }
}

#[cfg(test)]
mod tests {
    use bspline::{Interval, Jet};
    use glam::DMat3;

    use super::*;

    /// A ball of radius 1 round the origin, by its exact distance.
    struct Ball;

    impl Field for Ball {
        fn value(&self, p: DVec3) -> f64 {
            1.0 - p.length()
        }
        fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
            (self.value(p), -p / p.length())
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

    fn ball(options: CloudOptions) -> SampledCloud {
        sample_cloud(&Ball, &Aabb::new(DVec3::splat(-1.2), DVec3::splat(1.2)), &options).unwrap()
    }

    #[test]
    fn points_lie_on_the_surface_with_its_normals_and_evenly() {
        let cloud = ball(CloudOptions::default());
        assert_eq!(cloud.positions.len(), 20_000);
        for (p, n) in cloud.positions.iter().zip(&cloud.normals) {
            assert!((p.length() - 1.0).abs() < 1e-12);
            assert!(p.distance(*n) < 1e-12);
        }
        // Of an even cloud each octant holds an eighth; 5 standard deviations of the binomial count.
        let in_octant = cloud
            .positions
            .iter()
            .filter(|p| p.cmpgt(DVec3::ZERO).all())
            .count() as f64;
        assert!(
            (in_octant - 2500.0).abs() < 5.0 * (20_000f64 * 0.125 * 0.875).sqrt(),
            "{in_octant}"
        );
    }

    #[test]
    fn noise_has_the_deviation_asked() {
        let cloud = ball(CloudOptions {
            noise: 0.01,
            ..Default::default()
        });
        let square: f64 = cloud.positions.iter().map(|p| (p.length() - 1.0).powi(2)).sum();
        let deviation = (square / cloud.positions.len() as f64).sqrt();
        // The radial error is one component of the noise, up to σ²: 5 standard errors of a deviation.
        assert!(
            (deviation - 0.01).abs() < 5.0 * 0.01 / (2.0 * 20_000f64).sqrt() + 1e-4,
            "{deviation}"
        );
    }

    #[test]
    fn holes_are_empty_and_hold_their_share() {
        let cloud = ball(CloudOptions {
            hole_count: 5,
            ..Default::default()
        });
        assert_eq!(cloud.positions.len(), 20_000 - 5 * 1200);
        assert_eq!(cloud.positions.len(), cloud.normals.len());
        for (center, radius) in &cloud.holes {
            assert!(cloud.positions.iter().all(|p| p.distance(*center) >= *radius));
        }
    }

    #[test]
    fn density_falls_along_the_longest_side_by_the_ratio_asked() {
        let cloud = ball(CloudOptions {
            density_ratio: 30.0,
            ..Default::default()
        });
        let left = cloud.positions.iter().filter(|p| p.x < -0.8).count() as f64;
        let right = cloud.positions.iter().filter(|p| p.x > 0.8).count() as f64;
        // Caps of equal area whose mean densities differ by 30^(1.8/2.4) or so.
        assert!((9.0..18.0).contains(&(left / right)), "{left} / {right}");
    }

    #[test]
    fn the_same_seed_gives_the_same_cloud_and_an_empty_box_none() {
        assert_eq!(ball(CloudOptions::default()), ball(CloudOptions::default()));
        assert_ne!(
            ball(CloudOptions::default()),
            ball(CloudOptions {
                seed: 2,
                ..Default::default()
            })
        );
        let far = Aabb::new(DVec3::splat(5.0), DVec3::splat(6.0));
        assert_eq!(
            sample_cloud(
                &Ball,
                &far,
                &CloudOptions {
                    count: 10,
                    ..Default::default()
                }
            ),
            None
        );
    }
}
