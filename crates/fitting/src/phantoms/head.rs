use super::SplitMix64;

/// Ellipsoids of the modified Shepp–Logan head in three dimensions: density added, half axes, centre in the cube
/// `[-1, 1]³`, turn about z in degrees [Shepp74; contrasts Toft96; third axis Schabel06].
const ELLIPSOIDS: [(f64, [f64; 3], [f64; 3], f64); 10] = [
    (1.0, [0.69, 0.92, 0.81], [0.0, 0.0, 0.0], 0.0),
    (-0.8, [0.6624, 0.874, 0.78], [0.0, -0.0184, 0.0], 0.0),
    (-0.2, [0.11, 0.31, 0.22], [0.22, 0.0, 0.0], -18.0),
    (-0.2, [0.16, 0.41, 0.28], [-0.22, 0.0, 0.0], 18.0),
    (0.1, [0.21, 0.25, 0.41], [0.0, 0.35, -0.15], 0.0),
    (0.1, [0.046, 0.046, 0.05], [0.0, 0.1, 0.25], 0.0),
    (0.1, [0.046, 0.046, 0.05], [0.0, -0.1, 0.25], 0.0),
    (0.1, [0.046, 0.023, 0.05], [-0.08, -0.605, 0.0], 0.0),
    (0.1, [0.023, 0.023, 0.02], [0.0, -0.606, 0.0], 0.0),
    (0.1, [0.023, 0.046, 0.02], [0.06, -0.605, 0.0], 0.0),
];

/// Densities of a Shepp–Logan-like head that fills a volume of `dims` voxels, x fastest: 0 outside, 1 in the
/// skull, 0.2 in the brain. Edges are linear over one voxel, as a scanner's partial volumes make them.
///
/// `noise` is the standard deviation of white normal noise, drawn from `seed`; 0 for none.
///
/// # Panics
/// If an axis has no voxel.
pub fn head(dims: [usize; 3], noise: f64, seed: u64) -> Vec<f32> {
    assert!(!dims.contains(&0), "a head of {dims:?} voxels");
    let mut random = SplitMix64::new(seed);
    let voxel = 2.0 / dims.into_iter().max().expect("three axes") as f64;
    let center = |i: usize, n: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
    let mut values = Vec::with_capacity(dims.iter().product());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let p = [center(x, dims[0]), center(y, dims[1]), center(z, dims[2])];
                let clean: f64 = ELLIPSOIDS
                    .iter()
                    .map(|(density, half, middle, turn)| density * inside(p, *half, *middle, *turn, voxel))
                    .sum();
                let error = if noise > 0.0 { noise * random.normal() } else { 0.0 };
                values.push((clean + error) as f32);
            }
        }
    }
    values
}

/// Share of a voxel at `p` that lies in an ellipsoid, by its distance to first order.
fn inside(p: [f64; 3], half: [f64; 3], middle: [f64; 3], turn: f64, voxel: f64) -> f64 {
    let (sin, cos) = turn.to_radians().sin_cos();
    let d = [p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]];
    let local = [cos * d[0] + sin * d[1], cos * d[1] - sin * d[0], d[2]];
    let q = [local[0] / half[0], local[1] / half[1], local[2] / half[2]];
    let level = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]).sqrt();
    let g = [q[0] / half[0], q[1] / half[1], q[2] / half[2]];
    let slope = (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt() / level.max(1e-12);
    (0.5 + (1.0 - level) / (slope.max(1e-12) * voxel)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_are_those_of_skull_brain_and_air() {
        let dims = [64, 64, 64];
        let values = head(dims, 0.0, 0);
        let at = |x: usize, y: usize, z: usize| values[x + 64 * (y + 64 * z)];
        assert_eq!(at(0, 0, 0), 0.0, "air");
        assert!((at(32, 60, 32) - 1.0).abs() < 1e-6, "skull: {}", at(32, 60, 32));
        assert!((at(32, 20, 32) - 0.2).abs() < 1e-6, "brain: {}", at(32, 20, 32));
        assert!(at(39, 32, 32).abs() < 1e-6, "ventricle: {}", at(39, 32, 32));
    }

    #[test]
    fn noise_is_seeded() {
        let dims = [20, 17, 9];
        assert_eq!(head(dims, 0.1, 7), head(dims, 0.1, 7));
        assert_ne!(head(dims, 0.1, 7), head(dims, 0.1, 8));
    }
}
