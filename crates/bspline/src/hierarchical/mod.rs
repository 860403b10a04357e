//! Dyadic levels of uniform cubic B-splines whose active functions are chosen one by one.
//!
//! The degree is 3 and no parameter. Of degree `p` a brick would hold `(8 + p)³` totals, and stable Rust cannot make
//! that an array by a constant parameter: sizes known at run time would cost the inner loops, now over arrays of four and
//! of eleven, their speed. The kernels, the restriction of bounds, the two-scale rule, the Gram matrices of the fits and
//! the file format all rest on 3. Other degrees, 1 to 5 and another on each axis, are
//! [`TensorSpline`](crate::TensorSpline)'s.
//!
//! A field never changes: [`HierarchicalSpline::edited`] makes a new one that shares the bricks it leaves alone. The
//! bricks are nodes of one tree (`node`); an edit copies the paths to what it changes (`graft`), then makes the totals
//! and summaries on them anew (`renew`).

mod along;
mod batch;
mod block_edit;
mod bounds;
mod brick;
mod build;
mod changed_brick;
mod curvature;
mod difference;
mod digest;
mod edit;
mod evaluate;
mod functions;
mod graft;
mod grid;
mod grown;
mod kernel;
mod lattice;
mod local;
mod motion;
mod node;
mod prolong;
mod renew;
mod slopes;
mod spline;
mod totals;
mod versions;
mod view;
mod window;

pub use block_edit::{BlockEdit, Change};
pub use brick::{
    BRICK, BRICK_LEN, BrickKey, Corrections, DenseCorrections, HALO, HALO_LEN, LevelCorrections, active_slots,
};
pub use difference::{BrickChange, BrickDiff, DiffError};
pub use digest::digest_below;
pub use edit::{BrickEdit, LevelEdit};
pub use functions::{EditError, MAX_LEVELS};
pub use grown::shifted;
pub use lattice::Lattice;
pub use local::{LocalField, LocalFields};
pub use motion::Motion;
pub use prolong::refine_block;
pub use spline::HierarchicalSpline;
pub use view::Brick;
