//! Writes one volume in every format and type that is written, for `tests/interop/volumes.py` to read:
//! `cargo run --release -p formats --example write_volumes -- DIRECTORY`.

use std::fs;
use std::path::PathBuf;

use formats::FormatError;
use formats::Unit;
use formats::volumes::{Grid, StoreAs, VoxelType, save_slices};
use glam::{DAffine3, DMat3, DVec3};

/// More than one block of compressed bytes, and no multiple of one.
const DIMS: [usize; 3] = [71, 53, 37];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let directory = PathBuf::from(std::env::args().nth(1).ok_or("usage: write_volumes DIRECTORY")?);
    fs::create_dir_all(&directory)?;
    let maps = [
        ("plain", DMat3::IDENTITY, DVec3::new(1.0, 2.0, 3.0)),
        ("oblique", oblique(), DVec3::new(-90.5, 1e4 / 3.0, 1e-3)),
    ];
    for (name, matrix3, translation) in maps {
        for extension in ["nii", "nii.gz", "nrrd", "mha", "vti"] {
            for (kind, store) in stores() {
                let grid = Grid {
                    dims: DIMS,
                    world_from_voxel: DAffine3 { matrix3, translation },
                    unit: Unit::Millimetre,
                };
                let path = directory.join(format!("{name}_{kind}.{extension}"));
                save_slices(&path, &grid, store, |z, out| {
                    for (k, value) in out.iter_mut().enumerate() {
                        *value = density(k % DIMS[0], k / DIMS[0], z, store);
                    }
                    Ok::<(), FormatError>(())
                })?;
            }
        }
        let rows: Vec<String> = (0..3)
            .map(|r| {
                let m = matrix3;
                format!(
                    "[{:?}, {:?}, {:?}, {:?}]",
                    m.x_axis[r], m.y_axis[r], m.z_axis[r], translation[r]
                )
            })
            .collect();
        fs::write(
            directory.join(format!("{name}.json")),
            format!("[{}]\n", rows.join(", ")),
        )?;
    }
    Ok(())
}

/// Turned about a general axis, three spacings, one axis mirrored.
fn oblique() -> DMat3 {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    turn * DMat3::from_diagonal(DVec3::new(0.3, -1.1, 2.7))
}

fn stores() -> Vec<(&'static str, StoreAs)> {
    let whole = |voxel| StoreAs::Integer {
        voxel,
        slope: 1.0,
        intercept: 0.0,
    };
    vec![
        ("float32", StoreAs::Float32),
        ("uint8", whole(VoxelType::U8)),
        ("int16", whole(VoxelType::I16)),
        ("uint16", whole(VoxelType::U16)),
        ("int32", whole(VoxelType::I32)),
    ]
}

/// The same formula stands in `tests/interop/volumes.py`.
fn density(x: usize, y: usize, z: usize, store: StoreAs) -> f32 {
    match store {
        StoreAs::Float32 => x as f32 + 0.25 * y as f32 - 3.5 * z as f32,
        StoreAs::Integer { .. } => ((x + 2 * y + 3 * z) % 251) as f32,
    }
}
