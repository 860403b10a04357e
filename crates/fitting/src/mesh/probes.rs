//! Where the signed distance is asked for: in each cell at the centres of its eight parts, at the feet of those, and
//! on the creases between them.

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
    /// Whether it lies in a hole, where what is asked for is a guess.
    pub in_hole: bool,
}

impl Probe {
    pub fn new(at: DVec3, found: &Distance, size: f64) -> Self {
        Self {
            at,
            value: found.value,
            normal: found.gradient.map_or([0.0; 3], |g| (-g).as_vec3().to_array()),
            distance: found.distance as f32,
            size: size as f32,
            in_hole: found.in_hole,
        }
    }

    /// A corner of the surface; it stands for no space.
    pub fn corner(at: DVec3) -> Self {
        Self {
            at,
            value: 0.0,
            normal: [0.0; 3],
            distance: 0.0,
            size: 0.0,
            in_hole: false,
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
            in_hole: false,
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
    /// On creases of the distance between two of them, where a smooth field errs most.
    creases: Vec<Probe>,
}

/// A crease over which the gradient changes by `Δ` costs a smooth field about `0.1 Δ h`. It is looked for where
/// `Δ h` is above so many tolerances, `h` the distance of the two places.
const CREASE: f64 = 2.0;

/// Centre of `cell` on the grid with `2^depth` cells.
pub(crate) fn center(cell: [u32; 3], depth: usize) -> DVec3 {
    (DVec3::from_array(cell.map(f64::from)) + 0.5) / (1u64 << depth) as f64
}

/// Part `octant` of a cell, on the next grid.
pub(crate) fn child(cell: [u32; 3], octant: usize) -> [u32; 3] {
    std::array::from_fn(|a| 2 * cell[a] + (octant >> (2 - a) & 1) as u32)
}

impl Cell {
    pub fn ask(&self, mesh: &MeshDistance, depth: usize, tolerance: f64) -> Octants {
        let middle = center(self.at, depth);
        let places: [DVec3; 8] = std::array::from_fn(|o| center(child(self.at, o), depth + 1));
        let found = places.map(|p| mesh.at(p, Some((middle, &self.center))));
        let size = 0.5f64.powi(depth as i32 + 1);
        let mut creases = Vec::new();
        for (o, bit) in (0..8).flat_map(|o| [1, 2, 4].map(|bit| (o, bit))) {
            if o & bit != 0 {
                continue;
            }
            let ends = [o, o | bit].map(|o| (places[o], found[o]));
            if let Some(p) = crease(ends, CREASE * tolerance) {
                let there = mesh.at(p, Some((ends[0].0, &ends[0].1)));
                creases.push(Probe {
                    normal: [0.0; 3],
                    ..Probe::new(p, &there, size)
                });
            }
        }
        Octants { found, creases }
    }
}

/// Where between two places the planes through their feet are equally far, if they differ by more than `least`.
fn crease([(p, a), (q, b)]: [(DVec3, Distance); 2], least: f64) -> Option<DVec3> {
    let (g, k, way) = (a.gradient?, b.gradient?, q - p);
    if (g - k).length_squared() * way.length_squared() < least * least {
        return None;
    }
    let t = (b.value - a.value - k.dot(way)) / (g - k).dot(way);
    (t > 0.0 && t < 1.0).then(|| p + way * t)
}

impl Octants {
    /// Conditions of `cell`: its eight parts, its centre, and the feet of the parts within reach of the surface.
    pub fn probes(&self, cell: &Cell, depth: usize, out: &mut Vec<Probe>) {
        let size = 0.5f64.powi(depth as i32 + 1);
        for (o, found) in self.found.iter().enumerate() {
            out.push(Probe::new(center(child(cell.at, o), depth + 1), found, size));
        }
        out.push(Probe::new(center(cell.at, depth), &cell.center, size));
        out.extend(&self.creases);
        for found in &self.found {
            if found.distance < 2.0 * size {
                out.push(Probe::foot(found, size));
            }
        }
    }
}
