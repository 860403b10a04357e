//! Files cut anywhere and with any bits turned: an error or a volume, and no more memory than allowed.

use std::path::{Path, PathBuf};

use formats::ReadLimits;
use formats::volumes::{self, DicomOptions, Tilt, Uneven};

use super::data;
use super::writer::Picture;

/// Above what any fixture needs, below what a forged number asks for.
const LIMITS: ReadLimits = ReadLimits { max_bytes: 4 << 20 };

fn fixtures(directory: &Path, all: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(directory)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            fixtures(&path, all);
        } else if !path.extension().is_some_and(|e| e == "py" || e == "json") {
            all.push(path);
        }
    }
}

fn bounded(bytes: &[u8], what: &dyn Fn() -> String) -> bool {
    let options = DicomOptions {
        series: None,
        uneven: Uneven::Resample,
        tilt: Tilt::Resample,
    };
    let mut is_read = false;
    let held = allocation_counter::measure(|| {
        is_read = volumes::parse_dicom(bytes, &options, &LIMITS).is_ok();
    });
    assert!(
        held.bytes_max <= LIMITS.max_bytes,
        "{}: {} bytes held",
        what(),
        held.bytes_max
    );
    is_read
}

#[test]
fn any_file_cut_anywhere_is_refused_within_the_ceiling() {
    let mut all = Vec::new();
    fixtures(&data(), &mut all);
    assert!(all.len() > 60);
    let (mut refused, mut tried) = (0, 0);
    for path in all {
        let bytes = std::fs::read(&path).unwrap();
        for length in (0..bytes.len()).step_by(7) {
            tried += 1;
            let what = || format!("{} cut at {length}", path.display());
            refused += usize::from(!bounded(&bytes[..length], &what));
        }
    }
    // The last bytes may be padding, or a delimiter that nothing follows.
    assert!(tried - refused < tried / 100, "{refused} of {tried}");
}

#[test]
fn any_bits_turned_are_refused_or_read_within_the_ceiling() {
    let mut all = Vec::new();
    fixtures(&data(), &mut all);
    // A fixed sequence of pseudorandom numbers (Marsaglia, xorshift64).
    let mut state = 0x9E37_79B9_7F4A_7C15u64;
    let mut random = move |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    for path in all {
        let good = std::fs::read(&path).unwrap();
        for case in 0..150 {
            let mut bytes = good.clone();
            for _ in 0..1 + case % 4 {
                let at = 132 + random(bytes.len() - 132);
                // Lengths and counts are forged best by whole bytes.
                bytes[at] = if case % 2 == 0 {
                    bytes[at] ^ 1 << random(8)
                } else {
                    [0, 1, 0x7F, 0xFF][random(4)]
                };
            }
            bounded(&bytes, &|| format!("{} case {case}", path.display()));
        }
    }
}

/// Reading by recursion would overflow the stack, which nothing can catch.
#[test]
fn sequences_nested_without_end_are_refused_or_passed_over() {
    // Undefined lengths; shared functional groups, in them plane positions in plane positions.
    for tag in [[0x20, 0, 0x13, 0x91], [9, 0, 1, 0x10]] {
        let mut bytes = Picture::axial(0.0).bytes();
        let pixels = bytes
            .windows(4)
            .rposition(|w| w == [0xE0, 0x7F, 0x10, 0])
            .unwrap();
        bytes.truncate(pixels);
        let open = |tag: [u8; 4]| {
            [
                &tag[..],
                b"SQ\0\0\xFF\xFF\xFF\xFF",
                b"\xFE\xFF\0\xE0\xFF\xFF\xFF\xFF",
            ]
            .concat()
        };
        bytes.extend(open([0, 0x52, 0x29, 0x92]));
        for _ in 0..50_000 {
            bytes.extend(open(tag));
        }
        let e = volumes::parse_dicom(&bytes, &DicomOptions::default(), &LIMITS).unwrap_err();
        assert!(e.to_string().contains("nested more than 64 deep"), "{e}");
    }
}
