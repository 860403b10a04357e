//! What may be touched of a document, round the hand.

use std::sync::Arc;

use document::State;
use glam::DVec3;
use tools::haptics::{Demand, Snapshot, SnapshotMaker, Touch, TouchedObject};

/// Makes what may be touched of the states of a document.
pub struct Toucher {
    maker: SnapshotMaker,
    steps: u64,
}

impl Toucher {
    /// For a tool.
    pub fn new(demand: Demand) -> Self {
        Self {
            maker: SnapshotMaker::new(demand),
            steps: 0,
        }
    }

    /// The objects of a state that have a surface, round a place of the scene. Of what was made before, that goes which nobody
    /// holds any more.
    pub fn show(&mut self, state: &State, at: DVec3) -> Arc<Snapshot> {
        let objects = state.objects().iter().filter_map(|(name, object)| {
            Some(TouchedObject {
                id: number(name),
                field: object.field.shared(),
                iso: object.iso()?,
                world_from_object: state.placement(name).ok()?,
                layers: &object.layers,
                default: Touch::default(),
            })
        });
        let objects: Vec<_> = objects.collect();
        self.steps += 1;
        self.maker.free();
        self.maker.make(at, &objects, self.steps)
    }
}

/// A number for a name, the same whatever other names there are (FNV-1a).
fn number(name: &str) -> u64 {
    let mix = |sum: u64, byte: u8| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    name.bytes().fold(0xcbf2_9ce4_8422_2325, mix)
}
