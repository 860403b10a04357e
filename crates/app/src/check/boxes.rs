use std::path::Path;

use formats::FormatError;
use glam::DVec3;

/// Edges of a box between corners numbered `4x + 2y + z`.
pub const EDGES: [[usize; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

/// Writes boxes as coloured wire frames: binary PLY with vertices and edges.
///
/// # Errors
/// I/O.
pub fn write_boxes(
    path: &Path,
    boxes: impl Iterator<Item = ([DVec3; 8], [u8; 3])>,
) -> Result<(), FormatError> {
    let boxes: Vec<_> = boxes.collect();
    formats::atomic::replace(path, |out| {
        write!(
            out,
            "ply\nformat binary_little_endian 1.0\ncomment isoclay\nelement vertex {}\nproperty float x\n\
             property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
             element edge {}\nproperty int vertex1\nproperty int vertex2\nproperty uchar red\n\
             property uchar green\nproperty uchar blue\nend_header\n",
            8 * boxes.len(),
            12 * boxes.len()
        )?;
        for (corners, color) in &boxes {
            for p in corners {
                for x in p.to_array() {
                    out.write_all(&(x as f32).to_le_bytes())?;
                }
                out.write_all(color)?;
            }
        }
        for (i, (_, color)) in boxes.iter().enumerate() {
            for edge in EDGES {
                for v in edge {
                    out.write_all(&((8 * i + v) as u32).to_le_bytes())?;
                }
                out.write_all(color)?;
            }
        }
        Ok(())
    })
}
