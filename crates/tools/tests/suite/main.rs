//! What tools do to a field, and what a hand feels. One binary: each file of its own would be linked with all that is tested.

mod force;
mod geometric;
mod haptics;
