#![no_main]
//! One file of any bytes: an error or a volume, within the ceiling.

use formats::ReadLimits;
use formats::volumes::{DicomOptions, Tilt, Uneven};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let options = DicomOptions {
        series: None,
        uneven: if bytes.len() % 2 == 0 { Uneven::Resample } else { Uneven::Refuse },
        tilt: if bytes.len() % 3 == 0 { Tilt::Resample } else { Tilt::Keep },
    };
    let _ = formats::volumes::parse_dicom(bytes, &options, &ReadLimits { max_bytes: 1 << 24 });
});
