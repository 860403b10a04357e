//! Strokes across borders of stiffness.

use super::*;
use tools::paint::Layers;

/// Stiffness of `ratio` where a formula is below 0.
fn painted(field: &HierarchicalSpline<f32>, ratio: f64, side: &str) -> Layers {
    let paint = format!(
        "[[stroke]]\npaint = {{ layer = 'stiffness', formula = '1 + {} * ({side} < 0)' }}",
        ratio - 1.0
    );
    let session: Session = toml::from_str(&paint).unwrap();
    let canvas = Canvas {
        holds: Vec::new(),
        copies: Vec::new(),
        field: field.clone(),
        iso: ISO,
        layers: Default::default(),
        others: Default::default(),
        detail: 0,
    };
    let (canvas, _) = session.stroke[0].apply(canvas, &mut Control::default()).unwrap();
    canvas.layers
}

fn run(mut stroke: ForceStroke<f32>, what: &str) {
    let start = std::time::Instant::now();
    let mut worst = 0.0_f64;
    let mut line = String::new();
    while !stroke.is_over() {
        let told = stroke.step().unwrap();
        worst = worst.max(told.residual);
        if std::env::var("FF_STEPS").is_ok() {
            line += &format!(
                "   {:.3} {:.4} {:.4} {}\n",
                told.residual, told.arrival.least, told.arrival.most, told.solves
            );
        }
    }
    let (_, r) = stroke.release().unwrap();
    println!(
        "{what}: over {:.4} ends {:.4} {:.4} steps {} to99 {:?} solves {:.1} samples {} residual {worst:.3} {:.0} ms/step paths {}\n{line}",
        r.overshoot,
        r.arrival.least,
        r.arrival.most,
        r.steps,
        r.steps_to_99,
        r.solves as f64 / r.steps as f64,
        r.samples,
        1e3 * start.elapsed().as_secs_f64() / r.steps as f64,
        r.paths
    );
}

#[test]
#[ignore]
fn sweep() {
    let only = std::env::var("FF_ONLY").unwrap_or_default();
    let block = block::<f32>(24);
    let ball = ball::<f32>(24, 1.0);
    for (field, z, name) in [(&block, 12.0, "block"), (&ball, 17.9, "ball")] {
        for ratio in [1.0, 3.0, 10.0, 100.0] {
            for side in ["x - 12", "x + 0.6*y - 19.5", "z - 12.3"] {
                if ratio == 1.0 && side != "x - 12" || name == "ball" && side == "z - 12.3" {
                    continue;
                }
                let layers = painted(field, ratio, side);
                for tool in [
                    format!("along = [[12.1, 11.8, {z}]]"),
                    format!("along = [[9, 12, {z}], [15, 12.3, {z}]]"),
                    format!("along = [[12, 9, {z}], [12.2, 15, {z}]]"),
                    format!("along = [[12, 12, {z}]]\ndisc = 2.4"),
                ] {
                    for d in [0.6, 1.92, -1.92] {
                        let text = format!("{tool}\nlift = {d}\nradius = {R}");
                        let what = format!("{name} {ratio} {side} {} {d}", tool.replace('\n', " "));
                        if !what.contains(&only) {
                            continue;
                        }
                        let stroke = pull(&text).begin(field, ISO).unwrap();
                        run(stroke.painted(&layers).unwrap(), &what);
                    }
                }
                let what = format!("{name} {ratio} {side} chisel");
                if !what.contains(&only) {
                    continue;
                }
                let text = format!("along = [[8, 11, {z}], [16, 12.5, {z}]]\ndepth = 0.8\nradius = {R}");
                let tool: Chisel = toml::from_str(&text).unwrap();
                for grows in [false, true] {
                    let stroke = tool.begin(field, ISO, grows).unwrap();
                    run(stroke.painted(&layers).unwrap(), &what);
                }
            }
        }
    }
}

/// Shapes of curves of more and more paths, and of zigzags.
#[test]
#[ignore]
fn numbers() {
    let field = block::<f64>(24);
    let made = |count: usize, d: f64| -> Vec<f64> {
        let width = 6.0 * R / count as f64;
        let at = |i: usize, n: usize, length: f64| 12.0 - 0.5 * length + length * i as f64 / n as f64;
        let target = |i: usize| {
            let from = DVec3::new(at(i, count, 6.0 * R), 12.1, 12.0);
            let is_end = i == 0 || i == count;
            Target {
                weight: if is_end { 0.5 * (width + R) } else { width },
                ..Target::single(Path::through([from, from + d * DVec3::Z]).unwrap(), true)
            }
        };
        let targets = (0..=count).map(target).collect();
        let (after, _) =
            finished(ForceStroke::new(&field, ISO, targets, Extent::Curve, R, &How::default()).unwrap());
        let along = (0..=24).map(|i| height(&after, at(i, 24, 10.0 * R), 12.1) / d);
        let across = (1..=6).map(|i| height(&after, 12.0, 12.1 + 0.5 * f64::from(i)) / d);
        along.chain(across).collect()
    };
    for d in [1.0, 1.6, 3.0] {
        let most = made(96, d * R);
        for count in [9, 12, 18, 24, 48] {
            let off: Vec<f64> = made(count, d * R).iter().zip(&most).map(|(a, b)| a - b).collect();
            println!(
                "{d} {count}: {:.4} {off:.4?}",
                off.iter().fold(0.0, |m: f64, v| m.max(v.abs()))
            );
        }
    }
    let field = block::<f32>(24);
    for along in [
        "[[8, 12, 12], [12, 12, 12], [14, 15.5, 12]]",
        "[[8, 12, 12], [12, 12, 12], [12, 16, 12]]",
        "[[7, 11, 12], [9, 14, 12], [11, 11, 12], [13, 14, 12], [15, 11, 12], [17, 14, 12]]",
        "[[8, 11, 12], [10, 12.5, 12], [12, 11, 12], [14, 12.5, 12], [16, 11, 12]]",
        "[[9, 12, 12], [13, 12, 12], [11, 15.4, 12]]",
        "[[8, 12, 12], [16, 12.3, 12]]",
    ] {
        for d in [1.0, 1.6, 3.0, -3.0] {
            let (_, report) = pulled(
                &field,
                &format!("along = {along}\nlift = {}\nradius = {R}", d * R),
            );
            println!("{along} {d}: {:?} {}", report.steps_to_99, report.overshoot);
        }
    }
}
