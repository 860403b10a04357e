use dynamics::patch::PatchError;
use dynamics::region::RegionError;

/// Why a scene cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// Something in the scene does not fit the field, the region, or another part of the scene.
    #[error("{place}: {why}")]
    Scene {
        /// Table and key.
        place: String,
        /// What is wrong, and the remedy.
        why: String,
    },
    /// A step failed.
    #[error("at {time} s: {source}")]
    Step {
        /// When.
        time: f64,
        /// Why.
        source: PatchError,
    },
    /// The shape cannot be written back.
    #[error("at {time} s: {source}")]
    Bake {
        /// When.
        time: f64,
        /// Why.
        source: RegionError,
    },
}

/// What is wrong at a place of the scene.
pub fn wrong(place: impl Into<String>, why: impl ToString) -> SimulateError {
    SimulateError::Scene {
        place: place.into(),
        why: why.to_string(),
    }
}
