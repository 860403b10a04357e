#![no_main]
//! Any layout over any bytes: an error or a result, within the ceiling. The first 40 bytes are the layout.

use formats::volumes::{RawLayout, VoxelType, parse_raw};
use formats::{ReadLimits, Unit};
use libfuzzer_sys::fuzz_target;

const TYPES: [VoxelType; 10] = [
    VoxelType::U8,
    VoxelType::I8,
    VoxelType::U16,
    VoxelType::I16,
    VoxelType::U32,
    VoxelType::I32,
    VoxelType::U64,
    VoxelType::I64,
    VoxelType::F32,
    VoxelType::F64,
];

fuzz_target!(|bytes: &[u8]| {
    let Some((head, voxels)) = bytes.split_at_checked(40) else {
        return;
    };
    let f64_at = |at: usize| f64::from_le_bytes(head[at..at + 8].try_into().unwrap());
    let u16_at = |at: usize| u16::from_le_bytes(head[at..at + 2].try_into().unwrap());
    // A shift reaches from one voxel to counts whose product overflows.
    let shift = u32::from(head[7] % 48);
    let layout = RawLayout {
        dims: [0, 2, 4].map(|at| usize::from(u16_at(at)) << (shift * (at as u32 / 2) / 2)),
        voxel: TYPES[usize::from(head[6]) % TYPES.len()],
        big_endian: head[8] & 1 == 1,
        offset: u64::from(u16_at(9)) << shift,
        spacing: [f64_at(11), f64_at(19), 1.0],
        origin: [f64_at(27), 0.0, 0.0],
        unit: Unit::from_code(head[35] % 5).unwrap(),
        rescale: (head[36] & 1 == 1).then(|| [f64_at(11), f64_at(27)]),
    };
    let _ = parse_raw(voxels, &layout, &ReadLimits { max_bytes: 1 << 24 });
});
