//! The root of a function along an edge on which it changes sign.

/// Evaluations after which the best estimate is taken; bisection alone then has `2^-16` of the edge.
pub(super) const MAX_EVALUATIONS: u32 = 16;

/// An interval of the edge parameter that holds a root, with the values of `g = f - iso` at its ends.
///
/// One end is inside (`g > 0`), the other is not (`g <= 0` or not a number).
#[derive(Clone, Copy, Debug)]
pub(super) struct Bracket {
    t: [f64; 2],
    g: [f64; 2],
    evaluations: u32,
}

/// What to do after an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// Evaluate there.
    Try(f64),
    /// The root, within the tolerance.
    Found(f64),
    /// The limit of evaluations is reached: the function jumps or is not a number.
    GivenUp(f64),
}

impl Bracket {
    /// The whole edge `[0, 1]`.
    pub fn new(g0: f64, g1: f64) -> Self {
        Self {
            t: [0.0, 1.0],
            g: [g0, g1],
            evaluations: 0,
        }
    }

    /// Root of the straight line through both ends; the middle if a value is not finite.
    pub fn secant(&self) -> f64 {
        let [a, b] = self.t;
        let t = a + (b - a) * (self.g[0] / (self.g[0] - self.g[1]));
        if t.is_finite() {
            t.clamp(a, b)
        } else {
            0.5 * (a + b)
        }
    }

    /// Takes in `g(t)` and `g'(t)` and says how to go on.
    ///
    /// The next estimate is the root of the parabola that touches `g` at `t` and meets it at the end of the
    /// bracket across the root. The parabola changes sign between the two, so it always has a root there: Newton's
    /// step, corrected for curvature, that cannot leave the bracket. A step of Newton's from there follows on the cubic
    /// that meets the other end too.
    ///
    /// The root is accepted without another evaluation once curvature hardly matters to the first step, and the second is
    /// below four times `tolerance`: on smooth fields that is at once, and the error left is of the next order.
    pub fn advance(&mut self, t: f64, g: f64, slope: f64, tolerance: f64) -> Step {
        if g == 0.0 {
            return Step::Found(t);
        }
        self.evaluations += 1;
        let inside = g > 0.0;
        let near = if (self.g[0] > 0.0) == inside { 0 } else { 1 };
        let (behind, behind_g) = (self.t[near] - t, self.g[near]);
        let before = self.t[1] - self.t[0];
        (self.t[near], self.g[near]) = (t, g);
        let width = self.t[1] - self.t[0];
        let middle = 0.5 * (self.t[0] + self.t[1]);
        if self.evaluations == MAX_EVALUATIONS {
            return Step::GivenUp(middle);
        }
        if width <= tolerance {
            return Step::Found(middle);
        }

        let (far_t, far_g) = (self.t[1 - near], self.g[1 - near]);
        let reach = far_t - t;
        let curvature = (far_g - g - slope * reach) / (reach * reach);
        let root = (slope * slope - 4.0 * curvature * g).max(0.0).sqrt();
        let parabola = -2.0 * g
            / if inside == (reach > 0.0) {
                slope - root
            } else {
                slope + root
            };
        let third = (curvature - (behind_g - g - slope * behind) / (behind * behind)) / (reach - behind);
        let second = curvature - third * reach;
        let value = g + parabola * (slope + parabola * (second + parabola * third));
        let correction = value / (slope + parabola * (2.0 * second + 3.0 * parabola * third));
        let step = parabola - correction;
        let next = t + step;
        let within = self.t[0] < next && next < self.t[1];
        // Not a number (from infinite or undefined values) fails this test too.
        if !within {
            return Step::Try(middle);
        }
        let is_straight = step.abs() <= 0.1 && (curvature * parabola * parabola).abs() <= 0.05 * g.abs();
        if step.abs() <= tolerance || (is_straight && correction.abs() <= 4.0 * tolerance) {
            return Step::Found(next);
        }
        // Slow progress from one side: halve instead.
        if self.evaluations > 2 && width > 0.5 * before {
            Step::Try(middle)
        } else {
            Step::Try(next)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs the iteration; returns the root and the evaluations it took.
    fn solve(g: impl Fn(f64) -> (f64, f64), tolerance: f64) -> (Step, u32) {
        let mut bracket = Bracket::new(g(0.0).0, g(1.0).0);
        let mut t = bracket.secant();
        for count in 1.. {
            assert!((0.0..=1.0).contains(&t));
            let (value, slope) = g(t);
            match bracket.advance(t, value, slope, tolerance) {
                Step::Try(next) => t = next,
                done => return (done, count),
            }
        }
        unreachable!()
    }

    #[test]
    fn a_parabola_takes_one_evaluation_when_nearly_straight() {
        // Curvature as of a sphere of 20 cells radius.
        let radius = 20.0;
        for n in 1..50 {
            let root = n as f64 / 50.0;
            let g = |t: f64| {
                let x = t - root;
                (x + x * x / (2.0 * radius), 1.0 + x / radius)
            };
            let (step, count) = solve(g, 1e-4);
            let Step::Found(t) = step else { panic!("{step:?}") };
            assert_eq!(count, 1);
            // A parabola is solved exactly, up to rounding.
            assert!((t - root).abs() < 1e-14, "{t} {root}");
        }
    }

    #[test]
    fn a_gentle_cubic_takes_one_evaluation() {
        for n in 1..50 {
            let root = n as f64 / 50.0;
            let g = |t: f64| {
                let x = t - root;
                (x + 0.02 * x * x + 0.05 * x.powi(3), 1.0 + 0.04 * x + 0.15 * x * x)
            };
            let (step, count) = solve(g, 1e-4);
            let Step::Found(t) = step else { panic!("{step:?}") };
            assert_eq!(count, 1);
            // The parabola alone leaves up to 5e-6.
            assert!((t - root).abs() < 1e-9, "{t} {root}");
        }
    }

    #[test]
    fn hard_functions_are_solved_within_tolerance() {
        // Root, function with slope: steep, flat at the root, flat away from the root, with a kink, wavy.
        let cases: [(f64, &dyn Fn(f64) -> (f64, f64)); 5] = [
            (0.9, &|t| {
                (
                    (40.0 * (t - 0.9)).tanh(),
                    40.0 / (40.0 * (t - 0.9)).cosh().powi(2),
                )
            }),
            (0.3, &|t| ((t - 0.3).powi(3), 3.0 * (t - 0.3).powi(2))),
            (0.8, &|t| (t.powi(9) - 0.8f64.powi(9), 9.0 * t.powi(8))),
            (0.61, &|t| if t < 0.6 { (-0.01, 0.0) } else { (t - 0.61, 1.0) }),
            (0.5, &|t| {
                (
                    t - 0.5 + 0.3 * (12.0 * (t - 0.5)).sin(),
                    1.0 + 3.6 * (12.0 * (t - 0.5)).cos(),
                )
            }),
        ];
        for (n, (root, g)) in cases.into_iter().enumerate() {
            let (step, count) = solve(g, 1e-4);
            let Step::Found(t) = step else {
                panic!("case {n}: {step:?}")
            };
            // At a triple root the steps shrink only by a constant factor: the last one bounds a third of the error.
            let allowed = if n == 1 { 5e-4 } else { 1e-4 };
            assert!((t - root).abs() < allowed, "case {n}: {t} after {count}");
            assert!(count < MAX_EVALUATIONS, "case {n}: {count} evaluations");
        }
    }

    #[test]
    fn jumps_and_undefined_values_end_near_the_change() {
        let (step, count) = solve(|t| (if t > 0.37 { 1.0 } else { -1.0 }, 0.0), 1e-6);
        assert_eq!(count, MAX_EVALUATIONS);
        assert!(
            matches!(step, Step::GivenUp(t) if (t - 0.37).abs() < 1e-3),
            "{step:?}"
        );
        let (step, _) = solve(|t| (if t > 0.37 { 1.0 } else { f64::NAN }, f64::NAN), 1e-4);
        assert!(
            matches!(step, Step::Found(t) if (t - 0.37).abs() < 1e-4),
            "{step:?}"
        );
        let (step, _) = solve(
            |t| {
                (
                    if t > 0.37 {
                        f64::INFINITY
                    } else {
                        f64::NEG_INFINITY
                    },
                    0.0,
                )
            },
            1e-4,
        );
        assert!(
            matches!(step, Step::Found(t) if (t - 0.37).abs() < 1e-4),
            "{step:?}"
        );
    }
}
