//! Small fields, and edits drawn at random.

use bspline::hierarchical::{HierarchicalSpline, Lattice, LevelEdit};
use bspline::{Aabb, AnyField};
use document::{Object, Properties, State};
use formats::field::FieldMeta;
use glam::{DAffine3, DVec3};
use tools::paint::{Layer, LayerError, Substance};

/// SplitMix64.
pub struct Draw(pub u64);

impl Draw {
    pub fn below(&mut self, end: u32) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % u64::from(end)) as u32
    }
}

/// Distance to a ball in a box of five cells.
pub fn ball() -> HierarchicalSpline<f32> {
    of_cells(5)
}

/// The same of forty.
pub fn large() -> HierarchicalSpline<f32> {
    of_cells(40)
}

fn of_cells(cells: u32) -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [cells; 3],
    };
    let middle = DVec3::splat(f64::from(cells) / 2.0);
    HierarchicalSpline::schoenberg(lattice, 1.0, |p| 0.8 * middle.x - p.distance(middle)).unwrap()
}

pub fn object(field: &HierarchicalSpline<f32>) -> Object {
    Object::new(&AnyField::F32(field.clone()), FieldMeta::default()).unwrap()
}

/// An object with one function changed, another one for each number.
pub fn dented(state: &State, name: &str, number: u32) -> State {
    let mut object = state.object(name).unwrap().clone();
    let edit = LevelEdit {
        level: (number % 2) as usize,
        function: [number % 7, number / 7 % 7, number / 49 % 7],
        delta: 0.25 + (number % 1009) as f32,
    };
    object.field = object.field.levels().unwrap().edited(&[edit]).unwrap().into();
    state.with(name, object).unwrap()
}

/// A state some edit away: shape, placement, parents, objects that come, go and change places.
pub fn random_edit(state: &State, draw: &mut Draw) -> State {
    let names: Vec<&String> = state.objects().keys().collect();
    let fresh = ["a", "b", "c", "d"][draw.below(4) as usize];
    if names.is_empty() {
        return state.with(fresh, object(&ball())).unwrap();
    }
    let name = names[draw.below(names.len() as u32) as usize].clone();
    let mut changed = state.objects()[&name].clone();
    match draw.below(14) {
        12 | 13 => {
            // Two substances, and strokes that meet.
            let substance = [Substance::Stiffness, Substance::Friction][draw.below(2) as usize];
            let old = changed.layers.remove(&substance);
            let old = old.unwrap_or_else(|| Layer::empty(&changed.field.lattice(), 0));
            let centre = DVec3::from_array(std::array::from_fn(|_| f64::from(draw.below(6))));
            let reach = Aabb::new(centre - 1.5, centre + 1.5);
            let value = f64::from(draw.below(9));
            let new = old.painted(&reach, |p, _| Ok::<_, LayerError>(Some(value + p.x)));
            changed.layers.insert(substance, new.unwrap());
        }
        0 => return state.without(&name).unwrap_or_else(|_| state.clone()),
        1 => {
            return state
                .with(fresh, object(&ball()))
                .unwrap_or_else(|_| state.clone());
        }
        2 => {
            changed.properties =
                Properties::placed(DAffine3::from_rotation_x(f64::from(draw.below(1000)) / 77.0))
        }
        3 => changed.properties.parent = names.first().map(|n| n.to_string()),
        4 => {
            // Two objects at once.
            let both = dented(state, names[0], draw.below(500));
            return dented(&both, &name, draw.below(500));
        }
        _ => {
            let edits: Vec<_> = (0..1 + draw.below(5))
                .map(|_| LevelEdit {
                    level: draw.below(3) as usize,
                    function: std::array::from_fn(|_| draw.below(8)),
                    delta: draw.below(2000) as f32 / 128.0 - 8.0,
                })
                .collect();
            changed.field = changed.field.levels().unwrap().edited(&edits).unwrap().into();
        }
    }
    state.with(&name, changed).unwrap_or_else(|_| state.clone())
}
