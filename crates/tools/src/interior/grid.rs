//! Which cells of a box air can reach, and how far nodes are from them.

use bspline::Aabb;
use glam::DVec3;

/// Cells over a box.
pub struct Grid {
    pub corner: DVec3,
    pub cell: DVec3,
    pub cells: [usize; 3],
}

impl Grid {
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.cells[1] + y) * self.cells[2] + z
    }

    fn world(&self, low: [usize; 3], high: [usize; 3]) -> Aabb {
        let place = |at: [usize; 3]| self.corner + self.cell * DVec3::from_array(at.map(|n| n as f64));
        Aabb::new(place(low), place(high))
    }

    /// Marks the cells from `low` to before `high` that are all solid, halves after halves.
    pub fn fill(
        &self,
        low: [usize; 3],
        high: [usize; 3],
        is_solid: &impl Fn(&Aabb) -> Option<bool>,
        is_within: &impl Fn(&Aabb) -> bool,
        solid: &mut [bool],
    ) {
        let b = self.world(low, high);
        let size: [usize; 3] = std::array::from_fn(|a| high[a] - low[a]);
        let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
        match is_solid(&b) {
            Some(false) => return,
            Some(true) if is_within(&b) => {
                for x in low[0]..high[0] {
                    for y in low[1]..high[1] {
                        let from = self.index([x, y, low[2]]);
                        solid[from..from + size[2]].fill(true);
                    }
                }
                return;
            }
            _ if size[axis] == 1 => return,
            _ => {}
        }
        let middle = low[axis] + size[axis] / 2;
        let (mut end, mut begin) = (high, low);
        (end[axis], begin[axis]) = (middle, middle);
        self.fill(low, end, is_solid, is_within, solid);
        self.fill(begin, high, is_solid, is_within, solid);
    }

    /// The cells that air can reach from the border.
    pub fn outside(&self, solid: &[bool]) -> Vec<bool> {
        let mut found = vec![false; solid.len()];
        let mut open = Vec::new();
        let mut reach = |at: [usize; 3], open: &mut Vec<[usize; 3]>| {
            let i = self.index(at);
            if !solid[i] && !found[i] {
                found[i] = true;
                open.push(at);
            }
        };
        for axis in 0..3 {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            for i in 0..self.cells[u] {
                for j in 0..self.cells[v] {
                    for end in [0, self.cells[axis] - 1] {
                        let mut at = [0; 3];
                        (at[axis], at[u], at[v]) = (end, i, j);
                        reach(at, &mut open);
                    }
                }
            }
        }
        while let Some(at) = open.pop() {
            for axis in 0..3 {
                for (is_free, up) in [(at[axis] > 0, false), (at[axis] + 1 < self.cells[axis], true)] {
                    if is_free {
                        let mut next = at;
                        next[axis] = if up { at[axis] + 1 } else { at[axis] - 1 };
                        reach(next, &mut open);
                    }
                }
            }
        }
        found
    }

    /// Distance of each node from the marked cells and from all that lies beyond the grid.
    pub fn depths(&self, outside: &[bool], count: [usize; 3]) -> Vec<f32> {
        let strides = [count[1] * count[2], count[2], 1];
        let mut squares = vec![f64::INFINITY; count.iter().product()];
        for (i, square) in squares.iter_mut().enumerate() {
            let at: [usize; 3] = std::array::from_fn(|a| i / strides[a] % count[a]);
            let is_rim = (0..3).any(|a| at[a] == 0 || at[a] == self.cells[a]);
            let touches = |corner: usize| {
                let down = [corner >> 2, corner >> 1 & 1, corner & 1];
                outside[self.index(std::array::from_fn(|a| at[a] - down[a]))]
            };
            if is_rim || (0..8).any(touches) {
                *square = 0.0;
            }
        }
        for axis in 0..3 {
            let (mut line, mut out) = (vec![0.0; count[axis]], vec![0.0; count[axis]]);
            let starts = (0..squares.len()).filter(|i| (i / strides[axis]).is_multiple_of(count[axis]));
            for start in starts {
                for (n, value) in line.iter_mut().enumerate() {
                    *value = squares[start + n * strides[axis]];
                }
                lowest(&line, self.cell[axis], &mut out);
                for (n, value) in out.iter().enumerate() {
                    squares[start + n * strides[axis]] = *value;
                }
            }
        }
        // Rounding must not make anything deeper.
        squares.iter().map(|s| (s.sqrt() * (1.0 - 1e-6)) as f32).collect()
    }
}

/// `min_j (h(i - j))² + f_j` for all `i`: the lower envelope of parabolas.
fn lowest(f: &[f64], h: f64, out: &mut [f64]) {
    // Parabolas of the envelope, and from where on each is the lowest.
    let mut hull: Vec<(usize, f64)> = Vec::with_capacity(f.len());
    for (j, value) in f.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let meet = |i: usize| {
            let (x, y) = (i as f64, j as f64);
            (value - f[i]) / (2.0 * h * h * (y - x)) + 0.5 * (x + y)
        };
        while hull.last().is_some_and(|(i, from)| meet(*i) <= *from) {
            hull.pop();
        }
        let from = hull.last().map_or(f64::NEG_INFINITY, |(i, _)| meet(*i));
        hull.push((j, from));
    }
    let mut at = 0;
    for (i, value) in out.iter_mut().enumerate() {
        while hull.get(at + 1).is_some_and(|(_, from)| *from <= i as f64) {
            at += 1;
        }
        *value = hull.get(at).map_or(f64::INFINITY, |(j, _)| {
            (h * (i as f64 - *j as f64)).powi(2) + f[*j]
        });
    }
}
