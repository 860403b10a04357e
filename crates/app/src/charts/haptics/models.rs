//! A ball of 2 mm on a torus, whose distance is known: what snapshots and searches cost, and how far off the force is.

use ::tools::haptics::simulated::{Limits, Path, Trace, led};
use ::tools::haptics::{
    BrickOptions, Coupling, DistanceBrick, Interpolation, Obstacle, Proxy, ProxyOptions, Renderer, Surface,
    Vcp, VcpOptions,
};
use bspline::Field;
use bspline::primitives::Torus;
use glam::DVec3;

use super::{Add, HapticLine, HapticRun, Mode, Place, Stopped, line, wall};

const RADIUS: f64 = 2.0;
const STIFFNESS: f64 = 500.0;
/// Radii of the torus.
const RING: f64 = 20.0;
const TUBE: f64 = 6.0;
/// How deep the hand is, mm.
const DEPTH: f64 = 1.5;

fn torus() -> Torus {
    Torus::new(DVec3::ZERO, DVec3::Z, RING, TUBE).expect("an open torus")
}

/// Where the hand is at a share of its way: along the ring, and from its outer side over the top.
fn place(share: f64) -> DVec3 {
    let (s, c) = libm::sincos(0.4 * share);
    let (up, out) = libm::sincos(0.2 + 1.2 * share);
    let far = TUBE + RADIUS - DEPTH;
    let ring = RING + far * out;
    DVec3::new(ring * c, ring * s, far * up)
}

/// In from outside, and along.
fn way() -> (Path, f64) {
    let outside = place(0.0) * 1.3;
    let along = (0..=100).map(|i| (0.1 + 0.004 * f64::from(i), place(0.01 * f64::from(i))));
    (Path::straight(std::iter::once((0.0, outside)).chain(along)), 0.5)
}

/// Root mean square of what the force is off by while the hand is in.
fn error(trace: &Trace, truth: &dyn Field) -> f64 {
    let squares = trace.between(0.12, 0.5).iter().map(|t| {
        let (value, gradient) = truth.value_gradient(t.at);
        let depth = (RADIUS + value).max(0.0);
        let wanted = -1e-3 * STIFFNESS * depth * gradient.normalize_or_zero();
        (t.force - wanted).length_squared()
    });
    let squares: Vec<f64> = squares.collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn felt(name: String, brick: &DistanceBrick, renderer: &mut dyn Renderer, place: Place) -> HapticLine {
    let (path, seconds) = way();
    // Once for the caches.
    led(&path, seconds, brick, renderer, None);
    renderer.reset();
    let trace = led(&path, seconds, brick, renderer, Some(wall));
    let limits = Limits::new(STIFFNESS, 1e-3, 0.0, RADIUS);
    let mut line = line(name, &trace, &limits, brick.bytes(), 0, place);
    let error = error(&trace, &torus());
    line.force_error_n = Some(error);
    // Two hundredths of the force.
    line.passed &= line.jumps_over_limit == 0 && error <= 0.02e-3 * STIFFNESS * DEPTH;
    line
}

fn brick(spacing: f64, interpolation: Interpolation) -> DistanceBrick {
    let torus = torus();
    let options = BrickOptions {
        reach: 14.0,
        spacing,
        band: RADIUS + 2.0 * spacing,
        interpolation,
    };
    DistanceBrick::new(&Surface::new(&torus, 0.0), place(0.5), &options)
}

/// Distance of nodes, and what is between them.
pub fn resolutions(run: &mut HapticRun, add: &mut Add) -> Result<(), Stopped> {
    let spacings: &[f64] = match run.quick {
        true => &[2.0, 1.0],
        false => &[3.0, 2.0, 1.5, 1.0, 0.75, 0.5, 0.35],
    };
    let usual = BrickOptions::of_tool(RADIUS, 0.5);
    for (i, &spacing) in spacings.iter().enumerate() {
        run.go_on(0.3 * i as f64 / spacings.len() as f64)?;
        for (series, interpolation) in [
            ("cubic", Interpolation::Cubic),
            ("trilinear", Interpolation::Linear),
        ] {
            let brick = brick(spacing, interpolation);
            let mut renderer = Mode::Proxy.make(RADIUS, STIFFNESS);
            let name = format!("torus, {series}, nodes {spacing} mm apart, proxy");
            let mut line = felt(
                name,
                &brick,
                &mut *renderer,
                Place::Resolution { series, spacing },
            );
            line.default = spacing == usual.spacing && interpolation == usual.interpolation;
            add(line, run);
        }
    }
    Ok(())
}

/// Tolerance of the proxy, step and halvings of the stateless contact.
pub fn steps(run: &mut HapticRun, add: &mut Add) -> Result<(), Stopped> {
    let brick = brick(1.0, Interpolation::Cubic);
    let coupling = Coupling::spring(STIFFNESS);
    let proxy = |tolerance| ProxyOptions {
        radius: RADIUS,
        coupling,
        tolerance,
        ..ProxyOptions::default()
    };
    let vcp = |step, halvings| VcpOptions {
        radius: RADIUS,
        coupling,
        step,
        halvings,
        ..VcpOptions::default()
    };
    let usual = (ProxyOptions::default().tolerance, VcpOptions::default());
    for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let word = format!("{tolerance:.0e} mm");
        let place = Place::Steps {
            series: "proxy, tolerance",
            word: word.clone(),
        };
        let mut renderer = Proxy::new(proxy(tolerance));
        let mut line = felt(format!("torus, proxy to {word}"), &brick, &mut renderer, place);
        line.default = tolerance == usual.0;
        add(line, run);
    }
    run.go_on(0.4)?;
    for halvings in [3, 5, 7, 9, 11, 14] {
        let place = Place::Steps {
            series: "vcp, halvings",
            word: format!("{halvings}"),
        };
        let mut renderer = Vcp::new(vcp(usual.1.step, halvings));
        let name = format!("torus, vcp with {halvings} halvings");
        let mut line = felt(name, &brick, &mut renderer, place);
        line.default = halvings == usual.1.halvings;
        add(line, run);
    }
    for step in [0.05, 0.1, 0.2, 0.5, 1.0, 2.0] {
        let place = Place::Steps {
            series: "vcp, step",
            word: format!("{step} mm"),
        };
        let mut renderer = Vcp::new(vcp(step, usual.1.halvings));
        let name = format!("torus, vcp with steps of {step} mm");
        let mut line = felt(name, &brick, &mut renderer, place);
        line.default = step == usual.1.step;
        add(line, run);
    }
    // What the distance itself costs, for comparison: one question a tick.
    debug_assert!(brick.distance(place(0.5)).0 < RADIUS);
    Ok(())
}
