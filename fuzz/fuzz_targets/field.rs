#![no_main]
//! Any chunks: an error or a field, within the ceiling.
//!
//! Checksums are set right first: behind wrong ones the fuzzer would never get.

use formats::{ReadLimits, field};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = bytes.to_vec();
    let mut at = 12;
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
    let _ = field::decode(&bytes, &ReadLimits { max_bytes: 1 << 24 });
});
