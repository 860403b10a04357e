//! What a field was fitted to, and how it is told from other samples.

use bspline::Aabb;
use fitting::volume::VolumeView;
use formats::field::{FieldMeta, SourceKind};
use glam::DVec3;
use serde_json::Value;

/// What may be fitted, as it is read.
#[derive(Clone, Copy, Debug)]
pub enum Samples<'a> {
    /// Points.
    Cloud(&'a [DVec3]),
    /// Vertices, and three of them for each triangle.
    Mesh(&'a [DVec3], &'a [[u32; 3]]),
    /// Voxels.
    Volume(&'a VolumeView<'a>),
}

impl Samples<'_> {
    /// The kind, as provenance has it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cloud(_) => "cloud",
            Self::Mesh(..) => "mesh",
            Self::Volume(_) => "volume",
        }
    }

    /// A number by which other samples are told from these, 16 hexadecimal digits: what provenance has as `input_digest`.
    /// Against mistakes, not against forgers.
    pub fn digest(&self) -> String {
        let mut hash = Hash(0);
        match self {
            // Errors are measured at the positions alone, and other formats round the normals.
            Self::Cloud(positions) => hash.vectors(positions),
            Self::Mesh(vertices, triangles) => {
                hash.vectors(vertices);
                triangles.iter().flatten().for_each(|v| hash.take(u64::from(*v)));
            }
            Self::Volume(v) => {
                v.dims.iter().for_each(|n| hash.take(*n as u64));
                let map = v.world_from_voxel.to_cols_array();
                map.iter().for_each(|x| hash.take(x.to_bits()));
                let [nx, ny, nz] = v.dims;
                for row in 0..ny * nz {
                    for x in 0..nx {
                        let value = v.values.at(v.dims, [x, row % ny, row / ny]);
                        hash.take(u64::from(value.to_bits()));
                    }
                }
            }
        }
        format!("{:016x}", hash.0)
    }

    /// How these samples, by the name `name`, are told from those that a field with such a `meta` and box, by the name `field`,
    /// was fitted to: by the kind, the digest, or, where a field remembers none, the box.
    pub fn differ_from(&self, meta: &FieldMeta, extent: &Aabb, field: &str, name: &str) -> Option<String> {
        let stored: Value = serde_json::from_str(&meta.provenance).unwrap_or_default();
        let was = |key: &str| stored[key].as_str();
        let (fitted_to, given) = (was("input_kind"), self.kind());
        if fitted_to.is_some_and(|k| k != given) {
            Some(format!(
                "{field} was fitted to a {}, and {name} is taken for a {given}",
                fitted_to.unwrap_or_default()
            ))
        } else if (meta.source == SourceKind::Volume) != matches!(self, Self::Volume(_)) {
            Some(format!("{name} is a {given}, which {field} was not fitted to"))
        } else if let Some(digest) = was("input_digest") {
            let file = was("input").unwrap_or("other samples");
            (digest != self.digest()).then(|| {
                format!(
                    "{field} was fitted to other samples than those of {name} (to {file}, as it was read then)"
                )
            })
        } else {
            (!self.overlap(extent)).then(|| format!("{name} lies outside the box of {field}"))
        }
    }

    /// Whether most of them lie where the field does.
    fn overlap(&self, field: &Aabb) -> bool {
        let own = match self {
            Self::Cloud(points) | Self::Mesh(points, _) => Aabb::about(points.iter().copied()),
            Self::Volume(v) => {
                let last = DVec3::from_array(v.dims.map(|n| n as f64 - 1.0));
                Some(Aabb::new(DVec3::ZERO, last).transformed(&v.world_from_voxel))
            }
        };
        own.is_some_and(|own| {
            let common = (own.max.min(field.max) - own.min.max(field.min)).max(DVec3::ZERO);
            let size = own.size();
            (0..3).all(|a| common[a] >= 0.5 * size[a])
        })
    }
}

struct Hash(u64);

impl Hash {
    fn take(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn vectors(&mut self, list: &[DVec3]) {
        self.take(list.len() as u64);
        for v in list {
            v.to_array().iter().for_each(|x| self.take(x.to_bits()));
        }
    }
}
