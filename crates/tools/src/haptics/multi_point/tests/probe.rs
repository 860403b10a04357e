use super::super::super::Renderer;
use super::scenes::*;
use glam::DVec3;

#[test]
fn probe() {
    for seed in 0..25 {
        let solid = super::hostile::solid(seed);
        let tools = super::hostile::tools();
        let (name, tool) = &tools[seed as usize % tools.len()];
        let (mut renderer, hand) = super::hostile::run(seed, tool);
        let mut shown = 0;
        let mut last = 0.0;
        for k in 0..2500 {
            let before = renderer.pose;
            let felt = renderer.tick(&solid, &hand(k as f64 * DT), DT);
            let d = dense_depth(tool, &solid, &felt.proxy, 0.25);
            if d > 0.02 && shown < 4 && (d - last).abs() > 0.002 {
                shown += 1;
                println!(
                    "{seed} {name} {k}: dense {d:.4} moved {:.4} reach {:.4} unsure {} guests:",
                    (felt.proxy.at - before.at).length(),
                    renderer.reach,
                    renderer.features.is_unsure
                );
                for i in renderer.places.own..renderer.places.len() {
                    if renderer.places.counts[i] {
                        let p = renderer.places.here[i];
                        println!(
                            "     {:?} c {:.4} exact {} level {:.4}",
                            p.on, p.clearance, p.is_exact, renderer.places.level[i]
                        );
                    }
                }
                let shape = tool.shape.unwrap();
                let q = shape
                    .points(0.25)
                    .into_iter()
                    .max_by(|a, b| {
                        let f = |q: &DVec3| {
                            -super::super::super::Obstacle::distance(&solid, place(tool, &felt.proxy, *q)).0
                        };
                        f(a).total_cmp(&f(b))
                    })
                    .unwrap();
                println!("     deepest at {q:?}");
            }
            last = d;
        }
    }
}
