use glam::{DAffine3, DVec3};

use crate::Aabb;

/// The dyadic family of grids that a [`super::HierarchicalSpline`] is built on.
///
/// Lattice coordinates count cells of level 0; a cell of level `ℓ` is `2^-ℓ` wide. The map to the world is
/// any invertible affine map in double precision: oblique, mirrored and anisotropic volumes fit as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Lattice coordinates to world.
    pub world_from_lattice: DAffine3,
    /// Cells of level 0 on each axis.
    pub cells: [u32; 3],
}

impl Lattice {
    /// Corner of the box opposite to the origin, in lattice coordinates.
    pub fn extent(&self) -> DVec3 {
        DVec3::new(self.cells[0] as f64, self.cells[1] as f64, self.cells[2] as f64)
    }

    /// World box round the lattice's own box.
    pub fn world_box(&self) -> Aabb {
        Aabb {
            min: DVec3::ZERO,
            max: self.extent(),
        }
        .transformed(&self.world_from_lattice)
    }

    /// Cells of `level` on each axis.
    pub fn cells_at(&self, level: usize) -> [u32; 3] {
        self.cells.map(|n| n << level)
    }

    /// World lengths of a cell of `level` along the three lattice axes.
    pub fn spacing(&self, level: usize) -> DVec3 {
        let m = self.world_from_lattice.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length()) / (1u64 << level) as f64
    }
}
