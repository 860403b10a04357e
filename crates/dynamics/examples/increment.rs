//! Increment errors of the default solver, one JSON object a line:
//! `cargo run --release -p dynamics --example increment -- 15/20 rim|free CONTRAST DT [MASS] [18|slack]`.
//!
//! "bridge" lines are the steps after painting, while a factor is made beside them.

use dynamics::lattice::Rim;
use dynamics::springs::Neighbours;
use dynamics::study::{Configuration, Pattern, Reference, Solver};
use rustix::time::{ClockId, clock_gettime};

fn cpu_seconds() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: f64| args.get(i).map_or(default, |a| a.parse().expect("a number"));
    let (n, m) = args[0].split_once('/').expect("n/m");
    let four_d = args.get(5).is_some_and(|a| a == "18");
    for pattern in [Pattern::Uniform].into_iter().chain(Pattern::PAINTED) {
        let configuration = Configuration {
            coefficients: n.parse().expect("a number"),
            samples: m.parse().expect("a number"),
            rim: if args[1] == "rim" { Rim::Fixed } else { Rim::Free },
            pattern,
            contrast: number(2, 1e3),
            mass_contrast: number(4, 1.0),
            dt_over_limit: number(3, 30.0),
            neighbours: if four_d {
                Neighbours::Eighteen
            } else {
                Neighbours::Six
            },
            four_d,
        };
        let reference = if args.get(5).is_some_and(|a| a == "slack") {
            Reference::with_slack_springs(configuration)
        } else {
            Reference::new(configuration)
        };
        let reference = reference.expect("a possible configuration");
        let start = cpu_seconds();
        let (mut solver, matrix) = reference.prepared::<f32>(8).expect("positive definite");
        let prepare = cpu_seconds() - start;
        solver.settle();
        let settle = cpu_seconds() - start - prepare;
        let g = reference.load::<f32>(0);
        let mut x = vec![0.0; solver.lattice().coefficient_count()];
        let mut dx = g.clone();
        let mut times: Vec<f64> = (0..9)
            .map(|_| {
                let start = cpu_seconds();
                solver.solve(&matrix, &g, &mut x, &mut dx);
                cpu_seconds() - start
            })
            .collect();
        times.sort_by(f64::total_cmp);
        for (solver, cap) in [
            (Solver::Default, 2),
            (Solver::Default, 4),
            (Solver::Default, 8),
            (Solver::Bridge, 8),
        ] {
            let o = reference.judge::<f32>(solver, cap).expect("prepared before");
            if solver == Solver::Bridge && settle < 1e-3 {
                continue;
            }
            println!(
                "{{\"coefficients\":{n},\"samples\":{m},\"rim\":\"{}\",\"pattern\":\"{}\",\"contrast\":{},\"mass_contrast\":{},\"dt_over_limit\":{},\"springs\":\"{}\",\"solver\":\"{}\",\"preconditioner\":\"{}\",\"iterations\":{},\"increment_error\":{:.2e},\"residual\":{:.1e},\"reference_residual\":{:.0e},\"prepare_seconds\":{prepare:.2e},\"settle_seconds\":{settle:.2e},\"least_solve_seconds\":{:.2e}}}",
                args[1],
                pattern.name(),
                configuration.contrast,
                configuration.mass_contrast,
                configuration.dt_over_limit,
                args.get(5).map_or("6", |a| a),
                solver.name(),
                o.method,
                o.iterations,
                o.increment_error,
                o.residual,
                reference.residual,
                times[0]
            );
        }
    }
}
