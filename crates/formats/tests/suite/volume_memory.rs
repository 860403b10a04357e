//! What reading, looking through and writing a volume hold at their peak.

use formats::volumes::{self, Grid, StoreAs, VolumeOptions};
use formats::{FormatError, ReadLimits, Unit};
use glam::DAffine3;

const DIMS: [usize; 3] = [160, 120, 90];
const SLICE: u64 = 160 * 120 * 4;

/// Windows and tables of the decompressors, names, messages.
const UNCOUNTED: u64 = 200_000;
/// Tables and window of a compressor, a block of VTI in and out, the buffers of the output.
const WRITER: u64 = 1_500_000;

fn held(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).bytes_max
}

#[test]
fn reading_holds_what_it_said_and_looking_and_writing_hold_slices() {
    let directory = tempfile::tempdir().unwrap();
    let grid = Grid {
        dims: DIMS,
        world_from_voxel: DAffine3::IDENTITY,
        unit: Unit::Millimetre,
    };
    for name in ["v.nii", "v.nii.gz", "v.nrrd", "v.mha", "v.vti"] {
        let path = directory.path().join(name);
        let writing = held(|| {
            volumes::save_slices(&path, &grid, StoreAs::Float32, |z, out| {
                for (k, value) in out.iter_mut().enumerate() {
                    *value = (k * 7 + z) as f32;
                }
                Ok::<(), FormatError>(())
            })
            .unwrap();
        });
        assert!(writing <= SLICE + WRITER, "{name}: writing held {writing}");
        if name == "v.vti" {
            continue;
        }
        let whole = VolumeOptions::default();
        let part = VolumeOptions {
            region: Some([[10, 110], [20, 100], [5, 85]]),
            stride: [2, 3, 4],
            ..Default::default()
        };
        for options in [whole, part] {
            let preview = volumes::peek(&path, &options).unwrap();
            let limits = ReadLimits {
                max_bytes: preview.read_bytes,
            };
            let reading = held(|| drop(volumes::read(&path, &options, &limits).unwrap()));
            assert!(
                reading <= preview.read_bytes + UNCOUNTED,
                "{name}: reading held {reading}, {} were said",
                preview.read_bytes
            );
            assert!(
                preview.read_bytes <= 4 * preview.header.voxel_count() as u64 + SLICE + UNCOUNTED,
                "{name}"
            );
            let looking = held(|| {
                volumes::range(&path, &options, &limits).unwrap();
            });
            assert!(looking <= 2 * SLICE + 2 * UNCOUNTED, "{name}: {looking}");
        }
    }
}
