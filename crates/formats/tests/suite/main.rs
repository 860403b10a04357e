//! Readers and writers, fed by others and by malice. One binary: each file of its own would be linked with all that is tested.

mod damaged;
mod dicom;
mod hostile_input;
mod other_writers;
mod scans;
mod volume_memory;
mod volume_round_trip;
mod volumes_by_others;
mod volumes_damaged;
