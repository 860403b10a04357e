//! Touch, where methods fail: each scene in virtual time, with what must hold and who must not hold it.
//!
//! Criteria: P1 no limit cycle, P2 passivity, P3 continuity, P4 no pop-through, P5 the right force. What they mean in figures is in
//! `common::scene`. Beside the proxy stand the stateless contact, whose failures are held as they were measured, and two
//! methods that are known to fail, so that each criterion is seen to be able to.

mod common;

mod band;
mod bumps;
mod carve;
mod channel;
mod delay;
mod deposit;
mod edge;
mod fast;
mod faults;
mod field;
mod friction;
mod gated;
mod groove;
mod inside;
mod jitter;
mod memory;
mod multi;
mod same;
mod saturated;
mod scans;
mod several;
mod sharp;
mod sheet;
mod slow_field;
mod snapshots;
mod wall;
mod warm;
mod zoom;
