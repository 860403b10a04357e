//! The magnetic band, and thin parts with a layer.

use glam::DVec3;
use tools::haptics::simulated::{Path, SimulatedHand};
use tools::haptics::{Contact, Coupling, Magnet, Obstacle, Proxy, ProxyOptions};

use super::common::{Ball, HalfSpace, Loop, Sheet};

const MAGNET: Magnet = Magnet {
    range: 4.0,
    strength: 1.5,
};

fn magnetic() -> Proxy {
    Proxy::new(ProxyOptions {
        coupling: Coupling::spring(500.0),
        magnet: Some(MAGNET),
        ..ProxyOptions::default()
    })
}

/// Over 100 mm at 0.1 m/s, the target half the band above the surface; `at` gives a place a way along and a height over it.
fn keeps_contact(name: &str, obstacle: impl Obstacle + 'static, at: impl Fn(f64, f64) -> DVec3) {
    let lifted = 2.0 + 0.5 * MAGNET.range;
    let mut places = vec![(0.1, at(0.0, 4.0)), (0.4, at(0.0, 2.0))];
    places.extend((0..=50).map(|n| {
        let way = 2.0 * f64::from(n);
        (0.5 + 0.01 * way, at(way, lifted))
    }));
    let setup = Loop::new(SimulatedHand::light(Path::straight(places)), 1.6);
    let check = setup.touch(obstacle, magnetic());
    let ticks = check.trace.between(0.5, 1.5);
    let holds = |c: Contact| matches!(c, Contact::Attracted | Contact::Slides);
    let kept = ticks.iter().filter(|t| holds(t.contact)).count();
    assert!(ticks.len() >= 990, "{name}: {} ticks", ticks.len());
    assert!(
        kept * 100 >= ticks.len() * 99,
        "{name}: {kept} of {}",
        ticks.len()
    );
    // The hand, a spring to its target, rests where the band draws it down as hard: at 0.48 N.
    let [mut low, mut high] = [0.0, 0.5 * MAGNET.range];
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        let hand = 0.3 * (0.5 * MAGNET.range - middle);
        *(if MAGNET.force(middle) < hand {
            &mut low
        } else {
            &mut high
        }) = middle;
    }
    let mean = ticks.iter().map(|t| t.force.length()).sum::<f64>() / ticks.len() as f64;
    let rest = MAGNET.force(low);
    assert!((mean - rest).abs() < 0.03 * rest, "{name}: {mean} N of {rest}");
    assert!(check.is_slewed(), "{name}: {:#?}", check.measures);
}

#[test]
fn the_band_keeps_a_lifted_hand_at_the_surface() {
    keeps_contact("plane", HalfSpace::floor(0.0), |way, height| {
        DVec3::new(way - 50.0, 0.0, height)
    });
    for radius in [30.0, 80.0] {
        let ball = Ball {
            middle: DVec3::ZERO,
            radius,
        };
        keeps_contact("ball", ball, |way, height| {
            let (sine, cosine) = libm::sincos(way / radius);
            (radius + height) * DVec3::new(sine, 0.0, cosine)
        });
    }
}

#[test]
fn a_thin_sheet_with_a_layer_is_never_crossed() {
    for radius in [0.0, 0.5, 2.0] {
        let of = |z| DVec3::new(0.0, 0.0, z);
        let ten = 0.1 + 0.03 / 0.2;
        // At 0.2 m/s to 15 mm behind the sheet, held, and back.
        let path = Path::straight([
            (0.1, of(15.0)),
            (ten, of(-15.0)),
            (0.8, of(-15.0)),
            (1.0, of(15.0)),
        ]);
        let tool = Proxy::new(ProxyOptions {
            radius,
            offset: 1.0,
            ..ProxyOptions::default()
        });
        let setup = Loop {
            radius,
            ..Loop::new(SimulatedHand::light(path), 1.2)
        };
        let check = setup.touch(Sheet { thickness: 0.3 }, tool);
        assert_eq!(check.trace.crossings(|p| p.z > 0.0), 0, "{radius} mm");
        assert!(
            check.is_passive() && check.is_slewed(),
            "{radius} mm: {:#?}",
            check.measures
        );
    }
}
