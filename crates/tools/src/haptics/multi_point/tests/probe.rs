use super::super::super::Renderer;
use super::super::*;
use super::scenes::*;

#[test]
fn probe() {
    let tool = PointTool::sphere(4.5, Sampling::default()).unwrap();
    let mut r = MultiPoint::new(tool.clone(), MultiPointOptions { fine_checks: 100, ..MultiPointOptions::default() }).unwrap();
    let solid = Solid::new(2.0, super::cost::scene);
    for k in 0..4000 {
        let hand = super::cost::hand(k as f64 * DT);
        let felt = r.tick(&solid, &hand, DT);
        let way = hand.at.distance(felt.proxy.at);
        if k % 100 == 0 || way > 14.0 && k % 10 == 0 {
            let guests: Vec<_> = (r.places.own..r.places.len()).filter(|i| r.places.counts[*i]).map(|i| format!("{:.3} l {:.3} g {:.2}", r.places.here[i].clearance, r.places.level[i], r.places.here[i].gradient)).collect();
            println!("{k} hand {:.2} proxy {:.2} F {:.3} deepest {:.4} asked {} reach {:.4} unsure {} buried {} guests {guests:?}", hand.at, felt.proxy.at, felt.force.length(), r.places.deepest().0, solid.asked(), r.reach, r.features.is_unsure, r.is_buried);
        }
        solid.asked();
    }
}
