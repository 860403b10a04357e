//! Figures that criteria are stated in.

use glam::DVec3;

use super::super::Contact;
use super::Trace;
use super::trace::{mean_force, ripple};

/// What a trace is judged against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Stiffness of the coupling, N/m.
    pub stiffness: f64,
    /// Period of the ticks, s.
    pub period: f64,
    /// One count of the encoder, mm.
    pub quantum: f64,
    /// Radius of the tool, mm.
    pub radius: f64,
    /// Largest change of the force in a tick, N.
    pub slew: f64,
    /// How far a proxy may be within its offset, mm.
    pub tolerance: f64,
}

impl Limits {
    /// Those of a coupling, N/m, a tick, s, a count, mm, and a tool, mm: slew 0.25 N a tick, 10 µm.
    pub fn new(stiffness: f64, period: f64, quantum: f64, radius: f64) -> Self {
        Self {
            stiffness,
            period,
            quantum,
            radius,
            slew: 0.25,
            tolerance: 0.01,
        }
    }

    /// Ripple that counts as rest: 0.05 N, or two counts of the encoder.
    pub fn ripple(&self) -> f64 {
        (2e-3 * self.stiffness * self.quantum).max(0.05)
    }

    /// Change of the force in a tick that a motion, m/s, through locally convex free space justifies, N:
    /// 1.05 K (v T + √3 Δ). Projection on a convex set brings no two points further apart.
    pub fn justified_jump(&self, speed: f64) -> f64 {
        let counts = 3f64.sqrt() * 1e-3 * self.quantum;
        1.05 * self.stiffness * (speed * self.period + counts)
    }
}

/// Figures of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Largest force, N.
    pub force: f64,
    /// Largest true speed, m/s, over a tick.
    pub speed: f64,
    /// Largest change of the force in a tick, N.
    pub jump: f64,
    /// When, s.
    pub jump_at: f64,
    /// What the largest speed justifies, N.
    pub justified_jump: f64,
    /// Ticks whose change is larger than that.
    pub jumps_over: usize,
    /// Largest part of a change of the force that exceeds K times the change of the told place in the same tick, N: 0 in locally convex free
    /// space, whatever the speed.
    pub expansion: f64,
    /// Ticks.
    pub ticks: usize,
    /// Ripple in the last second, N.
    pub ripple: f64,
    /// Most energy that the law of force had given back at any time, J.
    pub returned: f64,
    /// Most work that the motors had done at any time, J.
    pub work: f64,
    /// Ticks in which the proxy is deeper than its offset and the tolerance, those of tools inside aside.
    pub sunk: usize,
    /// Deepest such, mm below the offset; 0 or less where none is.
    pub deepest: f64,
    /// Mean force in the last second, N.
    pub steady: DVec3,
    /// Mean cost of a tick, s.
    pub cost: f64,
    /// Cost that 99 of 100 ticks do not exceed, s.
    pub cost_p99: f64,
}

impl Measures {
    /// Those of a trace.
    pub fn of(trace: &Trace, limits: &Limits) -> Self {
        let ticks = &trace.ticks;
        let pairs = || ticks.windows(2).map(|w| (&w[0], &w[1]));
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let speed = most(&mut pairs().map(|(a, b)| 1e-3 * (b.at - a.at).length() / a.dt));
        let justified_jump = limits.justified_jump(speed);
        let (jump, jump_at) = pairs()
            .map(|(a, b)| ((b.force - a.force).length(), b.time))
            .fold((0.0, 0.0), |best, j| if j.0 > best.0 { j } else { best });
        let expansion = pairs().map(|(a, b)| {
            let moved = 1e-3 * limits.stiffness * (b.read.at - a.read.at).length();
            (b.force - a.force).length() - moved
        });
        let outside = ticks.iter().filter(|t| t.contact != Contact::Inside);
        let depths = outside.map(|t| limits.radius - t.distance);
        let mut costs: Vec<f64> = ticks.iter().map(|t| t.cost).collect();
        costs.sort_by(f64::total_cmp);
        Self {
            force: most(&mut ticks.iter().map(|t| t.force.length())),
            speed,
            jump,
            jump_at,
            justified_jump,
            jumps_over: pairs()
                .filter(|(a, b)| (b.force - a.force).length() > justified_jump)
                .count(),
            expansion: most(&mut expansion.into_iter()),
            ticks: ticks.len(),
            ripple: ripple(trace.last(1.0)),
            returned: most(&mut ticks.iter().map(|t| t.returned)),
            work: most(&mut ticks.iter().map(|t| t.work)),
            sunk: depths.clone().filter(|d| *d > limits.tolerance).count(),
            deepest: depths.fold(f64::NEG_INFINITY, f64::max),
            steady: mean_force(trace.last(1.0)),
            cost: costs.iter().sum::<f64>() / costs.len().max(1) as f64,
            cost_p99: costs.get((costs.len() * 99) / 100).copied().unwrap_or(0.0),
        }
    }
}
