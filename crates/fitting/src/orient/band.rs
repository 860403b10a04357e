//! Unsigned distance on an octree that is fine in a narrow band round the points.

use glam::DVec3;
use rustc_hash::{FxHashMap, FxHashSet};

/// Points and margin fit in the unit box of the octree like this.
const MARGIN: f64 = 0.15;
/// Rounds of eight sweeps; two suffice on a uniform grid \[Zhao05\], jumps of the cell size ask for more.
const ROUNDS: usize = 4;
/// Nothing was found yet.
const NONE: u32 = u32::MAX;

/// Leaf of the octree: a cell of `2^level` along the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Cell {
    pub level: u8,
    pub at: [u32; 3],
}

/// Leaves, who touches whom, and the distance of each centre from the nearest point.
#[derive(Debug)]
pub(crate) struct Band {
    pub cells: Vec<Cell>,
    pub distance: Vec<f64>,
    index: FxHashMap<Cell, u32>,
    /// `neighbours[first[i]..first[i + 1]]` share a face with leaf `i`.
    first: Vec<u32>,
    neighbours: Vec<u32>,
    depth: u8,
}

impl Band {
    /// Over positions in the unit box; the smallest cells are `spacing` wide or up to twice that.
    pub fn new(positions: &[DVec3], spacing: f64) -> Self {
        let depth = (1.0 / (spacing * (1.0 + 2.0 * MARGIN)))
            .log2()
            .floor()
            .clamp(3.0, 12.0) as u8;
        let placed: Vec<DVec3> = positions.iter().map(|&p| place(p)).collect();
        let mut band = Self {
            cells: leaves(&placed, depth),
            distance: Vec::new(),
            index: FxHashMap::default(),
            first: Vec::new(),
            neighbours: Vec::new(),
            depth,
        };
        band.index = band.cells.iter().copied().zip(0..).collect();
        band.connect();
        band.sweep(&placed);
        band
    }

    /// Leaves that share a face with leaf `i`.
    pub fn neighbours(&self, i: usize) -> &[u32] {
        &self.neighbours[self.first[i] as usize..self.first[i + 1] as usize]
    }

    /// Whether the leaf touches the outside of the box.
    pub fn is_rim(&self, i: usize) -> bool {
        let c = self.cells[i];
        c.at.iter().any(|&x| x == 0 || x + 1 == 1 << c.level)
    }

    /// The smallest leaves within `reach` cells of a point of the unit box along each axis, with the vectors from
    /// the point to their centres in cells.
    pub fn around(&self, p: DVec3, reach: i32) -> impl Iterator<Item = (usize, DVec3)> {
        let scaled = place(p) * f64::from(1u32 << self.depth);
        let base = scaled.floor();
        let range = move || -reach..=reach;
        range()
            .flat_map(move |x| {
                range().flat_map(move |y| range().map(move |z| DVec3::new(x as f64, y as f64, z as f64)))
            })
            .filter_map(move |step| {
                let at = base + step;
                let cell = Cell {
                    level: self.depth,
                    at: at.max(DVec3::ZERO).to_array().map(|x| x as u32),
                };
                let i = *self.index.get(&cell)?;
                Some((i as usize, at + 0.5 - scaled))
            })
    }

    fn connect(&mut self) {
        let mut pairs = Vec::new();
        for (i, c) in self.cells.iter().enumerate() {
            for axis in 0..3 {
                for step in [-1i64, 1] {
                    let moved = i64::from(c.at[axis]) + step;
                    if moved < 0 || moved >= 1 << c.level {
                        continue;
                    }
                    let mut same = *c;
                    same.at[axis] = moved as u32;
                    let parent = Cell {
                        level: c.level.saturating_sub(1),
                        at: same.at.map(|x| x / 2),
                    };
                    // A neighbour of finer cells is met from their side.
                    if let Some(&j) = self.index.get(&same) {
                        pairs.push((i as u32, j));
                    } else if let Some(&j) = self.index.get(&parent) {
                        pairs.extend([(i as u32, j), (j, i as u32)]);
                    }
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        self.first = vec![0; self.cells.len() + 1];
        for &(i, _) in &pairs {
            self.first[i as usize + 1] += 1;
        }
        for i in 0..self.cells.len() {
            self.first[i + 1] += self.first[i];
        }
        self.neighbours = pairs.into_iter().map(|p| p.1).collect();
    }

    /// Gauss–Seidel in alternating orders \[Zhao05\], each leaf taking over the nearest point that a neighbour knows.
    fn sweep(&mut self, placed: &[DVec3]) {
        let centres: Vec<DVec3> = self.cells.iter().map(centre).collect();
        let mut nearest = vec![NONE; self.cells.len()];
        let mut square = vec![f64::INFINITY; self.cells.len()];
        for (k, &p) in placed.iter().enumerate() {
            let i = self.index[&cell_of(p, self.depth)] as usize;
            let d2 = centres[i].distance_squared(p);
            if d2 < square[i] {
                (nearest[i], square[i]) = (k as u32, d2);
            }
        }
        let directions = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        let orders = directions.map(|(y, z)| {
            let along = DVec3::new(1.0, y, z);
            let mut order: Vec<(i64, u32)> = centres
                .iter()
                .zip(0..)
                .map(|(c, i)| ((c.dot(along) * f64::from(1u32 << (self.depth + 2))) as i64, i))
                .collect();
            order.sort_unstable();
            order
        });
        for _ in 0..ROUNDS {
            let mut has_changed = false;
            for order in &orders {
                for backward in [false, true] {
                    for at in 0..order.len() {
                        let i = order[if backward { order.len() - 1 - at } else { at }].1 as usize;
                        for &j in &self.neighbours[self.first[i] as usize..self.first[i + 1] as usize] {
                            let k = nearest[j as usize];
                            if k == NONE || k == nearest[i] {
                                continue;
                            }
                            let d2 = centres[i].distance_squared(placed[k as usize]);
                            if d2 < square[i] {
                                (nearest[i], square[i]) = (k, d2);
                                has_changed = true;
                            }
                        }
                    }
                }
            }
            if !has_changed {
                break;
            }
        }
        self.distance = square.into_iter().map(f64::sqrt).collect();
    }
}

fn place(p: DVec3) -> DVec3 {
    (p + MARGIN) / (1.0 + 2.0 * MARGIN)
}

fn cell_of(placed: DVec3, level: u8) -> Cell {
    let n = f64::from(1u32 << level);
    Cell {
        level,
        at: (placed * n).to_array().map(|x| (x as u32).min((1 << level) - 1)),
    }
}

fn centre(c: &Cell) -> DVec3 {
    let n = f64::from(1u32 << c.level);
    (DVec3::from_array(c.at.map(f64::from)) + 0.5) / n
}

/// Leaves in a fixed order: a cell is split down to `depth` where it or a cell beside it holds a point, which
/// keeps the sizes of neighbours within a factor of two.
fn leaves(placed: &[DVec3], depth: u8) -> Vec<Cell> {
    let mut out = Vec::new();
    let mut open = vec![Cell { level: 0, at: [0; 3] }];
    for level in 0..=depth {
        let occupied: FxHashSet<[u32; 3]> = placed.iter().map(|&p| cell_of(p, level).at).collect();
        let mut split = Vec::new();
        for c in open {
            if level < depth && near_occupied(&c, &occupied) {
                split.push(c);
            } else {
                out.push(c);
            }
        }
        open = split
            .iter()
            .flat_map(|c| {
                (0..8u32).map(|o| Cell {
                    level: level + 1,
                    at: [0, 1, 2].map(|a| 2 * c.at[a] + ((o >> (2 - a)) & 1)),
                })
            })
            .collect();
    }
    out
}

fn near_occupied(c: &Cell, occupied: &FxHashSet<[u32; 3]>) -> bool {
    let last = (1u32 << c.level) - 1;
    let range = |a: usize| c.at[a].saturating_sub(1)..=(c.at[a] + 1).min(last);
    range(0).any(|x| range(1).any(|y| range(2).any(|z| occupied.contains(&[x, y, z]))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::SplitMix64;

    #[test]
    fn swept_distances_are_those_to_the_nearest_point() {
        let mut random = SplitMix64::new(1);
        let points: Vec<DVec3> = (0..2000)
            .map(|_| random.normal3().normalize() * 0.5 + 0.5)
            .collect();
        let band = Band::new(&points, 0.03);
        for (i, c) in band.cells.iter().enumerate() {
            let at = centre(c);
            let exact = points
                .iter()
                .map(|&p| place(p).distance(at))
                .fold(f64::INFINITY, f64::min);
            // A leaf learns from its neighbours only, so the nearest point may be missed, but for one no farther away than
            // the leaf is wide.
            let width = 0.5f64.powi(i32::from(c.level));
            assert!(
                band.distance[i] >= exact - 1e-12 && band.distance[i] < exact + width,
                "leaf {i}, {width} wide: {} for {exact}",
                band.distance[i]
            );
        }
    }

    #[test]
    fn leaves_fill_the_box_and_neighbours_differ_by_one_level() {
        let points = [DVec3::ZERO, DVec3::ONE, DVec3::new(0.3, 0.9, 0.2)];
        let band = Band::new(&points, 0.02);
        let volume: f64 = band.cells.iter().map(|c| 0.125f64.powi(i32::from(c.level))).sum();
        assert_eq!(volume, 1.0);
        for i in 0..band.cells.len() {
            assert!(!band.neighbours(i).is_empty());
            for &j in band.neighbours(i) {
                assert!(band.cells[i].level.abs_diff(band.cells[j as usize].level) <= 1);
                assert!(band.neighbours(j as usize).contains(&(i as u32)));
            }
        }
    }
}
