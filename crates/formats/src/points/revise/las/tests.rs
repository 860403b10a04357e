use std::fs;

use glam::DVec3;

use crate::points;
use crate::points::revise::tests::{changes, revised};
use crate::points::revise::{CloudChanges, Placed};

/// Two points of LAS 1.2 and one that is withheld, at steps of a hundredth; the second is a second return.
#[test]
fn las_keeps_records_attributes_and_what_is_withheld() {
    let cloud = points::PointCloud {
        positions: vec![
            DVec3::new(1.5, 2.0, 3.0),
            DVec3::new(4.0, 5.0, 6.0),
            DVec3::new(7.0, 8.0, 9.5),
            DVec3::ONE,
        ],
        ..Default::default()
    };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.las");
    points::save(&path, &cloud).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let at = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    for (n, point) in bytes[at..].chunks_exact_mut(20).enumerate() {
        point[12] = 50 + n as u8;
        point[14] = if n == 2 { 0b010_010 } else { 0b001_001 };
        point[15] = if n == 3 { 0x80 } else { 0 };
    }
    bytes.extend(b"what follows the points");
    fs::write(&path, &bytes).unwrap();
    assert_eq!(revised("a.las", &bytes, &CloudChanges::default()).0, bytes);
    let (new, cloud) = revised("a.las", &bytes, &changes());
    for (found, expected) in
        cloud
            .positions
            .iter()
            .zip([[7.0, 0.25, -1.5], [7.0, 8.0, 9.5], [9.0, 0.25, -1.5]])
    {
        assert!(found.distance(expected.into()) < 1e-6, "{found}");
    }
    let points: Vec<&[u8]> = new[at..].chunks_exact(20).take(4).collect();
    assert_eq!(
        points[1],
        &bytes[at + 40..at + 60],
        "what was not edited stays to the bit"
    );
    assert_eq!(points[2], &bytes[at + 60..at + 80], "what is withheld stays");
    let told: Vec<u8> = points.iter().map(|p| p[12]).collect();
    assert_eq!(told, [51, 52, 53, 52]);
    let count = |at: usize| u32::from_le_bytes(new[at..at + 4].try_into().unwrap());
    assert_eq!([count(107), count(111), count(115)], [4, 2, 2]);
    let high = f64::from_le_bytes(new[179..187].try_into().unwrap());
    assert!((high - 9.0).abs() < 1e-6 && new.ends_with(b"what follows the points"));
}

/// A file of format 6, version 1.4, with layered chunks, extra bytes and a record behind the points; and one as old programs write them.
#[test]
fn laz_is_packed_again_and_keeps_what_stands_behind_its_points() {
    for (format, extra) in [(0, 0), (1, 0), (3, 5), (6, 0), (7, 3)] {
        let bytes = packed_cloud(format, extra, 1000);
        assert_eq!(revised("a.laz", &bytes, &CloudChanges::default()).0, bytes);
        let changes = CloudChanges {
            moved: vec![at(7, 1.25)],
            removed: vec![0, 500],
            added: vec![at(3, -2.5), at(4, 0.5), at(4, 0.75)],
        };
        let (new, cloud) = revised("a.laz", &bytes, &changes);
        assert_eq!(cloud.positions.len(), 1001);
        assert_eq!(cloud.positions[6], DVec3::splat(1.25));
        assert_eq!(cloud.positions[998], DVec3::splat(-2.5));
        // The same changes made to the file without compression.
        let (was, is) = (rows_of(&bytes), rows_of(&new));
        assert_eq!(is[..6], was[1..7]);
        assert_eq!(is[7..499], was[8..500]);
        assert_eq!(is[499..998], was[501..]);
        assert_eq!(is[999][12..], was[4][12..], "attributes of the row that is named");
        assert!(new.len() < bytes.len() + 200 && new[104] & 0x80 != 0);
        if format >= 6 {
            let behind = u64::from_le_bytes(new[235..243].try_into().unwrap()) as usize;
            assert_eq!(&new[behind..], RECORD_BEHIND);
            assert_eq!(u64::from_le_bytes(new[247..255].try_into().unwrap()), 1001);
        }
    }
}

/// One extended record with five bytes.
const RECORD_BEHIND: &[u8] = &{
    let mut record = [0; 65];
    (record[20], record[60]) = (5, 42);
    record
};

fn at(row: usize, x: f64) -> Placed {
    Placed {
        row,
        position: DVec3::splat(x),
        normal: DVec3::X,
    }
}

/// `count` points of a LAZ file at steps of a hundredth, with bytes of all kinds.
fn packed_cloud(format: u8, extra: u16, count: usize) -> Vec<u8> {
    use laz::laszip::{LasZipCompressor, LazItemRecordBuilder, LazVlrBuilder};
    let items = LazItemRecordBuilder::default_for_point_format_id(format, extra).unwrap();
    let vlr = LazVlrBuilder::default().with_laz_items(items).build();
    let mut data = Vec::new();
    vlr.write_to(&mut data).unwrap();
    let size = vlr.items_size() as usize;
    let is_1_4 = format >= 6;
    let head = if is_1_4 { 375 } else { 227 };
    let points_at = head + 54 + data.len();
    let mut bytes = vec![0; points_at];
    let mut put = |at: usize, b: &[u8]| bytes[at..at + b.len()].copy_from_slice(b);
    put(0, b"LASF");
    put(24, &[1, if is_1_4 { 4 } else { 2 }]);
    put(94, &(head as u16).to_le_bytes());
    put(96, &(points_at as u32).to_le_bytes());
    put(100, &1u32.to_le_bytes());
    put(104, &[format | 0x80]);
    put(105, &(size as u16).to_le_bytes());
    put(if is_1_4 { 247 } else { 107 }, &(count as u32).to_le_bytes());
    for axis in 0..3 {
        put(131 + 8 * axis, &0.01f64.to_le_bytes());
    }
    put(head + 2, b"laszip encoded");
    put(head + 18, &22204u16.to_le_bytes());
    put(head + 20, &(data.len() as u16).to_le_bytes());
    put(head + 54, &data);
    let mut out = std::io::Cursor::new(bytes);
    out.set_position(points_at as u64);
    let mut packer = LasZipCompressor::new(&mut out, vlr).unwrap();
    for n in 0..count {
        let mut point: Vec<u8> = (0..size).map(|k| (n * (k + 3) % 251) as u8).collect();
        for axis in 0..3 {
            point[4 * axis..][..4].copy_from_slice(&((n * (axis + 1)) as i32).to_le_bytes());
        }
        // One of one return, not withheld.
        (point[14], point[15]) = (if is_1_4 { 0x11 } else { 9 }, 0);
        packer.compress_one(&point).unwrap();
    }
    packer.done().unwrap();
    drop(packer);
    let mut bytes = out.into_inner();
    if is_1_4 {
        let behind = bytes.len() as u64;
        bytes[235..243].copy_from_slice(&behind.to_le_bytes());
        bytes[243..247].copy_from_slice(&1u32.to_le_bytes());
        bytes.extend(RECORD_BEHIND);
    }
    bytes
}

/// The points of a LAZ file, unpacked by the crate alone.
fn rows_of(bytes: &[u8]) -> Vec<Vec<u8>> {
    use laz::laszip::{LasZipDecompressor, LazVlr};
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let head = usize::from(u16::from_le_bytes(bytes[94..96].try_into().unwrap()));
    let vlr = LazVlr::from_buffer(&bytes[head + 54..number(96)]).unwrap();
    let (size, count) = (
        vlr.items_size() as usize,
        number(if bytes[25] == 4 { 247 } else { 107 }),
    );
    let mut source = std::io::Cursor::new(bytes);
    source.set_position(number(96) as u64);
    let mut unpacker = LasZipDecompressor::new(source, vlr).unwrap();
    let mut points = vec![0; size * count];
    unpacker.decompress_many(&mut points).unwrap();
    points.chunks_exact(size).map(<[u8]>::to_vec).collect()
}
