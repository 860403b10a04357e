//! The forces of a step: `(C + diag(s)) T = e`, with `C` known only by what it does to a vector.
//!
//! `C_jl` is what a unit of force on path `l` moves path `j` by within the step, `e_j` what path `j` is short of, and `s_j`
//! how soft its rule is. GMRES \[Saad86\] with few steps, preconditioned with what forces move [roughly](super::rough), and with
//! what the steps before found of `C`, which changes little from one to the next.

use super::rough::Rough;

/// Pairs of forces and what they moved that are kept.
const KEPT: usize = 12;
/// Residual, over the right side, that is none.
const EXACT: f64 = 1e-4;
/// Share of a pair that has to be new for it to tell anything.
const NEW: f64 = 0.1;

/// What solves of nearly the same system found.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    paths: Vec<usize>,
    /// Forces, and `C + diag(s)` times them, the oldest first.
    pairs: Vec<[Vec<f64>; 2]>,
    /// What they move, roughly.
    pub rough: Option<Rough>,
}

impl Memory {
    /// Forgets what was of other paths.
    pub fn turn_to(&mut self, paths: Vec<usize>) {
        if self.paths != paths {
            *self = Self {
                paths,
                ..Self::default()
            };
        }
    }

    fn keep(&mut self, forces: &[f64], moved: &[f64]) {
        if self.pairs.len() == KEPT {
            self.pairs.remove(0);
        }
        self.pairs.push([forces.to_vec(), moved.to_vec()]);
    }

    /// Combinations of the pairs whose second parts are orthonormal; of what was found twice the last counts.
    fn basis(&self) -> Vec<[Vec<f64>; 2]> {
        let mut basis: Vec<[Vec<f64>; 2]> = Vec::new();
        for [forces, moved] in self.pairs.iter().rev() {
            let (mut z, mut w) = (forces.clone(), moved.clone());
            let whole = dot(&w, &w).sqrt();
            for [of, known] in &basis {
                let share = dot(&w, known);
                add(&mut w, -share, known);
                add(&mut z, -share, of);
            }
            let left = dot(&w, &w).sqrt();
            if left > NEW * whole && left.is_finite() {
                w.iter_mut().chain(&mut z).for_each(|v| *v /= left);
                basis.push([z, w]);
            }
        }
        basis
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(to: &mut [f64], share: f64, what: &[f64]) {
    to.iter_mut().zip(what).for_each(|(t, w)| *t += share * w);
}

/// What is solved for, as changes of `T`.
pub struct Solved<R> {
    /// Change of each force.
    pub forces: Vec<f64>,
    /// How much of each response that was asked for is in the answer.
    pub parts: Vec<(f64, R)>,
    /// Residual over the right side.
    pub residual: f64,
}

/// Solves in at most `most` steps, or until no path is short of more than is `enough` for it. `respond` gives, for forces, what it will be told of, and `C`
/// times the forces.
///
/// # Errors
/// What `respond` says.
pub fn solve<R, E>(
    right: &[f64],
    soft: &[f64],
    rough: &Rough,
    most: usize,
    enough: &[f64],
    memory: &mut Memory,
    mut respond: impl FnMut(&[f64]) -> Result<(R, Vec<f64>), E>,
) -> Result<Solved<R>, E> {
    let n = right.len();
    let size = dot(right, right).sqrt();
    let mut solved = Solved {
        forces: vec![0.0; n],
        parts: Vec::new(),
        residual: 0.0,
    };
    if !(size > 0.0 && size.is_finite()) {
        return Ok(solved);
    }
    let known = memory.basis();
    let mut images: Vec<Vec<f64>> = Vec::new();
    let mut basis = vec![right.iter().map(|r| r / size).collect::<Vec<_>>()];
    let mut tried: Vec<Vec<f64>> = Vec::new();
    let mut responses = Vec::new();
    // The triangle that rotations make of the Hessenberg matrix, column by column, and of the right side.
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut rotations: Vec<(f64, f64)> = Vec::new();
    let mut turned = vec![size];
    for step in 0..most.min(n) {
        let mut z = vec![0.0; n];
        let mut v = basis[step].clone();
        for [forces, moved] in &known {
            let share = dot(&v, moved);
            add(&mut v, -share, moved);
            add(&mut z, share, forces);
        }
        add(&mut z, 1.0, &rough.solve(&v));
        let (response, mut w) = respond(&z)?;
        for i in 0..n {
            w[i] += soft[i] * z[i];
        }
        memory.keep(&z, &w);
        images.push(w.clone());
        let mut column = Vec::with_capacity(step + 2);
        for v in &basis {
            let h = dot(&w, v);
            add(&mut w, -h, v);
            column.push(h);
        }
        let left = dot(&w, &w).sqrt();
        for (i, (c, s)) in rotations.iter().enumerate() {
            let [a, b] = [column[i], column[i + 1]];
            (column[i], column[i + 1]) = (c * a + s * b, c * b - s * a);
        }
        let length = (column[step] * column[step] + left * left).sqrt();
        if !(length > 0.0 && length.is_finite()) {
            break;
        }
        let (c, s) = (column[step] / length, left / length);
        column[step] = length;
        let last = turned[step];
        turned[step] = c * last;
        turned.push(-s * last);
        rotations.push((c, s));
        columns.push(column);
        tried.push(z);
        responses.push(response);
        let mut short = right.to_vec();
        for (share, moved) in shares(&columns, &turned).iter().zip(&images) {
            add(&mut short, -share, moved);
        }
        let is_enough = short.iter().zip(enough).all(|(s, e)| s.abs() <= *e);
        if is_enough || turned[step + 1].abs() <= EXACT * size || left <= f64::EPSILON * length {
            break;
        }
        basis.push(w.iter().map(|w| w / left).collect());
    }
    let count = columns.len();
    let shares = shares(&columns, &turned);
    for (share, z) in shares.iter().zip(&tried) {
        add(&mut solved.forces, *share, z);
    }
    solved.residual = turned[count].abs() / size;
    solved.parts = shares.into_iter().zip(responses).collect();
    Ok(solved)
}

/// What of each step is in the answer.
fn shares(columns: &[Vec<f64>], turned: &[f64]) -> Vec<f64> {
    let count = columns.len();
    let mut shares = vec![0.0; count];
    for i in (0..count).rev() {
        let known: f64 = (i + 1..count).map(|j| columns[j][i] * shares[j]).sum();
        shares[i] = (turned[i] - known) / columns[i][i];
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With as many steps as unknowns it is a direct solve; with fewer the residual told is the true one.
    #[test]
    fn residuals_are_true_and_fall_to_rounding() {
        let n = 6;
        let c =
            |i: usize, j: usize| 1.0 / (1.0 + (i as f64 - j as f64).abs()) + if i > j { 0.1 } else { 0.0 };
        let right: Vec<f64> = (0..n).map(|i| (i as f64 - 1.5).sin()).collect();
        let soft = [0.01; 6];
        let rough = Rough::Diagonal(vec![2.0, 2.2, 2.4, 2.4, 2.2, 2.0]);
        let mut last = 1.0;
        for most in 1..=n {
            let respond = |z: &[f64]| {
                let w = (0..n).map(|i| (0..n).map(|j| c(i, j) * z[j]).sum()).collect();
                Ok::<_, ()>(((), w))
            };
            let solved = solve(
                &right,
                &soft,
                &rough,
                most,
                &[0.0; 6],
                &mut Memory::default(),
                respond,
            )
            .unwrap();
            let left = |i: usize| {
                let own: f64 = (0..n).map(|j| c(i, j) * solved.forces[j]).sum();
                right[i] - own - soft[i] * solved.forces[i]
            };
            let norm = |f: &dyn Fn(usize) -> f64| (0..n).map(|i| f(i).powi(2)).sum::<f64>().sqrt();
            let residual = norm(&left) / norm(&|i| right[i]);
            assert!((residual - solved.residual).abs() < 1e-12, "{most}: {residual}");
            assert!(residual <= last * (1.0 + 1e-9));
            last = residual;
        }
        assert!(last < 2.0 * EXACT, "{last}");
    }

    /// Across a border of stiffness, where row sums say little, a system that changes from time to time is solved faster
    /// with what was found of it before.
    #[test]
    fn what_was_found_before_saves_steps() {
        let n = 40;
        let right: Vec<f64> = (0..n).map(|i| 1.0 + 0.1 * (i as f64).sin()).collect();
        let counts = |remembers: bool| -> Vec<usize> {
            let mut memory = Memory::default();
            let one = |round: i32| {
                let gives = |i: usize| -> f64 { if i < n / 2 { 0.01 } else { 1.0 } };
                let c = |i: usize, j: usize| -> f64 {
                    let far = (i as f64 - j as f64) / (4.0 + 0.02 * f64::from(round));
                    (gives(i) * gives(j)).sqrt() * (-far * far).exp()
                };
                let sums: Vec<f64> = (0..n).map(|i| (0..n).map(|j| c(i, j)).sum()).collect();
                let soft: Vec<f64> = sums.iter().map(|s| 0.01 * s).collect();
                let respond = |z: &[f64]| {
                    let w = (0..n).map(|i| (0..n).map(|j| c(i, j) * z[j]).sum()).collect();
                    Ok::<_, ()>(((), w))
                };
                if !remembers {
                    memory = Memory::default();
                }
                let rough = Rough::Diagonal(sums);
                solve(&right, &soft, &rough, 30, &[0.01; 40], &mut memory, respond)
            };
            let solved = (0..6).map(one).map(Result::unwrap);
            solved.map(|s| s.parts.len()).collect()
        };
        let (with, without) = (counts(true), counts(false));
        println!("{with:?} {without:?}");
        assert!(with[5] < without[5] / 2, "{with:?} {without:?}");
    }
}
