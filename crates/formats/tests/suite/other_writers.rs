//! Files of `tests/data`, written by nibabel, trimesh, Open3D and MeshLab (`make_fixtures.py` there).

use std::path::PathBuf;

use formats::points::{self, NormalSource};
use formats::volumes::{self, Orientation, VolumeFormat, VoxelType};
use formats::{Kind, ReadLimits, Unit, detect};
use glam::{DMat3, DVec3};

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// The rotation and spacings that the volumes were given.
fn oblique() -> (DMat3, DVec3) {
    let turn = DMat3::from_cols(DVec3::new(0.8, 0.6, 0.0), DVec3::new(-0.6, 0.8, 0.0), DVec3::Z);
    (
        turn * DMat3::from_diagonal(DVec3::new(1.5, 2.0, -3.0)),
        DVec3::new(-10.25, 20.5, 30.75),
    )
}

#[test]
fn volumes_by_nibabel_have_its_voxels_and_its_affine() {
    for (name, stored, orientation, factor) in [
        ("int16_nibabel.nii", VoxelType::I16, Orientation::Sform, 1.0),
        ("float32_nibabel.nii.gz", VoxelType::F32, Orientation::Sform, 1.0),
        (
            "float64_nibabel_nifti2.nii",
            VoxelType::F64,
            Orientation::Sform,
            1.0,
        ),
        (
            "int32_big_endian_nibabel.nii",
            VoxelType::I32,
            Orientation::Qform,
            1.0,
        ),
        (
            "uint8_rescaled_nibabel.nii",
            VoxelType::U8,
            Orientation::Sform,
            0.5,
        ),
    ] {
        let path = data(name);
        assert_eq!(
            detect(&path).unwrap(),
            Kind::Volume(VolumeFormat::Nifti),
            "{name}"
        );
        let peeked = volumes::peek(&path, &Default::default()).unwrap().header;
        let volume = volumes::read(&path, &Default::default(), &ReadLimits::default()).unwrap();
        let header = &volume.header;
        assert_eq!(&peeked, header, "{name}");
        assert_eq!(
            (header.dims, header.stored, header.orientation),
            ([5, 4, 3], stored, orientation),
            "{name}"
        );
        assert_eq!(header.unit, Unit::Millimetre);
        assert_eq!(header.rescale.is_some(), stored == VoxelType::U8, "{name}");
        for z in 0..3 {
            for y in 0..4 {
                for x in 0..5 {
                    let expected = factor * ((x + 10 * y + 100 * z) as f32 - 50.0);
                    // Eight bits over a range of 117 leave half a step of 0.23.
                    let slack = if stored == VoxelType::U8 { 0.24 } else { 0.0 };
                    let value = volume.values[x + 5 * (y + 4 * z)];
                    assert!(
                        (value - expected).abs() <= slack,
                        "{name}: {value} for {expected}"
                    );
                }
            }
        }
        let (matrix, offset) = oblique();
        let map = header.world_from_voxel;
        assert!(
            (map.translation - offset).length() == 0.0,
            "{name}: a quarter is exact in single precision"
        );
        // Affines of NIfTI-1 are in single precision, a qform also loses digits in its root.
        let slack = if orientation == Orientation::Qform {
            3e-6
        } else {
            3e-7
        };
        for (a, b) in map.matrix3.to_cols_array().iter().zip(matrix.to_cols_array()) {
            assert!((a - b).abs() <= slack, "{name}: {a} for {b}");
        }
        assert!(
            (header.spacing() - DVec3::new(1.5, 2.0, 3.0)).length() < 1e-5,
            "{name}"
        );
    }
}

/// Box of 2 x 3 x 4 about (10, 20, 30).
fn is_the_box(cloud: &points::PointCloud, name: &str) {
    assert_eq!(cloud.positions.len(), 8, "{name}");
    for (p, n) in cloud.positions.iter().zip(cloud.normals.as_ref().unwrap()) {
        let side = *p - DVec3::new(10.0, 20.0, 30.0);
        assert_eq!(side.abs(), DVec3::new(1.0, 1.5, 2.0), "{name}");
        let outward = side.signum().normalize();
        assert!((*n - outward).length() < 1e-5, "{name}: {n} at {p}");
    }
}

#[test]
fn clouds_and_meshes_by_three_programs_are_the_same_box() {
    for (name, source, faces) in [
        ("box_trimesh.ply", NormalSource::Faces, 12),
        ("box_ascii_trimesh.ply", NormalSource::Faces, 12),
        ("box_trimesh.obj", NormalSource::Faces, 12),
        ("box_trimesh.obj.gz", NormalSource::Faces, 12),
        ("box_open3d.obj", NormalSource::Stored, 12),
        ("box_meshlab.ply", NormalSource::Stored, 12),
        ("box_meshlab.obj", NormalSource::Stored, 12),
        ("points_open3d.ply", NormalSource::Stored, 0),
        ("points_ascii_open3d.ply", NormalSource::Stored, 0),
        ("points_open3d.xyzn", NormalSource::Stored, 0),
    ] {
        let path = data(name);
        assert!(matches!(detect(&path).unwrap(), Kind::Cloud(_)), "{name}");
        let cloud = points::read(&path, &ReadLimits::default()).unwrap();
        is_the_box(&cloud, name);
        assert_eq!((cloud.normal_source, cloud.face_count), (source, faces), "{name}");
        assert!(cloud.notes.is_empty(), "{name}: {:?}", cloud.notes);
    }
}
