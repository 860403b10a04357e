//! Where the signed distance is asked for: in each cell at the centres of its eight parts, and at the feet of those.

use glam::DVec3;

use super::distance::{Distance, MeshDistance};

/// A condition on the field, and how well it has to be met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probe {
    /// Unit box.
    pub at: DVec3,
    pub value: f64,
    /// Outward unit normal of the level set; zero where the gradient is unknown or not asked for.
    pub normal: [f32; 3],
    /// Distance to the surface.
    pub distance: f32,
    /// Edge of the part of space it stands for, unit box.
    pub size: f32,
}

impl Probe {
    pub fn new(at: DVec3, found: &Distance, size: f64) -> Self {
        Self {
            at,
            value: found.value,
            normal: found.gradient.map_or([0.0; 3], |g| (-g).as_vec3().to_array()),
            distance: found.distance as f32,
            size: size as f32,
        }
    }

    /// The foot: a point of the surface.
    fn foot(found: &Distance, size: f64) -> Self {
        Self {
            at: found.foot,
            value: 0.0,
            normal: [0.0; 3],
            distance: 0.0,
            size: size as f32,
        }
    }
}

/// A cell that is refined, with the distance at its centre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub at: [u32; 3],
    pub center: Distance,
}

/// What the eight parts of a cell hold.
pub(crate) struct Octants {
    /// At the centre of part `4x + 2y + z`.
    pub found: [Distance; 8],
}

/// Centre of `cell` on the grid with `2^depth` cells.
pub(crate) fn center(cell: [u32; 3], depth: usize) -> DVec3 {
    (DVec3::from_array(cell.map(f64::from)) + 0.5) / (1u64 << depth) as f64
}

/// Part `octant` of a cell, on the next grid.
pub(crate) fn child(cell: [u32; 3], octant: usize) -> [u32; 3] {
    std::array::from_fn(|a| 2 * cell[a] + (octant >> (2 - a) & 1) as u32)
}

impl Cell {
    pub fn ask(&self, mesh: &MeshDistance, depth: usize) -> Octants {
        let middle = center(self.at, depth);
        let found = std::array::from_fn(|o| {
            let p = center(child(self.at, o), depth + 1);
            mesh.at(p, Some((middle, &self.center)))
        });
        Octants { found }
    }
}

impl Octants {
    /// Conditions of the cell `at`: its eight parts, and the feet of those within reach of the surface.
    pub fn probes(&self, at: [u32; 3], depth: usize, out: &mut Vec<Probe>) {
        let size = 0.5f64.powi(depth as i32 + 1);
        for (o, found) in self.found.iter().enumerate() {
            out.push(Probe::new(center(child(at, o), depth + 1), found, size));
        }
        for found in &self.found {
            if found.distance < 2.0 * size {
                out.push(Probe::foot(found, size));
            }
        }
    }
}
