//! Touch, where methods fail: each scene in virtual time, with what must hold and who must not hold it.

mod common;
mod sheet;
mod wall;
