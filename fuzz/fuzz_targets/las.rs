#![no_main]
//! Any bytes: an error or a result, within the ceiling. Panics of the decoder are caught by the reader.

use formats::ReadLimits;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: std::panic::set_hook(Box::new(|_| {})), |bytes: &[u8]| {
    let _ = formats::points::parse_las(bytes, &ReadLimits { max_bytes: 1 << 24 });
});
