use super::*;
use crate::haptics::{Blend, Together};

/// Solid below a plane through a point.
struct Below(DVec3, DVec3, Touch);

impl Obstacle for Below {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        (self.1.dot(p - self.0), self.1)
    }

    fn finest(&self) -> f64 {
        10.0
    }

    fn touch(&self, _: DVec3) -> Touch {
        self.2
    }
}

fn floor() -> Below {
    Below(DVec3::ZERO, DVec3::Z, Touch::default())
}

/// Balls, of which the distance is exact in the air.
#[derive(Clone)]
struct Ball(DVec3, f64);

impl Obstacle for Ball {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let away = p - self.0;
        (away.length() - self.1, away.normalize_or(DVec3::Z))
    }

    fn finest(&self) -> f64 {
        self.1
    }
}

/// A plate between two heights.
struct Sheet(f64, f64);

impl Obstacle for Sheet {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let middle = 0.5 * (self.0 + self.1);
        let half = 0.5 * (self.1 - self.0);
        let side = if p.z >= middle { 1.0 } else { -1.0 };
        ((p.z - middle).abs() - half, side * DVec3::Z)
    }

    fn finest(&self) -> f64 {
        self.1 - self.0
    }
}

const DT: f64 = 1e-3;

fn proxy(radius: f64) -> Proxy {
    Proxy::new(ProxyOptions {
        radius,
        ..ProxyOptions::default()
    })
}

fn tick(proxy: &mut Proxy, obstacle: &dyn Obstacle, at: DVec3) -> Felt {
    proxy.tick(obstacle, &Pose::at(at), DT)
}

struct Random(u64);

impl Random {
    /// From -1 to 1.
    fn one(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.one(), self.one(), self.one())
    }
}

#[test]
fn a_plane_presses_back_by_its_depth() {
    let mut tool = proxy(2.0);
    assert_eq!(tick(&mut tool, &floor(), DVec3::Z * 5.0).force, DVec3::ZERO);
    let felt = tick(&mut tool, &floor(), DVec3::new(0.3, 0.1, 1.0));
    assert!(felt.force.distance(DVec3::Z * 0.5) < 1e-4, "{felt:?}");
    assert!(felt.proxy.at.distance(DVec3::new(0.3, 0.1, 2.0)) < 1e-3);
    assert_eq!(felt.contact, Contact::Slides);
}

#[test]
fn in_convex_free_space_the_proxy_is_the_projection_of_the_hand() {
    // Three walls; random paths. The projection onto a convex set brings places nearer to each other.
    for seed in 0..20 {
        let mut random = Random(seed);
        let walls: Vec<Below> = (0..3)
            .map(|axis| {
                let mut normal = 0.5 * random.vector();
                normal[axis] = 1.0;
                Below(DVec3::ZERO, normal.normalize(), Touch::default())
            })
            .collect();
        let room = Together(&walls);
        let mut tool = proxy(1.0);
        let mut hand = DVec3::splat(6.0);
        let mut last = tick(&mut tool, &room, hand);
        for n in 0..3000 {
            let pull = if (n / 300) % 2 == 0 { -0.02 } else { 0.02 };
            let step = 0.1 * random.vector() + DVec3::splat(pull);
            hand += step;
            let felt = tick(&mut tool, &room, hand);
            assert!(room.distance(felt.proxy.at).0 > 1.0 - 1e-3, "{seed} {n}");
            let jump = felt.force.distance(last.force);
            assert!(
                jump <= 0.5 * 1.02 * step.length() + 2e-3,
                "{seed} {n}: {jump} for {step}"
            );
            last = felt;
        }
    }
}

#[test]
fn a_ball_is_felt_along_its_radius_at_any_depth() {
    let ball = Ball(DVec3::ZERO, 10.0);
    for depth in [0.1, 1.0, 4.0, 8.0] {
        let mut tool = proxy(2.0);
        tick(&mut tool, &ball, DVec3::Z * 20.0);
        tick(&mut tool, &ball, DVec3::Z * (12.0 - depth));
        let mut felt = None;
        for n in 0..800 {
            let angle = f64::from(n) * 1e-3;
            let at = (12.0 - depth) * DVec3::new(libm::sin(angle), 0.0, libm::cos(angle));
            let now = tick(&mut tool, &ball, at);
            assert!(
                now.force.distance(0.5 * depth * at.normalize()) < 0.01 * depth,
                "{depth} {n} {now:?}"
            );
            felt = Some(now);
        }
        assert!(felt.unwrap().force.length() > 0.49 * depth);
    }
}

#[test]
fn no_sheet_is_crossed_at_any_speed() {
    for thickness in [0.3, 1.0] {
        for radius in [0.0, 0.5, 2.0] {
            for speed in [0.01, 0.5, 5.0] {
                let sheet = Sheet(-thickness, 0.0);
                let mut tool = proxy(radius);
                let start = radius + 3.0;
                for n in 0..2000 {
                    let gone = speed * f64::from(n);
                    let at = DVec3::new(0.01 * gone, 0.0, (start - gone).max(-30.0));
                    let felt = tick(&mut tool, &sheet, at);
                    assert!(
                        felt.proxy.at.z > radius - 1e-3,
                        "{thickness} {radius} {speed} {n}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_force_leans_by_the_angle_of_friction() {
    for friction in [0.1, 0.4, 1.0] {
        let rough = Below(
            DVec3::ZERO,
            DVec3::Z,
            Touch {
                friction,
                ..Touch::default()
            },
        );
        let mut tool = proxy(1.0);
        let mut stuck = 0;
        tick(&mut tool, &rough, DVec3::Z * 3.0);
        for n in 0..400 {
            let felt = tick(&mut tool, &rough, DVec3::new(0.02 * f64::from(n), 0.0, 0.0));
            let lean = (felt.force.x / felt.force.z).abs();
            assert!(lean <= friction * 1.001 + 1e-9);
            stuck += usize::from(felt.contact == Contact::Sticks);
            if n > 200 {
                assert!((lean / friction - 1.0).abs() < 0.02, "{friction}: {lean}");
            }
        }
        // It held while the hand went as far as the cone is wide.
        let expected = friction * 1.0 / 0.02;
        assert!(
            (stuck as f64 - expected).abs() < 0.1 * expected + 2.0,
            "{friction}: {stuck}"
        );
    }
}

#[test]
fn a_tool_that_begins_inside_feels_nothing_until_it_is_clear() {
    let mut tool = proxy(1.0);
    for n in 0..40 {
        let z = -2.0 + 0.1 * f64::from(n);
        let felt = tick(&mut tool, &floor(), DVec3::Z * z);
        assert_eq!(felt.force, DVec3::ZERO, "{z}");
        assert_eq!(felt.contact == Contact::Inside, z < 1.0, "{z}");
    }
    assert!(tick(&mut tool, &floor(), DVec3::ZERO).force.z > 0.4);
    tool.reset();
    assert_eq!(tick(&mut tool, &floor(), DVec3::ZERO).contact, Contact::Inside);
}

#[test]
fn solid_that_grows_over_the_tool_pushes_it_out_at_a_bounded_rate() {
    let mut tool = proxy(1.0);
    let hand = DVec3::Z * 0.9;
    tick(&mut tool, &floor(), DVec3::Z * 2.0);
    tick(&mut tool, &floor(), hand);
    let higher = Below(DVec3::Z * 3.0, DVec3::Z, Touch::default());
    let mut last = tick(&mut tool, &floor(), hand);
    for n in 0..40 {
        let felt = tick(&mut tool, &higher, hand);
        let rise = felt.proxy.at.z - last.proxy.at.z;
        assert!((-1e-6..=0.1 + 1e-3).contains(&rise), "{n}: {rise}");
        last = felt;
    }
    assert!((last.proxy.at.z - 4.0).abs() < 1e-3);
    assert!((last.force.z - 0.5 * 3.1).abs() < 1e-3);
}

#[test]
fn a_blended_cut_comes_without_a_step() {
    let lower = Below(DVec3::Z * -0.1, DVec3::Z, Touch::default());
    let mut tool = proxy(1.0);
    let hand = DVec3::ZERO;
    tick(&mut tool, &floor(), DVec3::Z * 2.0);
    let mut last = tick(&mut tool, &floor(), hand).force.z;
    for n in 0..=33 {
        let between = Blend {
            from: floor(),
            to: &lower,
            share: f64::from(n) / 33.0,
        };
        let now = tick(&mut tool, &between, hand).force.z;
        assert!((0.0..0.0017).contains(&(last - now)), "{n}: {now} after {last}");
        last = now;
    }
    assert!((last - 0.45).abs() < 1e-3);
}

#[test]
fn the_magnet_draws_to_the_surface_and_ends_without_a_step() {
    let magnet = Magnet {
        range: 3.0,
        strength: 1.5,
    };
    let mut tool = Proxy::new(ProxyOptions {
        magnet: Some(magnet),
        ..ProxyOptions::default()
    });
    let mut most = 0.0f64;
    let mut last = 0.0;
    for n in 0..=400 {
        let height = 4.0 - 0.01 * f64::from(n);
        let felt = tick(&mut tool, &floor(), DVec3::new(1.0, 2.0, 2.0 + height));
        assert!((felt.force.z - last).abs() < 0.02, "{height}");
        if height.abs() > 1e-6 {
            let is_near = (0.0..2.999).contains(&height);
            assert_eq!(felt.contact == Contact::Attracted, is_near, "{height}");
        }
        if felt.contact == Contact::Attracted {
            assert!((felt.proxy.at.z - 2.0).abs() < 1e-9);
        }
        last = felt.force.z;
        most = most.max(-last);
    }
    assert!((most - 1.5).abs() < 1e-3);
}

#[test]
fn thin_parts_with_an_offset_have_a_depth_and_show_the_contact_on_the_surface() {
    let sheet = Sheet(-0.3, 0.0);
    let mut tool = Proxy::new(ProxyOptions {
        radius: 0.0,
        offset: 1.0,
        ..ProxyOptions::default()
    });
    tick(&mut tool, &sheet, DVec3::Z * 5.0);
    let felt = tick(&mut tool, &sheet, DVec3::Z * 0.4);
    assert!((felt.force.z - 0.3).abs() < 1e-4, "{felt:?}");
    assert!(felt.proxy.at.z.abs() < 1e-3);
}

#[test]
fn soft_places_give_way_in_series_with_the_coupling() {
    let soft = Below(
        DVec3::ZERO,
        DVec3::Z,
        Touch {
            stiffness: 500.0,
            friction: 0.0,
        },
    );
    let mut tool = proxy(1.0);
    tick(&mut tool, &soft, DVec3::Z * 3.0);
    let felt = tick(&mut tool, &soft, DVec3::ZERO);
    assert!((felt.force.z - 0.25).abs() < 1e-4);
}

#[test]
fn among_many_balls_the_tool_never_enters_and_a_still_hand_comes_to_rest() {
    for seed in 0..20 {
        let mut random = Random(seed + 100);
        let balls: Vec<Ball> = (0..30)
            .map(|_| Ball(8.0 * random.vector(), 1.0 + random.one().abs() * 3.0))
            .collect();
        let heap = Together(&balls);
        let mut tool = proxy([0.0, 0.5, 2.0][seed as usize % 3]);
        let radius = tool.options.radius;
        let mut hand = DVec3::splat(16.0);
        let mut toward = DVec3::ZERO;
        let mut ripple = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for n in 0..10_000 {
            if n % 1000 == 0 {
                toward = 9.0 * random.vector();
            }
            // 0.15 m/s, then still.
            if n % 1000 < 200 {
                hand += (toward - hand).clamp_length_max(0.15);
            }
            let felt = tick(&mut tool, &heap, hand);
            let distance = heap.distance(felt.proxy.at).0;
            assert!(distance > radius - 2e-3, "{seed} {n}: {distance}");
            // Still for 400 ticks: no limit cycle.
            if n % 1000 >= 600 {
                ripple[0] = ripple[0].min(felt.force);
                ripple[1] = ripple[1].max(felt.force);
            }
            if n % 1000 == 999 {
                let peak = (ripple[1] - ripple[0]).length();
                assert!(peak < 0.05, "{seed} {n}: {peak}");
                ripple = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            }
        }
    }
}

/// Counts how often it is asked.
struct Counted<O>(O, std::sync::atomic::AtomicUsize);

impl<O: Obstacle> Obstacle for Counted<O> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.1.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.0.distance(p)
    }

    fn finest(&self) -> f64 {
        self.0.finest()
    }
}

#[test]
fn a_tick_asks_few_places() {
    // Sliding over a ball of 50 mm, 2 mm deep, at 76 mm/s.
    let ball = Counted(Ball(DVec3::ZERO, 50.0), Default::default());
    let mut tool = proxy(2.0);
    tick(&mut tool, &ball, DVec3::Z * 60.0);
    let count = 2000;
    for n in 0..count {
        let angle = 0.076 * f64::from(n) / 50.0;
        let at = 50.0 * DVec3::new(libm::sin(angle), 0.0, libm::cos(angle));
        tick(&mut tool, &ball, at);
    }
    let asked = ball.1.into_inner() as f64 / f64::from(count);
    assert!(asked < 6.0, "{asked}");
}

/// Waves of a floor: the height over it, by Newton's first step.
struct Waves {
    height: f64,
    length: f64,
}

impl Obstacle for Waves {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let turn = std::f64::consts::TAU / self.length;
        let above = p.z - self.height * libm::cos(turn * p.x);
        let gradient = DVec3::new(self.height * turn * libm::sin(turn * p.x), 0.0, 1.0);
        let steep = gradient.length();
        (above / steep, gradient / steep)
    }

    fn finest(&self) -> f64 {
        0.2 * self.length
    }
}

#[test]
fn a_spring_that_may_stretch_lags_less_on_waves() {
    let waves = Waves {
        height: 0.1,
        length: 1.0,
    };
    let lag = |stretch: f64| {
        let mut tool = Proxy::new(ProxyOptions {
            radius: 0.0,
            stretch,
            ..ProxyOptions::default()
        });
        tick(&mut tool, &waves, DVec3::Z * 2.0);
        tick(&mut tool, &waves, DVec3::Z * -6.0);
        let mut most = 0.0f64;
        for n in 0..1000 {
            let x = 0.01 * f64::from(n);
            let felt = tick(&mut tool, &waves, DVec3::new(x, 0.0, -6.0));
            assert!(waves.distance(felt.proxy.at).0.abs() < 1e-3);
            most = most.max(x - felt.proxy.at.x);
        }
        most
    };
    let [held, over] = [0.0, 0.25].map(lag);
    // It holds until the surface is as steep as it gets.
    let steepest = 0.1 * std::f64::consts::TAU;
    assert!((held / (6.0 * steepest) - 1.0).abs() < 0.05, "{held}");
    assert!(over < 0.7 * held, "{over} after {held}");
}
