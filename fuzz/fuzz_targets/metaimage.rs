#![no_main]
//! Any bytes: an error or a result, within the ceiling.

use formats::ReadLimits;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = formats::volumes::parse_metaimage(bytes, &ReadLimits { max_bytes: 1 << 24 });
});
