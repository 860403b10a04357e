//! Where a body slides whose contacts rub with given strengths: Newton's method on a convex function.
//!
//! `½|w|² + Σ gᵢ ψ(|Tᵢ(u + w)|)` is least, ψ the length, but for slips below a width ε its square over 2ε \[Huber64\]. The width falls
//! from that of the slips themselves to [`SOFT`], so every step begins near its end; whatever sticks then still slips by less than that.

use super::projection::{Twist, add, dot};

/// Slip below which friction is softened, mm.
pub(super) const SOFT: f64 = 1e-6;
/// Widths of the softening, from the widest on, over the one before.
const NARROWER: f64 = 0.03;
/// Steps at most with a width.
const STEPS: usize = 12;
/// Steps at most from what is expected.
const TRIES: usize = 4;
/// Halvings of a step at most.
const HALVINGS: usize = 20;
/// Length of a step that ends them, over the width.
const DONE: f64 = 1e-2;

/// What a contact does against slipping.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rubs {
    /// Largest friction, mm.
    pub most: f64,
    /// Slip along each tangent for a twist.
    pub slips: [Twist; 2],
    /// The parts of these that the contacts leave free.
    pub yields: [Twist; 2],
}

impl Rubs {
    fn slip(&self, u: &Twist) -> [f64; 2] {
        [dot(&self.slips[0], u), dot(&self.slips[1], u)]
    }
}

/// Frictions of contacts when the body would go to `free` without them. The largest change of one, mm.
/// `frictions` are what they are expected to be, and then are.
pub(super) fn slide<'a>(
    free: &Twist,
    expected: &Twist,
    rubs: &[Rubs],
    frictions: impl Iterator<Item = &'a mut [f64; 2]>,
) -> f64 {
    let mut u = *expected;
    let mut width = SOFT;
    if !settle(free, &mut u, rubs, SOFT, TRIES) {
        u = *free;
        width = rubs.iter().map(|r| length(r.slip(free))).fold(SOFT, f64::max);
        while width > SOFT {
            settle(free, &mut u, rubs, width, STEPS);
            width = (NARROWER * width).max(SOFT);
        }
        settle(free, &mut u, rubs, width, STEPS);
    }
    let mut most = 0.0f64;
    for (friction, rub) in frictions.zip(rubs) {
        let slip = rub.slip(&u);
        let share = -rub.most / length(slip).max(width);
        let new = slip.map(|t| share * t);
        most = most.max(length([new[0] - friction[0], new[1] - friction[1]]));
        *friction = new;
    }
    most
}

fn length(t: [f64; 2]) -> f64 {
    (t[0] * t[0] + t[1] * t[1]).sqrt()
}

/// Goes where the function is least. Whether it got there.
fn settle(free: &Twist, u: &mut Twist, rubs: &[Rubs], width: f64, steps: usize) -> bool {
    let mut now = value(free, u, rubs, width);
    for _ in 0..steps {
        if step(free, u, rubs, width, &mut now) {
            return true;
        }
    }
    false
}

/// The function, with a width.
fn value(free: &Twist, u: &Twist, rubs: &[Rubs], width: f64) -> f64 {
    let mut sum = 0.0;
    for k in 0..6 {
        sum += 0.5 * (u[k] - free[k]) * (u[k] - free[k]);
    }
    for rub in rubs.iter().filter(|r| r.most > 0.0) {
        let t = length(rub.slip(u));
        sum += rub.most
            * if t > width {
                t - 0.5 * width
            } else {
                0.5 * t * t / width
            };
    }
    sum
}

/// A step of Newton's method, shortened until it leads down; whether it is too short to matter. `now` is the function there.
fn step(free: &Twist, u: &mut Twist, rubs: &[Rubs], width: f64, now: &mut f64) -> bool {
    let mut matrix = [[0.0; 6]; 6];
    let mut down: Twist = std::array::from_fn(|k| free[k] - u[k]);
    for (k, row) in matrix.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    for rub in rubs.iter().filter(|r| r.most > 0.0) {
        let t = rub.slip(u);
        let size = length(t);
        let stiff = rub.most / size.max(width);
        for k in 0..2 {
            add(&mut down, -stiff * t[k], &rub.yields[k]);
            add_square(&mut matrix, stiff, &rub.yields[k]);
        }
        if size > width {
            // Along the slip friction does not grow; a little is left, so that long steps are not too long.
            let along: Twist =
                std::array::from_fn(|k| (t[0] * rub.yields[0][k] + t[1] * rub.yields[1][k]) / size);
            add_square(&mut matrix, -stiff, &along);
        }
    }
    let mut way = solved(&mut matrix, &down);
    let is_short = dot(&way, &way).sqrt() < DONE * width;
    for _ in 0..HALVINGS {
        let there = std::array::from_fn(|k| u[k] + way[k]);
        let then = value(free, &there, rubs, width);
        if then <= *now {
            (*u, *now) = (there, then);
            break;
        }
        way = way.map(|w| 0.5 * w);
    }
    is_short
}

fn add_square(matrix: &mut [[f64; 6]; 6], share: f64, a: &Twist) {
    for (row, x) in matrix.iter_mut().zip(a) {
        add(row, share * x, a);
    }
}

/// By the factors of Cholesky; the matrix is the identity and what is not negative.
fn solved(matrix: &mut [[f64; 6]; 6], right: &Twist) -> Twist {
    let mut x = *right;
    for j in 0..6 {
        for k in 0..j {
            let part = matrix[j][k];
            for i in j..6 {
                matrix[i][j] -= part * matrix[i][k];
            }
        }
        let root = matrix[j][j].max(1e-3).sqrt();
        for i in j..6 {
            matrix[i][j] /= root;
        }
        matrix[j][j] = root;
        for k in 0..j {
            x[j] -= matrix[j][k] * x[k];
        }
        x[j] /= root;
    }
    for j in (0..6).rev() {
        for i in j + 1..6 {
            x[j] -= matrix[i][j] * x[i];
        }
        x[j] /= matrix[j][j];
    }
    x
}
