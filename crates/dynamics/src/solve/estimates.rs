//! When the extreme eigenvalues of a smoother under the brush are estimated, and what is known of them.
//!
//! A dab changes them little after the first, an estimate has a tenth to spare, and costs more than a solve. One that has become
//! too low makes the cycle a bad preconditioner, or none: then a solve fails, and begins again with a new estimate.

use serde::{Deserialize, Serialize};

/// Dabs of paint that one serves. 24/32, contrasts of 10 to 1000: as many iterations as with one a dab.
const SERVES: usize = 8;

/// How many dabs the estimate in use has served after one more, that one included; 1 where it is made for this one.
pub(super) fn after(dabs: usize) -> usize {
    if dabs >= SERVES { 1 } else { dabs + 1 }
}

/// The estimates of a cycle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Estimates {
    dabs: usize,
    /// Largest of the smoother and of the blocks on each level, and the least of the smoother, as bits: some formats round.
    levels: Vec<[u64; 3]>,
}

impl Estimates {
    pub fn new(dabs: usize, levels: impl Iterator<Item = [f64; 3]>) -> Self {
        Self {
            dabs,
            levels: levels.map(|all| all.map(f64::to_bits)).collect(),
        }
    }

    /// Dabs that they have served.
    pub fn dabs(&self) -> usize {
        self.dabs
    }

    /// Largest of the smoother and of the blocks on each level, and the least of the smoother.
    pub fn levels(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.levels.iter().map(|all| all.map(f64::from_bits))
    }
}
