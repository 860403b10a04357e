//! Integrals along paths: adaptive Gauss–Kronrod rules of 7 and 15 nodes \[Piessens83\].

/// A place that an integral reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Arc length.
    pub at: f64,
    /// Its weight; they add up to the length.
    pub weight: f64,
    /// What was read there.
    pub value: f64,
}

/// An integral, with the nodes that it was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Integral {
    /// `Σ weight·value`.
    pub value: f64,
    /// Estimate of its error: what the rules of 7 and 15 nodes differ by.
    pub error: f64,
    /// In the order of the path.
    pub nodes: Vec<Node>,
}

/// How exact an integral has to be: either suffices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Error over the value.
    pub relative: f64,
    /// Error over the length: of the mean.
    pub mean: f64,
}

/// Pieces that a path is cut into at most.
const MOST: usize = 256;

/// Nodes of the rule of 15 on `-1..1`, those above 0 and 0 itself; every second one, from the second on, is of the rule of 7.
const NODES: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_5,
    0.0,
];
const WEIGHTS: [f64; 8] = [
    0.022_935_322_010_529_22,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_2,
    0.140_653_259_715_525_9,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_8,
];
const GAUSS: [f64; 4] = [
    0.129_484_966_168_869_7,
    0.279_705_391_489_276_7,
    0.381_830_050_505_118_9,
    0.417_959_183_673_469_4,
];

struct Piece {
    ends: [f64; 2],
    values: [f64; 15],
    value: f64,
    error: f64,
}

fn piece(f: &mut impl FnMut(f64) -> f64, ends: [f64; 2]) -> Piece {
    let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
    let values: [f64; 15] = std::array::from_fn(|i| f(middle + half * node(i)));
    let (mut fine, mut coarse) = (0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        let (k, g) = weights(i);
        fine += k * value;
        coarse += g * value;
    }
    Piece {
        ends,
        values,
        value: half * fine,
        error: half * (fine - coarse).abs(),
    }
}

fn node(i: usize) -> f64 {
    if i < 8 { -NODES[i] } else { NODES[14 - i] }
}

fn weights(i: usize) -> (f64, f64) {
    let j = i.min(14 - i);
    (WEIGHTS[j], if j % 2 == 1 { GAUSS[j / 2] } else { 0.0 })
}

/// `∫ f` from `a` to `b ≥ a`; the piece with the largest error is halved until the tolerance is met.
pub fn integrate(mut f: impl FnMut(f64) -> f64, a: f64, b: f64, tolerance: Tolerance) -> Integral {
    let mut pieces = vec![piece(&mut f, [a, b])];
    let sum = |pieces: &[Piece]| {
        let of = |part: fn(&Piece) -> f64| pieces.iter().map(part).sum::<f64>();
        (of(|p| p.value), of(|p| p.error))
    };
    let (mut value, mut error) = sum(&pieces);
    while error > (tolerance.relative * value.abs()).max(tolerance.mean * (b - a)) && pieces.len() < MOST {
        let worst = (0..pieces.len())
            .max_by(|i, j| pieces[*i].error.total_cmp(&pieces[*j].error))
            .unwrap_or(0);
        let [from, to] = pieces[worst].ends;
        let middle = 0.5 * (from + to);
        if middle <= from || middle >= to {
            break;
        }
        pieces[worst] = piece(&mut f, [from, middle]);
        pieces.insert(worst + 1, piece(&mut f, [middle, to]));
        (value, error) = sum(&pieces);
    }
    let nodes = pieces.iter().flat_map(|p| {
        let (middle, half) = (0.5 * (p.ends[0] + p.ends[1]), 0.5 * (p.ends[1] - p.ends[0]));
        (0..15).map(move |i| Node {
            at: middle + half * node(i),
            weight: half * weights(i).0,
            value: p.values[i],
        })
    });
    Integral {
        nodes: nodes.collect(),
        value,
        error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIGHT: Tolerance = Tolerance {
        relative: 1e-10,
        mean: 0.0,
    };

    #[test]
    fn polynomials_of_degree_22_are_exact_at_once() {
        for degree in 0..=22 {
            let found = integrate(
                |x| x.powi(degree),
                0.0,
                2.0,
                Tolerance {
                    relative: 1.0,
                    mean: 0.0,
                },
            );
            let exact = 2f64.powi(degree + 1) / f64::from(degree + 1);
            assert!(
                (found.value / exact - 1.0).abs() < 1e-14,
                "{degree}: {}",
                found.value
            );
            assert_eq!(found.nodes.len(), 15);
        }
    }

    #[test]
    fn creases_are_found() {
        let found = integrate(|x| (x - 0.3).abs(), 0.0, 1.0, TIGHT);
        assert!((found.value - 0.29).abs() < 1e-10, "{found:?}");
        let length: f64 = found.nodes.iter().map(|n| n.weight).sum();
        assert!((length - 1.0).abs() < 1e-13);
        assert!(found.nodes.is_sorted_by(|a, b| a.at < b.at));
    }
}
