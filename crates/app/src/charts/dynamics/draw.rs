//! The charts of what was measured.

use super::{Cost, Line, Profile};
use crate::charts::{Chart, Series};

/// Lowest error drawn, relative to the largest.
const DEPTH: f64 = 1e-9;

/// Adds a point to the series of a name, which is made when it comes first.
fn add(series: &mut Vec<Series>, name: &str, point: (f64, f64, String)) {
    if !series.iter().any(|s| s.name == name) {
        series.push(Series {
            name: name.into(),
            points: Vec::new(),
        });
    }
    let found = series.iter_mut().find(|s| s.name == name);
    found.expect("just made").points.push(point);
}

/// What the source paper has: its eq. 12 and two plain iterations.
fn is_paper(l: &Line) -> bool {
    l.preconditioner == "none" && l.iterations == 2
}

fn solver(l: &Line) -> &'static str {
    match l.preconditioner {
        "none" => "plain CG",
        "scaled-diagonalization" => "scaled diagonalization",
        _ => "default",
    }
}

impl Chart {
    /// All charts of steps with the names of their files, of those that have lines.
    pub fn of_steps(lines: &[Line]) -> Vec<(String, Self)> {
        let mut charts = vec![
            ("table2".into(), Self::of_table2(lines)),
            ("materials".into(), Self::of_materials(lines)),
            ("steps".into(), Self::of_step_sizes(lines)),
        ];
        for contrast in [100.0, 1e4] {
            let name = format!("solvers-{contrast}");
            charts.push((name, Self::of_solvers(lines, contrast)));
        }
        charts.retain(|(_, c)| c.series.iter().any(|s| !s.points.is_empty()));
        charts
    }

    /// Error against time over the iterations, of each solver; two plain iterations are the paper's.
    fn of_solvers(lines: &[Line], contrast: f64) -> Self {
        let mut series = Vec::new();
        let mut size = (0, 0);
        let of = lines
            .iter()
            .filter(|l| l.contrast == contrast && l.integrator == "paper");
        // Solvers were compared where plain iterations were made.
        let sizes: Vec<_> = lines
            .iter()
            .filter(|l| l.preconditioner == "none")
            .map(key)
            .collect();
        for l in of.filter(|l| sizes.contains(&key(l))) {
            size = (l.coefficients, l.samples);
            let (ms, label) = (1e3 * l.step_seconds, l.iterations.to_string());
            let name = format!("{}, {}", solver(l), l.precision);
            // Six colours are told apart.
            if name != "scaled diagonalization, f64" {
                add(&mut series, &name, (ms, l.increment_error, label));
            }
            if is_paper(l) && l.precision == "f32" {
                let point = (ms, l.increment_error, String::new());
                add(&mut series, "plain CG, 2 iterations (the paper)", point);
            }
        }
        Self {
            title: format!(
                "error of the increment over iterations: stiff ball {contrast}:1, {}³/{}³, Δt 30 × explicit limit",
                size.0, size.1
            ),
            x_title: "processor time of a step, ms".into(),
            y_title: "‖A(x − x*)‖/‖Ax*‖, worst of three loads".into(),
            depth: DEPTH,
            is_joined: true,
            series,
        }
    }

    /// The sizes of the paper's Table 2, uniform material.
    fn of_table2(lines: &[Line]) -> Self {
        let mut series = Vec::new();
        let uniform = lines.iter().filter(|l| {
            l.pattern == "uniform" && l.law == "linear" && l.integrator == "paper" && l.precision == "f32"
        });
        let sizes: Vec<_> = lines
            .iter()
            .filter(|l| l.preconditioner == "none")
            .map(key)
            .collect();
        for l in uniform.filter(|l| sizes.contains(&key(l))) {
            let name = match (solver(l), l.iterations) {
                ("plain CG", 2) => "plain CG, 2 iterations (the paper)",
                ("plain CG", 8) => "plain CG, 8 iterations",
                ("default", _) => "default",
                _ => continue,
            };
            let name = format!("{name}, Δt {} ×", l.dt_over_limit);
            let label = format!("{}/{}", l.coefficients, l.samples);
            let point = (1e3 * l.step_seconds, l.increment_error, label);
            let repeated = |s: &Series| s.name == name && s.points.iter().any(|p| p.2 == point.2);
            if !series.iter().any(repeated) {
                add(&mut series, &name, point);
            }
        }
        Self {
            title: "sizes of the paper's Table 2, uniform material, eq. 12, f32".into(),
            x_title: "processor time of a step, ms".into(),
            y_title: "error of the increment, ‖A(x − x*)‖/‖Ax*‖".into(),
            depth: DEPTH,
            is_joined: true,
            series,
        }
    }

    /// The worst default step of all patterns over the contrast.
    fn of_materials(lines: &[Line]) -> Self {
        let mut series: Vec<Series> = Vec::new();
        for l in lines
            .iter()
            .filter(|l| l.default && l.contrast > 1.0 && l.dt_over_limit >= 30.0)
        {
            let rim = if l.pattern.ends_with("fixed") {
                ", rim fixed"
            } else {
                ""
            };
            let name = format!("{}/{}{rim}", l.coefficients, l.samples);
            let label = l.pattern.trim_end_matches(", rim fixed").to_string();
            add(&mut series, &name, (l.contrast, l.increment_error, label));
        }
        for s in &mut series {
            let mut worst: Vec<(f64, f64, String)> = Vec::new();
            for p in s.points.drain(..) {
                match worst.iter_mut().find(|w| w.0 == p.0) {
                    Some(w) if w.1 < p.1 => *w = p,
                    Some(_) => (),
                    None => worst.push(p),
                }
            }
            worst.sort_by(|a, b| a.0.total_cmp(&b.0));
            s.points = worst;
        }
        Self {
            title: "default step, f32, Δt 30 × explicit limit: the worst pattern".into(),
            x_title: "contrast of stiffness".into(),
            y_title: "error of the increment, ‖A(x − x*)‖/‖Ax*‖".into(),
            depth: DEPTH,
            is_joined: true,
            series,
        }
    }

    /// The default solver over the length of the step, by scheme and law.
    fn of_step_sizes(lines: &[Line]) -> Self {
        let mut series: Vec<Series> = Vec::new();
        let of = lines.iter().filter(|l| {
            l.pattern == "stiff-ball, rim fixed"
                && l.contrast == 100.0
                && l.precision == "f32"
                && l.integrator != "symplectic"
        });
        let size = of.clone().map(|l| l.samples).min();
        for l in of.filter(|l| Some(l.samples) == size) {
            let name = format!("{}, {}", l.integrator, l.law);
            let repeated = |s: &Series| s.name == name && s.points.iter().any(|p| p.0 == l.dt_over_limit);
            if !series.iter().any(repeated) {
                let label = format!("{:.2} ms", 1e3 * l.step_seconds);
                add(&mut series, &name, (l.dt_over_limit, l.increment_error, label));
            }
        }
        for s in &mut series {
            s.points.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        Self {
            title: "default solver, stiff ball 100:1, rim fixed, f32".into(),
            x_title: "step over the explicit limit".into(),
            y_title: "error of the increment, ‖A(x − x*)‖/‖Ax*‖".into(),
            depth: DEPTH,
            is_joined: true,
            series,
        }
    }

    /// Anisotropy over sampling, and how far the mean width is from that of the finest sampling.
    pub fn of_sampling(profiles: &[Profile]) -> [(String, Self); 2] {
        let mut charts = [Vec::new(), Vec::new()];
        let finest = profiles.iter().map(|p| p.samples_per_radius).fold(0.0, f64::max);
        for p in profiles {
            let name = format!("{}, {} neighbours", p.law, p.neighbours);
            let x = p.samples_per_radius;
            add(&mut charts[0], &name, (x, 100.0 * p.anisotropy(), String::new()));
            let same = |q: &&Profile| {
                q.law == p.law && q.neighbours == p.neighbours && q.samples_per_radius == finest
            };
            if x < finest
                && let Some(best) = profiles.iter().find(same)
            {
                let off = (p.mean() / best.mean() - 1.0).abs();
                add(&mut charts[1], &name, (x, 100.0 * off, String::new()));
            }
        }
        let [anisotropy, drift] = charts;
        let chart = |title: &str, y_title: String, series| Self {
            title: title.into(),
            x_title: "samples per standard deviation of the force".into(),
            y_title,
            depth: 1e-6,
            is_joined: true,
            series,
        };
        [
            (
                "anisotropy".into(),
                chart(
                    "width of a bump at rest, planes 100, 110 and 111",
                    "widest over narrowest − 1, %".into(),
                    anisotropy,
                ),
            ),
            (
                "drift".into(),
                chart(
                    "width of a bump at rest over sampling",
                    format!("mean width off that at {finest:.1} samples, %"),
                    drift,
                ),
            ),
        ]
    }

    /// Cost of a sample over the size of a patch.
    pub fn of_cost(costs: &[Cost]) -> Self {
        let mut series = Vec::new();
        for c in costs {
            let label = || format!("{}³", c.samples);
            let x = c.samples.pow(3) as f64;
            add(&mut series, "springs, A and Aᵀ", (x, 1e9 * c.operators, label()));
            add(&mut series, "step, even material", (x, 1e9 * c.even, label()));
            if let Some(painted) = c.painted {
                add(&mut series, "step, stiff ball 100:1", (x, 1e9 * painted, label()));
            }
        }
        Self {
            title: "cost of a sample of a patch awake: eq. 12, f32, rim fixed, 4/3 samples per cell".into(),
            x_title: "samples".into(),
            y_title: "processor time per sample, ns".into(),
            depth: 1e-5,
            is_joined: true,
            series,
        }
    }
}

fn key(l: &Line) -> (usize, usize, String, u64, u64) {
    (
        l.coefficients,
        l.samples,
        l.pattern.clone(),
        l.contrast.to_bits(),
        l.dt_over_limit.to_bits(),
    )
}
