#![no_main]
//! Any chunks: an error, a field, a spline on knots of its own, or a difference of either, within the ceiling.
//!
//! Checksums are set right first: behind wrong ones the fuzzer would never get.

use bspline::hierarchical::Lattice;
use formats::{ReadLimits, field};
use libfuzzer_sys::fuzz_target;

/// The bytes with right checksums of the chunks that begin at `at`.
fn checked(bytes: &[u8], mut at: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    while let Some(head) = bytes.get(at..at + 28) {
        let length = u64::from_le_bytes(head[8..16].try_into().unwrap());
        let Some(end) = usize::try_from(length).ok().and_then(|n| n.checked_add(at + 28)) else { break };
        let Some(payload) = bytes.get(at + 28..end) else { break };
        let mut crc = crc32fast::Hasher::new();
        crc.update(&head[..24]);
        crc.update(payload);
        bytes[at + 24..at + 28].copy_from_slice(&crc.finalize().to_le_bytes());
        at = end;
    }
    bytes
}

fuzz_target!(|bytes: &[u8]| {
    let limits = ReadLimits { max_bytes: 1 << 24 };
    let _ = field::decode(&checked(bytes, 12), &limits);
    let _ = field::decode_knots::<f32>(&checked(bytes, 12), &limits);
    let _ = field::decode_knots_difference::<f32>(&checked(bytes, 8), &limits);
    let lattice = Lattice {
        world_from_lattice: Default::default(),
        cells: [40, 30, 20],
    };
    let _ = field::decode_difference::<f32>(&checked(bytes, 8), &lattice, &limits);
});
