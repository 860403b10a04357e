//! Force tools: arrival, shape, what stays, and what is refused.

use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::{Field, Real};
use glam::{DAffine3, DVec3};
use tools::force::{Chisel, Drill, ForceReport, ForceStroke, How, Path, Pull, Rule, Solid, Target};
use fitting::Control;

const ISO: f64 = 300.0;
const SLOPE: f64 = 40.0;
/// Of all tools here.
const R: f64 = 1.2;

/// What lies below `z = 12` in a box of 24³, in cells of `24/cells`: exact in splines.
fn block<T: Real>(cells: u32) -> HierarchicalSpline<T> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(24.0 / f64::from(cells))),
        cells: [cells; 3],
    };
    HierarchicalSpline::schoenberg(lattice, SLOPE, |p| SLOPE * (12.0 - p.z) + ISO).unwrap()
}

fn straight(x: f64, y: f64, by: DVec3) -> Target {
    let from = DVec3::new(x, y, 12.0);
    Target::single(Path::through([from, from + by]).unwrap(), by.z > 0.0)
}

fn run<T: Real>(field: &HierarchicalSpline<T>, targets: Vec<Target>, how: &How) -> (HierarchicalSpline<T>, ForceReport) {
    let mut stroke = ForceStroke::new(field, ISO, targets, R, how).unwrap_or_else(|e| panic!("{e}"));
    while !stroke.is_over() {
        let t0 = std::time::Instant::now();
        let told = stroke.step().unwrap_or_else(|e| panic!("{e}"));
        if std::env::var("V").is_ok() { println!("{told:?} {:?}", t0.elapsed()); }
    }
    stroke.release().unwrap()
}

/// Height of the surface over `(x, y)`.
fn height<T: Real>(field: &HierarchicalSpline<T>, x: f64, y: f64) -> f64 {
    let (mut low, mut high) = (6.0, 20.0);
    for _ in 0..60 {
        let z = 0.5 * (low + high);
        if field.value(DVec3::new(x, y, z)) > ISO { low = z } else { high = z }
    }
    low
}


fn pull(text: &str) -> Pull { toml::from_str(text).unwrap_or_else(|e| panic!("{e}")) }
fn chisel(text: &str) -> Chisel { toml::from_str(text).unwrap_or_else(|e| panic!("{e}")) }

fn go<T: Real>(mut stroke: ForceStroke<T>, what: &str) -> (HierarchicalSpline<T>, ForceReport) {
    let t0 = std::time::Instant::now();
    let mut worst: f64 = 0.0;
    while !stroke.is_over() {
        let t1 = std::time::Instant::now();
        let told = stroke.step().unwrap_or_else(|e| panic!("{e}"));
        worst = worst.max(t1.elapsed().as_secs_f64());
        if std::env::var("V").is_ok() { println!("  {told:?}"); }
    }
    let (f, r) = stroke.release().unwrap();
    println!("{what}: {r:?} per step {:.2} ms", 1e3 * t0.elapsed().as_secs_f64() / r.steps as f64);
    (f, r)
}

#[test]
fn explore() {
    let field = block::<f32>(24);
    let fine = block::<f32>(48);
    for d in [0.6, 1.92, 3.6, -0.6, -1.92, -3.6] {
        let p = pull(&format!("along = [[8, 12, 12], [16.0, 12.3, 12]]\nlift = {d}\nradius = 1.2"));
        let (f, _) = go(p.begin(&field, ISO).unwrap(), &format!("curve {d}"));
        let w: Vec<f64> = (0..17).map(|i| (height(&f, 8.0 + i as f64 * 0.5, 12.0 + 0.3 * i as f64 / 16.0) - 12.0) / d).collect();
        println!("{w:.3?}");
    }
    for d in [1.92, -1.92] {
        let p = pull(&format!("along = [[12, 12, 12]]\ndisc = 3.6\nlift = {d}\nradius = 1.2"));
        let (f, _) = go(p.begin(&field, ISO).unwrap(), &format!("disc {d}"));
        let w: Vec<f64> = (0..9).map(|i| (height(&f, 12.0 + i as f64 * 0.6, 12.0) - 12.0) / d).collect();
        println!("{w:.3?}");
        go(p.begin(&fine, ISO).unwrap(), &format!("disc fine {d}"));
    }
    for (text, what) in [("solid = 'elastic'", "elastic arrive"), ("solid = 'elastic'\nrule = 'compliance'", "elastic N"), ("rule = 'compliance'", "clay N"), ("rule.raw = 3", "raw 3"), ("rule.raw = 30", "raw 30"), ("filter = 'constant'", "constant"), ("filter = 'conical'", "conical"), ("filter = 'cylindrical'", "cyl"), ("filter.formula = 'max(0, 1 - d/2)'", "formula")] {
        let p = pull(&format!("along = [[12.1, 11.8, 12]]\nlift = 1.92\nradius = 1.2\n[how]\n{text}"));
        go(p.begin(&field, ISO).unwrap(), what);
    }
    let p = pull("along = [[8, 12, 12], [16.0, 12.3, 12]]\nlift = 1.92\nradius = 1.2\n[how]\nrule='compliance'");
    go(p.begin(&field, ISO).unwrap(), "curve rows");
    let p = pull("along = [[8, 12, 12], [16.0, 12.3, 12]]\nlift = 1.92\nradius = 1.2\n[how]\nsolid='elastic'");
    go(p.begin(&field, ISO).unwrap(), "curve elastic");
    let c = chisel("along = [[4.5, 12, 12], [19.5, 12.3, 12]]\ndepth = 0.4\nradius = 0.6");
    for grows in [false, true] {
        let (f, _) = go(c.begin(&field, ISO, grows).unwrap(), "chisel");
        let w: Vec<f64> = (0..31).map(|i| (height(&f, 4.5 + i as f64 * 0.5, 12.0 + 0.01 * i as f64) - 12.0) / 0.4).collect();
        println!("{w:.3?}");
    }
}
