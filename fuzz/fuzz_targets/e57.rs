#![no_main]
//! Any bytes, as they are and with the checksums of their pages set right, behind which nothing else is looked at.
//! Panics of the decoder are caught by the reader.

use formats::ReadLimits;
use libfuzzer_sys::fuzz_target;

const LIMITS: ReadLimits = ReadLimits { max_bytes: 1 << 24 };

fuzz_target!(|bytes: &[u8]| {
    let _ = formats::points::parse_e57(bytes, &LIMITS);
    let mut sealed = bytes.to_vec();
    for page in sealed.chunks_exact_mut(1024) {
        let crc = crc32c::crc32c(&page[..1020]);
        page[1020..].copy_from_slice(&crc.to_be_bytes());
    }
    let _ = formats::points::parse_e57(&sealed, &LIMITS);
});
