//! Touch: accuracy of contact against what a tick costs, and who holds in the scenes where methods fail.

mod draw;
mod models;
mod scenes;
mod sizes;

use std::sync::OnceLock;
use std::time::Instant;

use ::tools::haptics::controls::{Penalty, TangentPlane};
use ::tools::haptics::simulated::{Limits, Measures, Trace};
use ::tools::haptics::{Coupling, Proxy, ProxyOptions, Renderer, Vcp, VcpOptions};
use serde::Serialize;

use super::Chart;

/// A way of contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Proxy,
    Vcp,
    Penalty,
    TangentPlane,
}

impl Mode {
    const ALL: [Self; 4] = [Self::Proxy, Self::Vcp, Self::Penalty, Self::TangentPlane];

    fn name(self) -> &'static str {
        match self {
            Self::Proxy => "proxy",
            Self::Vcp => "vcp",
            Self::Penalty => "penalty",
            Self::TangentPlane => "tangent plane",
        }
    }

    /// Of a tool, mm, and a stiffness, N/m.
    fn make(self, radius: f64, stiffness: f64) -> Box<dyn Renderer> {
        let coupling = Coupling::spring(stiffness);
        match self {
            Self::Proxy => Box::new(Proxy::new(ProxyOptions {
                radius,
                coupling,
                ..ProxyOptions::default()
            })),
            Self::Vcp => Box::new(Vcp::new(VcpOptions {
                radius,
                coupling,
                ..VcpOptions::default()
            })),
            Self::Penalty => Box::new(Penalty { radius, stiffness }),
            Self::TangentPlane => Box::new(TangentPlane::new(radius, stiffness, 30.0)),
        }
    }
}

/// A scene or a model, and what a tool felt there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HapticLine {
    /// Scene or model, and the way of contact.
    pub name: String,
    /// Radius of the tool.
    pub tool_radius_mm: f64,
    /// Memory of the coefficients of the field, or of the snapshot where only that is asked; 0 of formulas.
    pub field_bytes: usize,
    /// Time of a tick on the mean.
    pub tick_mean_us: f64,
    /// Time that 99 of 100 ticks do not exceed.
    pub tick_p99_us: f64,
    /// Largest change of the force from tick to tick.
    pub force_jump_max_n: f64,
    /// What the motion justifies in locally convex free space: 1.05 K (vT + √3 Δ).
    pub justified_jump_n: f64,
    /// Ticks with more than that.
    pub jumps_over_limit: usize,
    /// Ticks in which the contact is in the solid, and changes of side.
    pub pop_through: usize,
    /// Most energy that the law of force had given back at any time.
    pub energy_j: f64,
    /// Root mean square of the error of the force, where an exact one is known.
    pub force_error_n: Option<f64>,
    /// Whether all criteria of the scene hold.
    pub passed: bool,
    /// What a user gets without options.
    pub default: bool,
    /// Where it is drawn.
    #[serde(skip)]
    place: Place,
}

/// Where a line is drawn.
#[derive(Clone, Debug, PartialEq)]
enum Place {
    /// A snapshot whose nodes are so far apart, mm.
    Resolution { series: &'static str, spacing: f64 },
    /// A setting of a search.
    Steps { series: &'static str, word: String },
    /// A scene.
    Scene { scene: &'static str, mode: &'static str },
    /// A field.
    Size { radius: f64 },
}

/// What was measured.
pub struct HapticCosts {
    lines: Vec<HapticLine>,
}

/// What a sweep runs with.
pub struct HapticRun<'a> {
    /// The smallest sizes only.
    pub quick: bool,
    /// Told the share done; says whether to go on.
    pub go_on: &'a mut dyn FnMut(f64) -> bool,
    /// Given every line when it is there.
    pub show: &'a mut dyn FnMut(&HapticLine),
}

/// The user said stop.
#[derive(Clone, Copy, Debug)]
pub struct Stopped;

impl HapticRun<'_> {
    fn go_on(&mut self, fraction: f64) -> Result<(), Stopped> {
        match (self.go_on)(fraction) {
            true => Ok(()),
            false => Err(Stopped),
        }
    }
}

/// Snapshots of a torus, settings of searches, scenes, and fields of growing size.
///
/// # Errors
/// [`Stopped`].
pub fn haptic_costs(run: &mut HapticRun) -> Result<HapticCosts, Stopped> {
    let mut lines = Vec::new();
    let mut add = |line: HapticLine, run: &mut HapticRun| {
        (run.show)(&line);
        lines.push(line);
    };
    run.go_on(0.0)?;
    models::resolutions(run, &mut add)?;
    run.go_on(0.3)?;
    models::steps(run, &mut add)?;
    run.go_on(0.5)?;
    scenes::all(run, &mut add)?;
    run.go_on(0.7)?;
    sizes::all(run, &mut add)?;
    Ok(HapticCosts { lines })
}

/// Takes a line when it is there.
type Add<'a> = dyn FnMut(HapticLine, &mut HapticRun) + 'a;

/// Seconds since the first call. A tick takes less than the system needs to tell processor time, so it is the wall's: look at
/// the mean and the 99th percentile, not at the largest.
fn wall() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// What asking the clock itself takes, s.
fn clock_cost() -> f64 {
    let mut all: Vec<f64> = (0..1001)
        .map(|_| {
            let start = wall();
            wall() - start
        })
        .collect();
    all.sort_unstable_by(f64::total_cmp);
    all[500]
}

/// Figures of a trace under a name; `pops` are changes of side.
fn line(
    name: String,
    trace: &Trace,
    limits: &Limits,
    field_bytes: usize,
    pops: usize,
    place: Place,
) -> HapticLine {
    let m = Measures::of(trace, limits);
    let us = |cost: f64| (1e6 * (cost - clock_cost())).max(0.0);
    HapticLine {
        name,
        tool_radius_mm: limits.radius,
        field_bytes,
        tick_mean_us: us(m.cost),
        tick_p99_us: us(m.cost_p99),
        force_jump_max_n: m.jump,
        justified_jump_n: m.justified_jump,
        jumps_over_limit: m.jumps_over,
        pop_through: m.sunk + pops,
        energy_j: m.returned,
        force_error_n: None,
        passed: m.sunk + pops == 0 && m.returned <= 1e-4,
        default: false,
        place,
    }
}

impl HapticCosts {
    /// All charts with the names of their files.
    pub fn charts(&self) -> Vec<(&'static str, Chart)> {
        draw::charts(&self.lines)
    }
}
