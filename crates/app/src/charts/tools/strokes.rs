//! Strokes on a half-space, whose ends are known: by sampling, and by the number of paths.

use ::tools::force::{Extent, ForceStroke, How, Path, Rule, Solid, Target};
use ::tools::number::Positive;
use bspline::hierarchical::{EditError, Lattice};
use bspline::{HierarchicalSpline, Real};
use glam::{DAffine3, DVec3};

use super::{Add, Place, ToolLine, ToolRun, ToolsError, summary};

/// Edge of the box, half of which is full.
pub const SIDE: f64 = 24.0;
/// Radius of tools: 1.6 samples of the field of 24³ cells.
const RADIUS: f64 = 1.2;
/// Cells that the coarsest field has on an axis.
const CELLS: u32 = 24;
/// Length of a curve tool.
const CURVE: f64 = 6.0 * RADIUS;
/// Steps of any stroke: a tool that never arrives is let go then.
const MOST: usize = 60;

/// Splines of a density on `cells³` cells.
pub fn field_of<T: Real>(
    cells: u32,
    density: impl Fn(DVec3) -> f64,
) -> Result<HierarchicalSpline<T>, EditError> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(SIDE / f64::from(cells))),
        cells: [cells; 3],
    };
    HierarchicalSpline::schoenberg(lattice, 1.0, density)
}

/// What lies below the middle; exact in splines.
fn half_space<T: Real>(cells: u32) -> Result<HierarchicalSpline<T>, EditError> {
    field_of(cells, |p| 0.5 * SIDE - p.z)
}

/// What the solid does, and how large the forces are.
fn law(solid: Solid, rule: Rule) -> (String, How, f64) {
    let how = How {
        solid: Some(solid),
        rule,
        ..How::default()
    };
    let (solid, share) = match (solid, rule) {
        // b/(1 + b) of the way.
        (Solid::Elastic, Rule::Arrive) => ("elastic", 0.8),
        (Solid::Elastic, _) => ("elastic", 1.0),
        (Solid::Clay, _) => ("clay", 1.0),
    };
    let rule = match rule {
        Rule::Arrive => "arrive".into(),
        Rule::Compliance => "compliance".into(),
        Rule::Raw(alpha) => format!("raw {}", alpha.0),
    };
    (format!("{solid}, {rule}"), how, share)
}

/// A stroke that was made.
struct Made {
    line: ToolLine,
    /// Heights over the length of the paths, at the places asked for.
    heights: Vec<f64>,
}

/// Draws the surface of `cells³` cells up by `drag` from all `places`, and looks where it is then.
fn made<T: Real>(
    cells: u32,
    targets: Vec<Target>,
    extent: Extent,
    how: &How,
    looks: &[[f64; 2]],
    clock: fn() -> f64,
) -> Result<Made, ToolsError> {
    let field = half_space::<T>(cells)?;
    let drag = targets[0].path.length();
    let mut stroke = ForceStroke::new(&field, 0.0, targets, extent, RADIUS, how)?;
    let mut seconds = Vec::new();
    while !stroke.is_over() && seconds.len() < MOST {
        let start = clock();
        stroke.step()?;
        seconds.push(clock() - start);
    }
    let heights = looks.iter().map(|[x, y]| {
        let (mut low, mut high) = (0.1 * SIDE, 0.9 * SIDE);
        for _ in 0..50 {
            let z = 0.5 * (low + high);
            let is_in = stroke.value(DVec3::new(*x, *y, z)) > 0.0;
            *(if is_in { &mut low } else { &mut high }) = z;
        }
        (low - 0.5 * SIDE) / drag
    });
    let heights: Vec<f64> = heights.collect();
    let report = *stroke.report();
    let (median, slow) = summary(seconds);
    let line = ToolLine {
        paths: report.paths,
        drag_over_r: Some(drag / RADIUS),
        sampling_factor: Some(f64::from(cells) / f64::from(CELLS)),
        overshoot: Some(report.overshoot),
        steps_to_99: report.steps_to_99,
        loop_ms: median,
        slow_loop_ms: slow,
        ..ToolLine::default()
    };
    Ok(Made { line, heights })
}

/// Largest difference.
fn off(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn up(x: f64, y: f64, drag: f64) -> Result<Path, ToolsError> {
    let from = DVec3::new(x, y, 0.5 * SIDE);
    Ok(Path::through([from, from + drag * DVec3::Z])?)
}

/// A point tool on finer and finer fields, against the finest, in double precision.
pub fn samplings(run: &mut ToolRun, add: &mut Add) -> Result<(), ToolsError> {
    let (sizes, finest): (&[u32], u32) = match run.quick {
        true => (&[24, 48], 60),
        false => (&[24, 30, 36, 48, 60, 72, 96], 128),
    };
    let raw = Rule::Raw(Positive(30.0));
    let laws = [
        (Solid::Clay, Rule::Arrive),
        (Solid::Clay, Rule::Compliance),
        (Solid::Clay, raw),
        (Solid::Elastic, Rule::Arrive),
        (Solid::Elastic, raw),
    ];
    let (x, y, drag) = (12.1, 11.8, 1.6 * RADIUS);
    let looks: Vec<[f64; 2]> = (0..9).map(|i| [x + 0.4 * f64::from(i), y]).collect();
    for (i, (solid, rule)) in laws.into_iter().enumerate() {
        run.go_on(0.05 + 0.06 * i as f64)?;
        let (name, how, share) = law(solid, rule);
        let target = || Ok::<_, ToolsError>(vec![Target::single(up(x, y, drag)?, true)]);
        let reference = made::<f64>(finest, target()?, Extent::Curve, &how, &looks, run.clock)?;
        // Where the rule says where the surface comes to rest, that is the reference.
        let end = match rule {
            Rule::Raw(_) => reference.heights[0],
            _ => share,
        };
        for cells in sizes {
            let m = made::<f32>(*cells, target()?, Extent::Curve, &how, &looks, run.clock)?;
            let line = ToolLine {
                tool: "point".into(),
                law: name.clone(),
                arrival: Some(m.heights[0]),
                profile_error: Some(off(&m.heights, &reference.heights)),
                default: solid == Solid::Clay && rule == Rule::Arrive && *cells == CELLS,
                place: Place::Sampling {
                    error: (m.heights[0] - end).abs(),
                },
                ..m.line
            };
            add(line, run);
        }
    }
    Ok(())
}

/// A curve tool with more and more paths; arrival against the ends of the paths, also between them, and the whole shape against
/// most paths in double precision.
pub fn numbers_of_paths(run: &mut ToolRun, add: &mut Add) -> Result<(), ToolsError> {
    let (counts, most): (&[usize], usize) = match run.quick {
        true => (&[6, 12], 24),
        false => (&[2, 3, 4, 6, 9, 12, 18, 24, 48], 96),
    };
    let (middle, y) = (12.0, 12.1);
    let along = |i: usize, n: usize, length: f64| middle - 0.5 * length + length * i as f64 / n as f64;
    let on: Vec<[f64; 2]> = (0..=24).map(|i| [along(i, 24, CURVE), y]).collect();
    let beside = (0..=24).map(|i| [along(i, 24, CURVE + 4.0 * RADIUS), y]);
    let across = (1..=6).map(|i| [middle, y + 0.5 * f64::from(i)]);
    let looks: Vec<[f64; 2]> = on.iter().copied().chain(beside).chain(across).collect();
    let clay = [Rule::Arrive, Rule::Compliance];
    let drags: &[f64] = if run.quick { &[1.6] } else { &[1.6, 3.0] };
    let cases = drags.iter().flat_map(|d| clay.map(|rule| (*d, rule)));
    for (i, (drag, rule)) in cases.enumerate() {
        run.go_on(0.35 + 0.08 * i as f64)?;
        let (name, how, _) = law(Solid::Clay, rule);
        let targets = |count: usize| -> Result<Vec<Target>, ToolsError> {
            let width = CURVE / count as f64;
            let target = |i: usize| {
                let is_end = i == 0 || i == count;
                Ok(Target {
                    weight: if is_end { 0.5 * (width + RADIUS) } else { width },
                    ..Target::single(up(along(i, count, CURVE), y, drag * RADIUS)?, true)
                })
            };
            (0..=count).map(target).collect()
        };
        let reference = made::<f64>(CELLS, targets(most)?, Extent::Curve, &how, &looks, run.clock)?;
        for count in counts {
            let m = made::<f32>(CELLS, targets(*count)?, Extent::Curve, &how, &looks, run.clock)?;
            let worst = m.heights[..on.len()].iter().copied();
            let worst = worst.fold(
                1.0,
                |w: f64, h| if (h - 1.0).abs() > (w - 1.0).abs() { h } else { w },
            );
            let line = ToolLine {
                tool: "curve".into(),
                law: name.clone(),
                arrival: Some(worst),
                profile_error: Some(off(&m.heights, &reference.heights)),
                // Half a radius apart.
                default: rule == Rule::Arrive && *count as f64 == 2.0 * CURVE / RADIUS,
                place: Place::Paths {
                    error: (worst - 1.0).abs(),
                },
                ..m.line
            };
            add(line, run);
        }
    }
    Ok(())
}
