//! Strokes at random places of the scans in `data/`: where they end, how far they go beyond, in how many steps.
//!
//! `cargo bench -p tools --bench scans [-- PLACES]`, 8 places on each ground if not said; the first is always the one of
//! `strokes`. Each place takes two sizes of each tool, even and half ten times as stiff, out of the solid or into it by chance.
//! Ground: the bunny; the skin of the head, pulled on as well as pressed; and surfaces inside the head. A row counts the strokes
//! of which every path ends within what is asked for (1 %, areas 0.985 to 1.02, tracks 1.5 %), and within 5 %; the
//! other numbers are medians, of the overshoot also the largest.

#[path = "common/scans.rs"]
mod scans;

use bspline::Field;
use glam::DVec3;
use tools::force::{ForceReport, nearest_surface};
use tools::study::{Sculpture, StrokeKind, half_painted};

/// Places on a ground if the command does not say.
const PLACES: u64 = 8;
/// Most steps of a stroke.
const STEPS: usize = 400;
/// Steps of a ray to the skin.
const LOOKS: usize = 400;

/// Where strokes are made.
struct Ground {
    name: &'static str,
    sculpture: Sculpture,
    /// Large radii that a place keeps off the walls of the box.
    room: f64,
    /// Whether places are seen from outside.
    is_skin: bool,
}

/// Numbers by chance from 0 to 1: xorshift.
struct Draw(u64);

impl Draw {
    fn new(seed: u64) -> Self {
        let mut draw = Self(0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(seed + 1) | 1);
        for _ in 0..5 {
            draw.number();
        }
        draw
    }

    fn number(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number())
    }
}

impl Ground {
    /// A place of the surface.
    fn place(&self, draw: &mut Draw) -> DVec3 {
        let (field, iso) = (&self.sculpture.field, self.sculpture.iso);
        let whole = field.lattice().world_box();
        let size = whole.size().max_element();
        let room = self.room * self.sculpture.sizes().radii[1].0;
        loop {
            let mut from = whole.min + room + draw.vector() * (whole.size() - 2.0 * room);
            if self.is_skin {
                let way = (draw.vector() - 0.5).normalize();
                let ray = (0..LOOKS).map(|i| from + (1.0 - i as f64 / LOOKS as f64) * 2.0 * size * way);
                let is_solid =
                    |p: &DVec3| p.cmpgt(whole.min).all() && p.cmplt(whole.max).all() && field.value(*p) > iso;
                let Some(first) = { ray }.find(is_solid) else {
                    continue;
                };
                from = first;
            }
            let is_within = |p: &DVec3| (*p - whole.min).min(whole.max - *p).min_element() > room;
            if let Some(at) = nearest_surface(field, iso, from, 0.2 * size)
                .ok()
                .filter(is_within)
            {
                return at;
            }
        }
    }

    fn strokes(&self, places: u64, kind: StrokeKind) -> [Vec<ForceReport>; 2] {
        let mut done = [const { Vec::new() }; 2];
        let sizes = self.sculpture.sizes();
        for seed in 0..places {
            let mut draw = Draw::new(seed);
            let at = match seed {
                0 => self.sculpture.place().expect("a surface"),
                _ => self.place(&mut draw),
            };
            let is_out = draw.number() < 0.5 || seed == 0;
            for (radius, _) in sizes.radii {
                let layers = half_painted(&self.sculpture, at, 24.0 * radius, sizes.level).expect("paint");
                for (done, is_painted) in done.iter_mut().zip([false, true]) {
                    // A curve may leave the field, or come to an edge.
                    let begun = kind.begin(&self.sculpture.field, self.sculpture.iso, at, radius, is_out);
                    let Ok(mut stroke) = begun else { continue };
                    if is_painted {
                        stroke = stroke.painted(&layers).expect("paint");
                    }
                    let mut steps = 0;
                    while steps < STEPS && !stroke.is_over() {
                        if let Err(e) = stroke.step() {
                            eprintln!("{kind:?} at {at}: {e}");
                            break;
                        }
                        steps += 1;
                    }
                    done.push(stroke.release().expect("a field").1);
                }
            }
        }
        done
    }
}

/// What is asked for.
fn bar(kind: StrokeKind) -> [f64; 2] {
    match kind {
        StrokeKind::Point | StrokeKind::Curve => [0.99, 1.01],
        StrokeKind::Area => [0.985, 1.02],
        StrokeKind::Track => [0.985, 1.015],
    }
}

fn main() {
    let places = std::env::args().filter_map(|word| word.parse().ok()).next();
    let places = places.unwrap_or(PLACES);
    let ground = |name, sculpture, room, is_skin| Ground {
        name,
        sculpture,
        room,
        is_skin,
    };
    println!(
        "{:12} {:6} {:12} {:>7} {:>6} {:>6} {:>16} {:>14} {:>6} {:>11}",
        "ground",
        "tool",
        "matter",
        "strokes",
        "within",
        "in 5 %",
        "ends",
        "overshoot",
        "steps",
        "solves/step"
    );
    for ground in [
        ground("bunny", scans::bunny(), 4.0, false),
        ground("skin", scans::head(), 8.0, true),
        ground("inside head", scans::head(), 8.0, false),
    ] {
        for kind in StrokeKind::ALL {
            let both = ground.strokes(places, kind);
            for (reports, matter) in both.iter().zip(["even", "half painted"]) {
                print!("{:12} {:6} {matter:12} ", ground.name, kind.name());
                println!("{}", row(reports, bar(kind)));
            }
        }
    }
}

fn row(reports: &[ForceReport], bar: [f64; 2]) -> String {
    let within = |[least, most]: [f64; 2]| {
        let is_in = |r: &&ForceReport| r.arrival.least >= least && r.arrival.most <= most;
        reports.iter().filter(is_in).count()
    };
    let middle = |of: fn(&ForceReport) -> f64| {
        let mut all: Vec<f64> = reports.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let sum = |of: fn(&ForceReport) -> usize| reports.iter().map(of).sum::<usize>() as f64;
    let most = reports.iter().map(|r| r.overshoot).fold(0.0, f64::max);
    format!(
        "{:>7} {:>6} {:>6} {:>7.3} .. {:.3} {:>5.1} .. {:>3.0} % {:>6.0} {:>11.2}",
        reports.len(),
        within(bar),
        within([0.95, 1.05]),
        middle(|r| r.arrival.least),
        middle(|r| r.arrival.most),
        100.0 * middle(|r| r.overshoot),
        100.0 * most,
        middle(|r| r.steps as f64),
        sum(|r| r.solves) / sum(|r| r.steps)
    )
}
