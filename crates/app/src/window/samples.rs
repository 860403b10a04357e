//! Scans that come with the program, for whoever has none at hand.

use std::path::{Path, PathBuf};

/// A scan inside the program.
pub struct Sample {
    /// What it is.
    pub name: &'static str,
    file: &'static str,
    bytes: &'static [u8],
}

/// All of them.
pub const SAMPLES: [Sample; 2] = [
    Sample {
        name: "Bunny, a laser scan",
        file: "bunny.obj.gz",
        bytes: include_bytes!("../../../../data/bunny.obj.gz"),
    },
    Sample {
        name: "Head, an MR volume",
        file: "head.nii.gz",
        bytes: include_bytes!("../../../../data/head.nii.gz"),
    },
];

impl Sample {
    /// Its file, written into a directory.
    ///
    /// # Errors
    /// That it cannot be written.
    pub fn file(&self, directory: &Path) -> Result<PathBuf, String> {
        let path = directory.join(self.file);
        std::fs::write(&path, self.bytes)
            .map_err(|e| format!("{}: cannot be written ({e}); free some space", path.display()))?;
        Ok(path)
    }
}
