use std::collections::BTreeMap;

use bspline::Aabb;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::limits::Region;
use crate::scene::Formula;
use crate::scene::operations::Slope;

/// Cells on each axis of the grid on which a curve is looked for.
const CELLS: usize = 48;
/// The six tetrahedra of a cell about its diagonal, as corners `4x + 2y + z`: neighbours share whole faces.
const TETRAHEDRA: [[usize; 4]; 6] = [
    [0, 1, 3, 7],
    [0, 1, 5, 7],
    [0, 2, 3, 7],
    [0, 2, 6, 7],
    [0, 4, 5, 7],
    [0, 4, 6, 7],
];
/// Newton steps at most.
const STEPS: usize = 30;

/// The curve where two formulas of `x`, `y` and `z` vanish.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Meet {
    /// The two.
    pub formulas: [String; 2],
    /// Where it is looked for; the box of the whole field if missing. Loops smaller than a fiftieth of it may be missed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<Region>,
}

impl Meet {
    /// All its parts: crossings of the faces of tetrahedra by the linear interpolants of both formulas, joined from cell to cell and
    /// brought onto the curve by Newton's method.
    pub(super) fn lines(&self, whole: &Aabb) -> Result<Vec<Vec<DVec3>>, String> {
        let within = self.within.as_ref().map_or(Ok(*whole), Region::aabb)?;
        let mut both = Vec::new();
        for text in &self.formulas {
            let formula = Formula::parse(text)?;
            if formula.reads_density() {
                return Err(format!("the formula {text:?} reads d; here are x, y and z alone"));
            }
            both.push(formula);
        }
        let grid = Grid::new(&within, &both)?;
        let crossings = grid.crossings();
        let [f, g] = &self.formulas;
        if crossings.places.is_empty() {
            return Err(format!(
                "{f:?} and {g:?} vanish together nowhere from {:?} to {:?}; move the box within, or make it smaller",
                within.min.to_array(),
                within.max.to_array()
            ));
        }
        let reach = grid.step.length();
        let newton = |p: &DVec3| {
            onto(&both, *p, reach).ok_or_else(|| {
                format!(
                    "{f:?} and {g:?} do not cross at {:?}, they touch or vanish on a surface; change one of them",
                    p.to_array()
                )
            })
        };
        let places: Result<Vec<DVec3>, String> = crossings.places.iter().map(newton).collect();
        let places = places?;
        // Crossings of neighbouring faces may come to the same place of the curve.
        let near = 1e-9 * reach;
        let lines = crossings.chains().into_iter().map(|(chain, is_closed)| {
            let mut line: Vec<DVec3> = chain.iter().map(|i| places[*i]).collect();
            line.dedup_by(|b, a| a.distance(*b) <= near);
            if is_closed && line.len() > 1 {
                if line[0].distance(line[line.len() - 1]) <= near {
                    line.pop();
                }
                line.push(line[0]);
            }
            line
        });
        Ok(lines.filter(|line| line.len() > 2).collect())
    }
}

/// The nearest place, about, where both vanish: steps of least length that the linear functions ask for.
fn onto(both: &[Formula], start: DVec3, reach: f64) -> Option<DVec3> {
    let mut p = start;
    for _ in 0..STEPS {
        let slopes = [0, 1, 2].map(|a| Slope {
            value: p[a],
            gradient: DVec3::AXES[a],
        });
        let [f, g] = [both[0].of(slopes), both[1].of(slopes)];
        let [ff, fg, gg] = [
            f.gradient.length_squared(),
            f.gradient.dot(g.gradient),
            g.gradient.length_squared(),
        ];
        let size = ff * gg - fg * fg;
        if !(size > 1e-12 * ff * gg && size.is_finite()) {
            return None;
        }
        let a = (fg * g.value - gg * f.value) / size;
        let b = (fg * f.value - ff * g.value) / size;
        let step = a * f.gradient + b * g.gradient;
        p += step.clamp_length_max(0.5 * reach);
        if !p.is_finite() || p.distance(start) > 2.0 * reach {
            return None;
        }
        if step.length() <= 1e-13 * (reach + p.length()) {
            break;
        }
    }
    Some(p)
}

struct Grid {
    first: DVec3,
    step: DVec3,
    values: Vec<[f64; 2]>,
}

/// Places where the curve goes through faces, and which of them a tetrahedron joins.
struct Crossings {
    places: Vec<DVec3>,
    joined: Vec<Vec<usize>>,
}

impl Grid {
    fn new(within: &Aabb, both: &[Formula]) -> Result<Self, String> {
        let (first, step) = (within.min, within.size() / CELLS as f64);
        let n = CELLS + 1;
        let mut values = Vec::with_capacity(n * n * n);
        for i in 0..n * n * n {
            let p = first + step * node(i);
            values.push([both[0].at(p, 0.0)?, both[1].at(p, 0.0)?]);
        }
        // Zeros at nodes count as just above: every crossing then lies inside a face.
        for of in 0..2 {
            let least = 1e-12 * values.iter().fold(0.0_f64, |m, v| m.max(v[of].abs()));
            let zeros = values.iter_mut().filter(|v| v[of].abs() <= least);
            zeros.for_each(|v| v[of] = least);
        }
        Ok(Self { first, step, values })
    }

    fn crossings(&self) -> Crossings {
        let n = CELLS + 1;
        let mut known: BTreeMap<[usize; 3], Option<usize>> = BTreeMap::new();
        let mut all = Crossings {
            places: Vec::new(),
            joined: Vec::new(),
        };
        for cell in 0..CELLS * CELLS * CELLS {
            let [x, y, z] = [cell / CELLS / CELLS, cell / CELLS % CELLS, cell % CELLS];
            let corners: [usize; 8] =
                std::array::from_fn(|c| ((x + (c >> 2)) * n + y + (c >> 1 & 1)) * n + z + (c & 1));
            let is_both = |of: usize| {
                let below = corners.iter().filter(|c| self.values[**c][of] < 0.0).count();
                below > 0 && below < 8
            };
            if !(is_both(0) && is_both(1)) {
                continue;
            }
            for t in &TETRAHEDRA {
                let mut met = Vec::new();
                for left_out in 0..4 {
                    let mut face = [0; 3];
                    let kept = (0..4).filter(|i| *i != left_out);
                    face.iter_mut().zip(kept).for_each(|(f, i)| *f = corners[t[i]]);
                    face.sort_unstable();
                    let found = *known.entry(face).or_insert_with(|| {
                        let place = self.crossing(face)?;
                        all.places.push(place);
                        all.joined.push(Vec::new());
                        Some(all.places.len() - 1)
                    });
                    met.extend(found);
                }
                if let [a, b] = met[..] {
                    all.joined[a].push(b);
                    all.joined[b].push(a);
                }
            }
        }
        all
    }

    /// Where both linear interpolants vanish on a triangle.
    fn crossing(&self, face: [usize; 3]) -> Option<DVec3> {
        let [a, b, c] = face.map(|i| self.values[i]);
        let minor = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - q[0] * p[1];
        let shares = [minor(b, c), minor(c, a), minor(a, b)];
        let is_inside = shares.iter().all(|s| *s > 0.0) || shares.iter().all(|s| *s < 0.0);
        let sum: f64 = shares.iter().sum();
        is_inside.then(|| {
            let places = face.map(|i| self.first + self.step * node(i));
            (0..3).map(|k| shares[k] / sum * places[k]).sum()
        })
    }
}

/// Numbers of a node on the axes.
fn node(i: usize) -> DVec3 {
    let n = CELLS + 1;
    DVec3::new((i / n / n) as f64, (i / n % n) as f64, (i % n) as f64)
}

impl Crossings {
    /// Lists of places, each from end to end, and whether it is closed: open ones first.
    fn chains(&self) -> Vec<(Vec<usize>, bool)> {
        let mut seen = vec![false; self.places.len()];
        let mut chains = Vec::new();
        let ends = (0..self.places.len()).filter(|i| self.joined[*i].len() == 1);
        for start in ends.chain(0..self.places.len()) {
            if seen[start] || self.joined[start].is_empty() {
                continue;
            }
            let is_closed = self.joined[start].len() != 1;
            let mut chain = vec![start];
            seen[start] = true;
            while let Some(next) = self.joined[chain[chain.len() - 1]].iter().find(|i| !seen[**i]) {
                seen[*next] = true;
                chain.push(*next);
            }
            chains.push((chain, is_closed));
        }
        chains
    }
}
