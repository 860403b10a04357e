use crate::springs::{Neighbours, SpringWeights, Weights};

/// How stiffness is painted into a cube, from 1 to the contrast.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Pattern {
    /// No paint.
    Uniform,
    /// One half is stiff.
    HalfSpace,
    /// A stiff ball off the centre.
    StiffBall,
    /// A soft ball in stiff surroundings.
    SoftBall,
    /// Three strokes whose stiffness falls off towards their border, as a brush leaves them.
    Brush,
    /// A disc of stiff springs, one sample thick.
    Plate,
    /// A stiff tube with walls of a few samples, filled with struts.
    Bone,
    /// Each spring at random, its logarithm equally distributed.
    Random,
}

impl Pattern {
    /// All that are painted.
    pub const PAINTED: [Self; 7] = [
        Self::HalfSpace,
        Self::StiffBall,
        Self::SoftBall,
        Self::Brush,
        Self::Plate,
        Self::Bone,
        Self::Random,
    ];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::HalfSpace => "half-space",
            Self::StiffBall => "stiff-ball",
            Self::SoftBall => "soft-ball",
            Self::Brush => "brush",
            Self::Plate => "plate",
            Self::Bone => "bone",
            Self::Random => "random",
        }
    }

    /// Exponent of the contrast at a place of the unit cube, whose samples lie `h` apart; `seed` numbers the spring.
    fn exponent(self, [x, y, z]: [f64; 3], h: f64, seed: u64) -> f64 {
        let ball = |cx: f64, cy: f64, cz: f64, r: f64| {
            f64::from((x - cx).powi(2) + (y - cy).powi(2) + (z - cz).powi(2) < r * r)
        };
        match self {
            Self::Uniform => 0.0,
            Self::HalfSpace => f64::from(x < 0.5),
            Self::StiffBall => ball(0.45, 0.5, 0.55, 0.28),
            Self::SoftBall => 1.0 - ball(0.45, 0.5, 0.55, 0.28),
            Self::Brush => {
                let strokes = [
                    ([0.1, 0.2, 0.3], [0.9, 0.4, 0.5]),
                    ([0.3, 0.9, 0.2], [0.5, 0.1, 0.8]),
                    ([0.7, 0.7, 0.1], [0.7, 0.6, 0.9]),
                ];
                let fall = |(a, b)| (1.0 - segment_distance([x, y, z], a, b) / 0.2).max(0.0);
                strokes.into_iter().map(fall).fold(0.0, f64::max)
            }
            Self::Plate => {
                // Both ends of the spring in the plane of samples nearest to the middle.
                let plane = (0.5 / h).round() * h;
                f64::from((x - plane).abs() < 0.25 * h && (y - 0.5).hypot(z - 0.5) < 0.35)
            }
            Self::Bone => {
                let r = (x - 0.5).hypot(y - 0.45);
                let wall = (0.2..0.32).contains(&r);
                let a = std::f64::consts::TAU * 3.0;
                let gyroid = (a * x).sin() * (a * y).cos()
                    + (a * y).sin() * (a * z).cos()
                    + (a * z).sin() * (a * x).cos();
                let strut = r < 0.2 && gyroid.abs() < 0.35 && !(0.3..0.7).contains(&z);
                f64::from(wall || strut)
            }
            Self::Random => unit_random(seed),
        }
    }
}

/// A number in `[0, 1)` from a seed \[Steele14\].
pub(crate) fn unit_random(seed: u64) -> f64 {
    let mut z = seed
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

fn segment_distance(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let sub = |u: [f64; 3], v: [f64; 3]| [u[0] - v[0], u[1] - v[1], u[2] - v[2]];
    let (ab, ap) = (sub(b, a), sub(p, a));
    let t = (dot(ap, ab) / dot(ab, ab)).clamp(0.0, 1.0);
    let foot = sub(ap, ab.map(|c| c * t));
    dot(foot, foot).sqrt()
}

/// Springs on a cube of `m` samples an axis, at their middles painted with `contrast` to the exponent of the pattern.
pub fn spring_weights(
    pattern: Pattern,
    contrast: f64,
    m: usize,
    neighbours: Neighbours,
    scale: f64,
) -> Vec<SpringWeights<f64>> {
    let h = 1.0 / (m - 1) as f64;
    let springs = neighbours
        .directions()
        .into_iter()
        .enumerate()
        .map(|(n, direction)| {
            if pattern == Pattern::Uniform {
                let weights = Weights::Constant(scale * direction.share);
                return SpringWeights { direction, weights };
            }
            let weight = |s: usize| {
                let at = [s / (m * m), s / m % m, s % m];
                let middle: [f64; 3] =
                    std::array::from_fn(|a| (at[a] as f64 + 0.5 * direction.step[a] as f64) * h);
                let seed = (s * 31 + n) as u64;
                scale * direction.share * contrast.powf(pattern.exponent(middle, h, seed))
            };
            let weights = Weights::Each((0..m * m * m).map(weight).collect());
            SpringWeights { direction, weights }
        });
    springs.collect()
}

/// Impulses on the samples of a cube: a tool in one material, one in the other, and smooth momentum.
pub fn loads(m: usize) -> [Vec<f64>; 3] {
    let gauss = |c: [f64; 3]| {
        let r = 1.5 / (m - 1) as f64;
        move |p: [f64; 3]| {
            let d2: f64 = (0..3).map(|a| (p[a] - c[a]).powi(2)).sum();
            (-0.5 * d2 / (r * r)).exp()
        }
    };
    let field = |f: &dyn Fn([f64; 3]) -> f64| {
        let h = 1.0 / (m - 1) as f64;
        let at = |s: usize| f([s / (m * m), s / m % m, s % m].map(|i| i as f64 * h));
        (0..m * m * m).map(at).collect::<Vec<_>>()
    };
    [
        field(&gauss([0.42, 0.48, 0.52])),
        field(&gauss([0.78, 0.3, 0.7])),
        field(&|[x, y, z]| (1.3 * x + 0.4).sin() * (2.1 * y - 0.3).cos() * (1.0 + z * z)),
    ]
}

/// Masses of a cube from 1 to `contrast`, each at random, its logarithm equally distributed.
pub fn random_masses(m: usize, contrast: f64) -> Vec<f64> {
    let count = (m * m * m) as u64;
    (0..count)
        .map(|i| contrast.powf(unit_random(i ^ 0x00C0_FFEE)))
        .collect()
}
