//! E57 out: one scan in metres, double precision.

use std::io::{self, Cursor, Write};

use e57::{E57Writer, Extension, Record, RecordDataType, RecordName, RecordValue};

use crate::points::cloud::PointCloud;

const NORMALS: &str = "http://www.libe57.org/E57_NOR_surface_normals.txt";

/// Bytes of the file, all of it: its head counts what follows.
pub(in crate::points) fn write(out: &mut dyn Write, cloud: &PointCloud) -> io::Result<()> {
    let metres = cloud.unit.in_mm().map_or(1.0, |mm| mm / 1000.0);
    let mut whole = Cursor::new(Vec::new());
    let mut file = E57Writer::new(&mut whole, &identity(cloud, 1)).map_err(io::Error::other)?;
    let mut prototype = vec![
        Record::CARTESIAN_X_F64,
        Record::CARTESIAN_Y_F64,
        Record::CARTESIAN_Z_F64,
    ];
    if cloud.normals.is_some() {
        file.register_extension(Extension::new("nor", NORMALS))
            .map_err(io::Error::other)?;
        prototype.extend(["normalX", "normalY", "normalZ"].map(|name| Record {
            name: RecordName::Unknown {
                namespace: "nor".into(),
                name: name.into(),
            },
            data_type: RecordDataType::F32,
        }));
    }
    let mut scan = file
        .add_pointcloud(&identity(cloud, 2), prototype)
        .map_err(io::Error::other)?;
    for (i, p) in cloud.positions.iter().enumerate() {
        let mut row: Vec<RecordValue> = (*p * metres).to_array().map(RecordValue::Double).to_vec();
        if let Some(n) = &cloud.normals {
            row.extend(n[i].to_array().map(|x| RecordValue::Single(x as f32)));
        }
        scan.add_point(row).map_err(io::Error::other)?;
    }
    scan.finalize().map_err(io::Error::other)?;
    file.finalize().map_err(io::Error::other)?;
    drop(file);
    out.write_all(whole.get_ref())
}

/// A name that no other content has, and that the same content always has.
fn identity(cloud: &PointCloud, part: u32) -> String {
    let words: [u32; 4] = std::array::from_fn(|word| {
        let mut hash = crc32fast::Hasher::new_with_initial(4 * part + word as u32);
        for x in cloud.positions.iter().flat_map(|p| p.to_array()) {
            hash.update(&x.to_le_bytes());
        }
        hash.finalize()
    });
    let [a, b, c, d] = words;
    let (b, c) = (b & 0xffff_0fff | 0x4000, c & 0x3fff_ffff | 0x8000_0000);
    format!(
        "{{{a:08X}-{:04X}-{:04X}-{:04X}-{:04X}{d:08X}}}",
        b >> 16,
        b & 0xffff,
        c >> 16,
        c & 0xffff
    )
}
