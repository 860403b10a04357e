//! Solids of a density that falls by 40 a length, as tools find them.

use bspline::AnyField;
use bspline::hierarchical::{HierarchicalSpline, Lattice};
use document::{Command, Document, Object, State};
use fitting::Control;
use formats::field::FieldMeta;
use glam::{DAffine3, DVec3};
use serde_json::Value;

pub const ISO: f64 = 300.0;
const SLOPE: f64 = 40.0;

pub fn state_of(distance: impl Fn(DVec3) -> f64) -> State {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [24; 3],
    };
    let field: HierarchicalSpline<f32> =
        HierarchicalSpline::schoenberg(lattice, SLOPE, |p| SLOPE * distance(p) + ISO).unwrap();
    let meta = FieldMeta {
        iso: Some(ISO),
        ..FieldMeta::default()
    };
    let object = Object::new(&AnyField::F32(field), meta).unwrap();
    State::new().with("clay", object).unwrap()
}

/// What lies below `z = 12`.
pub fn block() -> State {
    state_of(|p| 12.0 - p.z)
}

/// A plate of 1.6 below and above `z = 12`.
pub fn plate() -> State {
    state_of(|p| {
        let q = (p - 12.0).abs() - DVec3::new(9.0, 9.0, 1.6);
        -(q.max(DVec3::ZERO).length() + q.max_element().min(0.0))
    })
}

/// Height of the surface over `(x, y)`, from 12 up.
pub fn height(state: &State, x: f64, y: f64) -> f64 {
    let field = state.object("clay").unwrap().field.as_field();
    let (mut low, mut high) = (3.0, 21.0);
    for _ in 0..60 {
        let z = 0.5 * (low + high);
        let is_in = field.value(DVec3::new(x, y, z)) > ISO;
        *(if is_in { &mut low } else { &mut high }) = z;
    }
    low - 12.0
}

/// The edits of a document done again on its first state, by as many threads.
pub fn again(document: &mut Document, threads: usize) -> State {
    let commands: Vec<Value> = (0..document.counts().unwrap().done)
        .map(|n| document.command(n).unwrap())
        .collect();
    let first = document.first_state().unwrap();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        commands.into_iter().fold(first, |state, value| {
            let command: Command = serde_json::from_value(value).unwrap();
            command.apply(&state, &mut Control::default()).unwrap().0
        })
    })
}
