//! Points as lines of text.

use std::io::{self, Write};

use crate::points::cloud::PointCloud;

/// A line a point, with the fewest digits that give every number back.
pub(in crate::points) fn write(out: &mut dyn Write, cloud: &PointCloud) -> io::Result<()> {
    let mut digits = zmij::Buffer::new();
    for (i, p) in cloud.positions.iter().enumerate() {
        let normal = cloud.normals.as_ref().map(|n| n[i].to_array());
        for (k, x) in p
            .to_array()
            .into_iter()
            .chain(normal.into_iter().flatten())
            .enumerate()
        {
            if k > 0 {
                out.write_all(b" ")?;
            }
            out.write_all(digits.format(x).as_bytes())?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}
