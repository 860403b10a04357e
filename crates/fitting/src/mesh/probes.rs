//! Where the signed distance is asked for: in each cell at the centres of its eight parts, and at the feet of those on
//! the surface.

use glam::DVec3;

use super::distance::{Distance, MeshDistance};

/// A condition on the field, and how well it has to be met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probe {
    /// Unit box.
    pub at: DVec3,
    pub value: f32,
    /// Outward unit normal of the level set; zero where the gradient is unknown or not asked for.
    pub normal: [f32; 3],
    /// Edge of the part of space it stands for, unit box.
    pub size: f32,
}

impl Probe {
    pub fn new(at: DVec3, found: &Distance, size: f64) -> Self {
        Self {
            at,
            value: found.value() as f32,
            normal: found.gradient(at).map_or([0.0; 3], |g| (-g).as_vec3().to_array()),
            size: size as f32,
        }
    }

    /// A corner of the surface; it stands for no space.
    pub fn corner(at: DVec3) -> Self {
        Self {
            at,
            value: 0.0,
            normal: [0.0; 3],
            size: 0.0,
        }
    }
}

/// A cell that is refined, with the distance at its centre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub at: [u32; 3],
    pub center: Distance,
    /// Root mean square error on the surface in the cell above, unit box; infinite where nothing is known.
    pub error_above: f32,
}

/// At the centre of part `4x + 2y + z` of a cell.
pub(crate) type Octants = [Distance; 8];

/// Centre of `cell` on the grid with `2^depth` cells.
pub(crate) fn center(cell: [u32; 3], depth: usize) -> DVec3 {
    (DVec3::from_array(cell.map(f64::from)) + 0.5) / (1u64 << depth) as f64
}

/// Part `octant` of a cell, on the next grid.
pub(crate) fn child(cell: [u32; 3], octant: usize) -> [u32; 3] {
    std::array::from_fn(|a| 2 * cell[a] + (octant >> (2 - a) & 1) as u32)
}

/// A cell and those beside it; beyond the borders of the grid they are none.
pub(crate) fn around(cell: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..27u32).map(move |i| {
        let d = [i / 9, i / 3 % 3, i % 3];
        std::array::from_fn(|a| (cell[a] + d[a]).wrapping_sub(1))
    })
}

/// The cell of the grid with `2^depth` cells that holds `at`.
pub(crate) fn cell_of(at: DVec3, depth: usize) -> [u32; 3] {
    let last = (1u32 << depth) - 1;
    (at * (1u64 << depth) as f64)
        .to_array()
        .map(|x| (x as u32).min(last))
}

impl Cell {
    /// Centres of its eight parts.
    pub fn places(&self, depth: usize) -> impl Iterator<Item = DVec3> {
        (0..8).map(move |o| self.part(o, depth))
    }

    /// Centre of part `o`, where the distance is asked for.
    pub fn part(&self, o: usize, depth: usize) -> DVec3 {
        center(child(self.at, o), depth + 1)
    }

    pub fn ask(&self, mesh: &MeshDistance, depth: usize) -> Octants {
        let middle = center(self.at, depth);
        let places = std::array::from_fn(|o| self.part(o, depth));
        mesh.at_eight(&places, Some((middle, &self.center)))
    }

    /// Feet of the parts that lie in the cell.
    pub fn feet(&self, octants: &Octants, depth: usize) -> impl Iterator<Item = DVec3> {
        let feet = octants.iter().map(|found| found.foot);
        feet.filter(move |foot| cell_of(*foot, depth) == self.at)
    }

    /// Appends what is asked of the field in the cell: the distance and its gradient in every second of its parts,
    /// other ones in the cells beside it. All eight cost twice the time and gain nothing.
    pub fn conditions(&self, octants: &Octants, depth: usize, out: &mut Vec<Probe>) {
        let size = 0.63 * 0.5f64.powi(depth as i32);
        let parity = self.at.iter().sum::<u32>() % 2;
        let parts = (0..8).filter(|o: &usize| o.count_ones() % 2 == parity);
        out.extend(parts.map(|o| Probe::new(center(child(self.at, o), depth + 1), &octants[o], size)));
    }
}
