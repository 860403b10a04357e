//! The forces of a step: `(C + diag(s)) T = e`, with `C` known only by what it does to a vector.
//!
//! `C_jl` is what a unit of force on path `l` moves path `j` by within the step, `e_j` what path `j` is short of, and `s_j`
//! how soft its rule is. GMRES \[Saad86\] with few steps, preconditioned with the row sums of `C` over the weights of the
//! paths.

/// What is solved for, as changes of `T`.
pub struct Solved<R> {
    /// Change of each force.
    pub forces: Vec<f64>,
    /// How much of each response that was asked for is in the answer.
    pub parts: Vec<(f64, R)>,
    /// Residual over the right side.
    pub residual: f64,
}

/// Solves in at most `most` steps, or to the residual `enough`. `respond` gives, for forces, what it will be told of, and `C`
/// times the forces.
///
/// # Errors
/// What `respond` says.
pub fn solve<R, E>(
    right: &[f64],
    soft: &[f64],
    diagonal: &[f64],
    most: usize,
    enough: f64,
    mut respond: impl FnMut(&[f64]) -> Result<(R, Vec<f64>), E>,
) -> Result<Solved<R>, E> {
    let n = right.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let size = dot(right, right).sqrt();
    let mut solved = Solved {
        forces: vec![0.0; n],
        parts: Vec::new(),
        residual: 0.0,
    };
    if !(size > 0.0 && size.is_finite()) {
        return Ok(solved);
    }
    let mut basis = vec![right.iter().map(|r| r / size).collect::<Vec<_>>()];
    let mut tried: Vec<Vec<f64>> = Vec::new();
    let mut responses = Vec::new();
    // The triangle that rotations make of the Hessenberg matrix, column by column, and of the right side.
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut rotations: Vec<(f64, f64)> = Vec::new();
    let mut turned = vec![size];
    for step in 0..most.min(n) {
        let z: Vec<f64> = basis[step].iter().zip(diagonal).map(|(v, d)| v / d).collect();
        let (response, mut w) = respond(&z)?;
        for i in 0..n {
            w[i] += soft[i] * z[i];
        }
        let mut column = Vec::with_capacity(step + 2);
        for v in &basis {
            let h = dot(&w, v);
            w.iter_mut().zip(v).for_each(|(w, v)| *w -= h * v);
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
        if turned[step + 1].abs() <= enough * size || left <= f64::EPSILON * length {
            break;
        }
        basis.push(w.iter().map(|w| w / left).collect());
    }
    let count = columns.len();
    let mut shares = vec![0.0; count];
    for i in (0..count).rev() {
        let known: f64 = (i + 1..count).map(|j| columns[j][i] * shares[j]).sum();
        shares[i] = (turned[i] - known) / columns[i][i];
    }
    for (share, z) in shares.iter().zip(&tried) {
        solved.forces.iter_mut().zip(z).for_each(|(f, z)| *f += share * z);
    }
    solved.residual = turned[count].abs() / size;
    solved.parts = shares.into_iter().zip(responses).collect();
    Ok(solved)
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
        let diagonal = [2.0, 2.2, 2.4, 2.4, 2.2, 2.0];
        let mut last = 1.0;
        for most in 1..=n {
            let respond = |z: &[f64]| {
                let w = (0..n).map(|i| (0..n).map(|j| c(i, j) * z[j]).sum()).collect();
                Ok::<_, ()>(((), w))
            };
            let solved = solve(&right, &soft, &diagonal, most, 0.0, respond).unwrap();
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
        assert!(last < 1e-13, "{last}");
    }
}
