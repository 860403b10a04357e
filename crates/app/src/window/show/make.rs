//! How what is shown beside the solids is made.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};

use bspline::hierarchical::Lattice;
use document::read_report;
use fitting::FitReport;
use formats::field::SourceKind;
use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use tools::paint::{Substance, values};

use super::{Layer, points};
use crate::cli::quantity::human_count;
use crate::view::cells::{ErrorScale, band, cells, short, titled};
use crate::view::{Legend, Patch, Stretch, Tint, Tinted, second};
use crate::window::orders::Thing;

/// Triangles that a second surface may have, whatever the first has.
const LEAST: usize = 60_000;

/// What a layer is to be made of.
#[derive(Clone)]
pub struct Wish {
    /// Which.
    pub layer: Layer,
    /// Of these objects.
    pub things: Vec<Thing>,
    /// Which kind of it.
    pub kind: u8,
    /// Of a second surface, and within which object it lies, if it does.
    pub density: f64,
    /// Triangles of the first.
    pub most: usize,
    /// Where scans may be.
    pub scans: Vec<PathBuf>,
    /// The scene that it lies in, and the origin of that.
    pub scene: u64,
    /// The same.
    pub origin: DVec3,
}

impl Wish {
    /// Whether the same is made of both.
    pub fn is_like(&self, other: &Self) -> bool {
        let is_same = |(a, b): (&Thing, &Thing)| {
            let is_same_fit = Arc::ptr_eq(&a.object.meta, &b.object.meta);
            let is_same_field =
                Arc::ptr_eq(&a.field, &b.field) || matches!(self.layer, Layer::Cells | Layer::Points);
            a.name == b.name && is_same_fit && is_same_field
        };
        (self.layer, self.kind, self.scene, self.density)
            == (other.layer, other.kind, other.scene, other.density)
            && self.origin == other.origin
            && self.things.len() == other.things.len()
            && self.things.iter().zip(&other.things).all(is_same)
    }
}

/// What was made.
pub enum Made {
    /// Nothing, or it is shown no more.
    Nothing,
    /// Triangles.
    Patches(Vec<Patch>, Option<String>),
    /// Colours.
    Tinted(Tinted),
    /// Lines or dots.
    Lines(Vec<Stretch>),
}

/// What was made, what its colours mean, and what is to be said of it.
pub type Answer = (Made, Option<Legend>, String);

/// What became of a wish.
pub struct Done {
    /// It.
    pub wish: Wish,
    /// What was made of it, or why nothing was.
    pub made: Result<Answer, String>,
}

/// Makes what is wished until nobody wishes any more; of each layer the last wish alone.
pub fn work(wishes: &Receiver<Wish>, tell: &Sender<Done>, wake: &dyn Fn()) {
    while let Ok(first) = wishes.recv() {
        let all = std::iter::once(first).chain(wishes.try_iter());
        let last: BTreeMap<Layer, Wish> = all.map(|wish| (wish.layer, wish)).collect();
        for wish in last.into_values() {
            let made = make(&wish);
            if tell.send(Done { wish, made }).is_err() {
                return;
            }
            wake();
        }
    }
}

fn make(wish: &Wish) -> Result<Answer, String> {
    match wish.layer {
        Layer::Tint if wish.kind == Tint::Errors as u8 => errors(&wish.things),
        Layer::Tint if wish.kind == Tint::Touch as u8 => painted(
            &wish.things,
            Substance::SurfaceStiffness,
            "Stiffness to the touch",
            "N/m",
        ),
        Layer::Tint => painted(&wish.things, Substance::Friction, "Friction", ""),
        layer => {
            let thing = wish.things.first().ok_or("no object is chosen")?;
            match layer {
                Layer::Second => veil(wish, thing),
                Layer::Cells => {
                    let placed = (thing.world_from_object, wish.origin);
                    let lattice = thing.object.field.lattice();
                    let (by_error, unit) = (
                        wish.kind > 0,
                        if wish.kind > 0 {
                            residual_unit(thing)
                        } else {
                            thing.unit
                        },
                    );
                    let (lines, legend, told) = cells(&lattice, &report(thing)?, by_error, unit, placed);
                    Ok((Made::Lines(lines), Some(legend), told))
                }
                _ => points::points(thing, &wish.scans, wish.origin),
            }
        }
    }
}

fn veil(wish: &Wish, thing: &Thing) -> Result<Answer, String> {
    let most = wish.most.max(LEAST);
    let made = second(
        &thing.object,
        wish.density,
        thing.world_from_object,
        wish.origin,
        most,
    );
    let patches = made.map_err(|e| format!("the second surface cannot be followed: {e}"))?;
    let count: usize = patches.iter().map(|p| p.indices.len() / 3).sum();
    match count {
        0 => Err("nowhere is the density so; choose another one".into()),
        count => {
            let told = format!("{} triangles", human_count(count));
            let within = (wish.density > thing.iso).then(|| thing.name.clone());
            Ok((Made::Patches(patches, within), None, told))
        }
    }
}

/// What the fit of an object says.
fn report(thing: &Thing) -> Result<FitReport, String> {
    let meta = &thing.object.meta;
    let report = match meta.leaves.is_empty() {
        true => Err("no fit".to_string()),
        false => read_report(meta, thing.coefficients),
    };
    report.map_err(|_| {
        format!(
            "{} knows of no errors and cells, as what was fitted does",
            thing.name
        )
    })
}

/// Unit of the residuals of an object's fit.
fn residual_unit(thing: &Thing) -> &str {
    match thing.object.meta.source {
        SourceKind::Volume => &thing.object.meta.density_unit,
        _ => thing.unit,
    }
}

/// Rms errors of the leaves of fits as colours.
fn errors(things: &[Thing]) -> Result<Answer, String> {
    let mut fits = BTreeMap::new();
    let mut first = None;
    for thing in things {
        let Ok(report) = report(thing) else { continue };
        let scale = ErrorScale::of(&report);
        first.get_or_insert((scale, residual_unit(thing), report.rms));
        let known = Known::of(&thing.object.field.lattice(), &report);
        fits.insert(
            thing.name.clone(),
            (thing.world_from_object.inverse(), known, scale),
        );
    }
    let Some((scale, unit, rms)) = first else {
        return Err("no object knows of its errors, as what was fitted does".into());
    };
    let rms = format!("{} {unit}", short(rms));
    let told = format!("Of the fit, before edits: rms {} in all", rms.trim_end());
    let shares = move |name: &str, places: &[DVec3]| match fits.get(name) {
        Some((own, known, scale)) => {
            let share = |p: &DVec3| {
                let rms = known.rms(own.transform_point3(*p));
                rms.map_or(-1.0, |rms| scale.share(rms as f32) as f32)
            };
            places.par_iter().map(share).collect()
        }
        None => vec![-1.0; places.len()],
    };
    let legend = scale.legend("Rms error of the fit", unit);
    Ok((Made::Tinted(Tinted(Arc::new(shares))), Some(legend), told))
}

/// Doublings of the finest cells up to which samples still speak for a place.
const NEAR: u32 = 4;

/// Errors of the samples in cells of a fit, and in cells that are made of several: sparse scans leave most of the finest ones empty.
struct Known {
    lattice: Lattice,
    finest: u8,
    /// Of each cell, by its doublings and its place among those, the sum of all squares, and samples.
    of_cell: FxHashMap<(u32, [u32; 3]), [f64; 2]>,
}

impl Known {
    fn of(lattice: &Lattice, report: &FitReport) -> Self {
        let mut of_cell: FxHashMap<_, [f64; 2]> = FxHashMap::default();
        let with_samples = report.leaves.iter().filter(|leaf| leaf.sample_count > 0);
        let finest = with_samples.clone().map(|leaf| leaf.level).max().unwrap_or(0);
        for leaf in with_samples {
            let count = f64::from(leaf.sample_count);
            let own = u32::from(finest - leaf.level);
            for doublings in own..=own.max(NEAR) {
                let cell = leaf.cell.map(|n| n >> (doublings - own));
                let [squares, samples] = of_cell.entry((doublings, cell)).or_default();
                *squares += count * f64::from(leaf.rms).powi(2);
                *samples += count;
            }
        }
        Self {
            lattice: *lattice,
            finest,
            of_cell,
        }
    }

    /// Of the smallest cell round a place that has samples.
    fn rms(&self, p: DVec3) -> Option<f64> {
        let q = self.lattice.world_from_lattice.inverse().transform_point3(p);
        let cell = (q * f64::from(self.finest).exp2()).floor();
        // Negative numbers become 0: places beside the lattice are as those at its side.
        let cell = cell.to_array().map(|n| n as u32);
        (0..=NEAR.max(self.finest.into())).find_map(|doublings| {
            let key = (doublings, cell.map(|n| n >> doublings));
            let [squares, samples] = self.of_cell.get(&key)?;
            Some((squares / samples).sqrt())
        })
    }
}

/// Something painted as colours, from 0 to the most that there is at corners of a coarse grid.
fn painted(things: &[Thing], substance: Substance, name: &str, unit: &str) -> Result<Answer, String> {
    let layers: BTreeMap<String, _> = things
        .iter()
        .filter(|thing| thing.object.layers.contains_key(&substance))
        .map(|thing| {
            let own = thing.world_from_object.inverse();
            (thing.name.clone(), (own, thing.object.layers.clone()))
        })
        .collect();
    if layers.is_empty() {
        return Err(format!("no object has {} painted on it", substance.name()));
    }
    let most = things
        .iter()
        .map(|thing| most(thing, substance))
        .fold(0.0, f64::max);
    let most = if most > 0.0 { most } else { 1.0 };
    let shares = move |name: &str, places: &[DVec3]| {
        let painted = layers.get(name).and_then(|(own, layers)| {
            let places: Vec<DVec3> = places.iter().map(|p| own.transform_point3(*p)).collect();
            values(layers, substance, &places)
        });
        match painted {
            Some(painted) => painted
                .into_iter()
                .map(|v| (v / most).clamp(0.0, 1.0) as f32)
                .collect(),
            None => vec![-1.0; places.len()],
        }
    };
    let legend = Legend {
        title: titled(name, unit),
        colors: band(),
        marks: vec![(0.0, "0".into()), (1.0, short(most))],
    };
    Ok((
        Made::Tinted(Tinted(Arc::new(shares))),
        Some(legend),
        String::new(),
    ))
}

/// The most that is painted at the corners of a grid over an object.
fn most(thing: &Thing, substance: Substance) -> f64 {
    const SIDE: usize = 48;
    let b = &thing.own_box;
    let place = |n: usize| {
        let share = [n / (SIDE * SIDE), n / SIDE % SIDE, n % SIDE].map(|n| n as f64 / (SIDE - 1) as f64);
        b.min + DVec3::from_array(share) * b.size()
    };
    let places: Vec<DVec3> = (0..SIDE * SIDE * SIDE).map(place).collect();
    let painted = values(&thing.object.layers, substance, &places).unwrap_or_default();
    painted.into_iter().fold(0.0, f64::max)
}

/// What the colours of painted stiffness mean: a factor on that of the springs.
pub fn stiffness_legend() -> Legend {
    // As `shaders/surface.wgsl` mixes them.
    let [clay, stiff, soft] = [[0.612, 0.279, 0.148], [0.05, 0.20, 0.55], [0.80, 0.42, 0.05]];
    let color = |n: i32| {
        let share = f64::from(n) / 16.0;
        let to: [f64; 3] = if share > 0.0 { stiff } else { soft };
        let mixed = share.abs().sqrt() * 0.85;
        std::array::from_fn(|c| {
            let linear: f64 = clay[c] + mixed * (to[c] - clay[c]);
            (255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055)).round() as u8
        })
    };
    Legend {
        title: "Painted stiffness, times".into(),
        colors: (-16..=16).map(color).collect(),
        marks: vec![(0.0, "1/16".into()), (0.5, "1".into()), (1.0, "16".into())],
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use document::{Object, State, with_report};
    use fitting::{Leaf, StopReason};
    use formats::field::FieldMeta;

    use super::*;
    use crate::cli::desk_files;

    /// The block of clay as if it had been fitted, with one cell far off and one near the tolerance.
    fn fitted() -> Thing {
        let (name, Object { field, .. }) = desk_files::clay_block().unwrap();
        let cells = field.lattice().cells_at(0);
        let middle = cells.map(|n| n / 2);
        let leaf = |cell: [u32; 3], rms: f32, sample_count: u32| Leaf {
            level: 0,
            cell,
            sample_count,
            rms,
            max: rms,
            reason: StopReason::Tolerance,
        };
        let report = FitReport {
            tolerance: 0.5,
            rms: 0.3,
            leaves: vec![
                leaf(middle, 0.5, 3),
                leaf([0; 3], 9.0, 1),
                leaf([1, 0, 0], 0.0, 0),
            ],
            ..FitReport::default()
        };
        let meta = FieldMeta {
            iso: Some(0.0),
            source: SourceKind::Cloud,
            unit: formats::Unit::Millimetre,
            ..FieldMeta::default()
        };
        let object = Object::of(field, with_report(meta, &report));
        let state = State::new().with(&name, object).unwrap();
        Thing::of(&state, &name).unwrap()
    }

    fn wish(layer: Layer, kind: u8, thing: Thing) -> Wish {
        Wish {
            layer,
            things: vec![thing],
            kind,
            density: 1.0,
            most: 0,
            scans: Vec::new(),
            scene: 0,
            origin: DVec3::ZERO,
        }
    }

    #[test]
    fn errors_are_those_of_the_cell_round_a_place() {
        let thing = fitted();
        let lattice = thing.object.field.lattice();
        let at = |cell: [f64; 3]| {
            lattice
                .world_from_lattice
                .transform_point3(DVec3::from_array(cell) + 0.5)
        };
        let middle = lattice.cells_at(0).map(|n| f64::from(n / 2));
        let (made, legend, told) = make(&wish(Layer::Tint, Tint::Errors as u8, thing.clone())).unwrap();
        let Made::Tinted(Tinted(shares)) = made else {
            panic!("no colours")
        };
        let places = [at(middle), at([0.0; 3]), at([1.0, 0.0, 0.0]), at([2.0, 0.0, 0.0])];
        assert_eq!(shares(&thing.name, &places), [0.5, 1.0, 1.0, 1.0]);
        assert_eq!(shares("another", &places[..1]), [-1.0]);
        let legend = legend.unwrap();
        assert_eq!(legend.title, "Rms error of the fit, mm");
        assert_eq!(legend.marks[1], (0.5, "0.5".into()));
        assert!(told.contains("0.3 mm"), "{told}");
    }

    #[test]
    fn what_an_object_does_not_know_is_told() {
        let (name, object) = desk_files::clay_block().unwrap();
        let state = State::new().with(&name, object).unwrap();
        let thing = Thing::of(&state, &name).unwrap();
        for (layer, kind, word) in [
            (Layer::Tint, Tint::Errors as u8, "errors"),
            (Layer::Tint, Tint::Touch as u8, "painted"),
            (Layer::Cells, 0, "cells"),
            (Layer::Points, 0, "no file"),
        ] {
            let why = make(&wish(layer, kind, thing.clone())).err().unwrap();
            assert!(why.contains(word), "{why}");
        }
        let nowhere = Wish {
            density: 1e9,
            ..wish(Layer::Second, 0, thing)
        };
        assert!(make(&nowhere).err().unwrap().contains("nowhere"));
    }

    /// Of several wishes for one layer the last is made, and it ends when nobody wishes any more.
    #[test]
    fn the_last_wish_counts() {
        let (wishes, asked) = channel();
        let (tell, done) = channel();
        for density in [0.5, 1.5] {
            let wish = wish(Layer::Second, 0, fitted());
            wishes.send(Wish { density, ..wish }).unwrap();
        }
        drop(wishes);
        work(&asked, &tell, &|| ());
        drop(tell);
        let made: Vec<Done> = done.iter().collect();
        assert_eq!(made.len(), 1);
        assert_eq!(made[0].wish.density, 1.5);
        assert!(made[0].made.is_ok());
    }
}
