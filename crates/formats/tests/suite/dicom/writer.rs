//! A few elements of a DICOM file, for series whose geometry a test makes up.

use std::path::Path;

/// What a test wants of a picture; the rest is usual.
#[derive(Clone)]
pub struct Picture {
    pub series: u32,
    pub position: [f64; 3],
    pub orientation: [f64; 6],
    pub spacing: [f64; 2],
    pub columns: u16,
    pub rows: u16,
    pub pixels: Vec<i16>,
    /// Elements beside, or instead of, the usual ones: tag, representation, value.
    pub more: Vec<(u32, [u8; 2], Vec<u8>)>,
}

impl Picture {
    /// 4 x 3 pixels in an axial plane.
    pub fn axial(z: f64) -> Self {
        Self {
            series: 1,
            position: [0.0, 0.0, z],
            orientation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            spacing: [1.0, 1.0],
            columns: 4,
            rows: 3,
            pixels: (0..12).map(|i| i + 10 * z as i16).collect(),
            more: Vec::new(),
        }
    }

    pub fn with(mut self, tag: u32, vr: &[u8; 2], value: impl AsRef<[u8]>) -> Self {
        self.more.push((tag, *vr, value.as_ref().to_vec()));
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        let text = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join("\\");
        let short = |v: u16| v.to_le_bytes().to_vec();
        let mut elements = vec![
            (0x0008_0060, *b"CS", b"CT".to_vec()),
            (0x0020_000E, *b"UI", format!("1.2.3.{}", self.series).into_bytes()),
            (0x0020_0011, *b"IS", self.series.to_string().into_bytes()),
            (0x0020_0032, *b"DS", text(&self.position).into_bytes()),
            (0x0020_0037, *b"DS", text(&self.orientation).into_bytes()),
            (0x0028_0002, *b"US", short(1)),
            (0x0028_0004, *b"CS", b"MONOCHROME2".to_vec()),
            (0x0028_0010, *b"US", short(self.rows)),
            (0x0028_0011, *b"US", short(self.columns)),
            (0x0028_0030, *b"DS", text(&self.spacing).into_bytes()),
            (0x0028_0100, *b"US", short(16)),
            (0x0028_0101, *b"US", short(16)),
            (0x0028_0102, *b"US", short(15)),
            (0x0028_0103, *b"US", short(1)),
            (
                0x7FE0_0010,
                *b"OW",
                self.pixels.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ),
        ];
        for (tag, vr, value) in &self.more {
            elements.retain(|e| e.0 != *tag);
            elements.push((*tag, *vr, value.clone()));
        }
        elements.sort();
        let mut out = vec![0; 128];
        out.extend(b"DICM");
        push(&mut out, 0x0002_0010, *b"UI", b"1.2.840.10008.1.2.1");
        for (tag, vr, value) in elements {
            push(&mut out, tag, vr, &value);
        }
        out
    }

    pub fn save(&self, path: &Path) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, self.bytes()).unwrap();
    }
}

fn push(out: &mut Vec<u8>, tag: u32, vr: [u8; 2], value: &[u8]) {
    out.extend(((tag >> 16) as u16).to_le_bytes());
    out.extend((tag as u16).to_le_bytes());
    out.extend(vr);
    let length = value.len().next_multiple_of(2);
    if matches!(&vr, b"OW" | b"OB" | b"OD" | b"SQ" | b"UN") {
        out.extend([0, 0]);
        out.extend((length as u32).to_le_bytes());
    } else {
        out.extend((length as u16).to_le_bytes());
    }
    out.extend(value);
    out.resize(out.len() + length - value.len(), b' ');
}
