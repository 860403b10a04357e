//! Parts of the solid, and gaps in it, that are thinner than the cells.
//!
//! A field with cells of edge `h` shows a sheet of thickness `t` whole from `t = 0.6 h` on, in shreds below that, and not
//! at all below `0.15 h`: of plates at three angles 99.95 % of the middle is inside at 0.55, 99.4 % at 0.45, 63 % at 0.41,
//! 46 % at 0.36, 7 % at 0.3, and at most 0.03 % at 0.2 and 0.02 % at 0.14. From 0.42 on what is missing is mended by a
//! part of the next level. So the way from `0.15 h` to `0.42 h` is gone as a whole or not at all.

use std::collections::BTreeMap;

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::distance::MeshDistance;
use super::judge::Quality;
use super::probes::{Cell, Octants, around};

/// Thickness in cells from which on a sheet is shown, but for places.
const SHOWN: f64 = 0.42;
/// Thickness in cells from which on all of it is shown, and the share of the next level that mends the places till then.
const WHOLE: f64 = 0.6;
const MENDED: f64 = 0.15;
/// Thickness in cells below which a sheet leaves no trace.
const SHREDS: f64 = 0.15;
/// Normals are opposite from this cosine on.
const OPPOSITE: f64 = -0.5;
/// An error on the surface of so many cells may be that of a sheet that is not shown.
const UNSEEN: f64 = 0.05;
/// Functions on one level for each on the level above it, along a sheet; 3.9 to 4.6 were counted.
const GROWTH: f64 = 4.3;

/// What is too thin to be shown, and so is left out.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TooThin {
    /// Area of the surface in the cells left as they are, unit box.
    pub area: f64,
    /// Thickness from which on sheets are shown, unit box.
    pub shown: f64,
    /// Least thickness left out, unit box.
    pub least: f64,
    /// Depth and coefficients, about, that would show all.
    pub depth: usize,
    pub coefficients: usize,
}

/// The sheets of a level that are not shown by it.
pub(super) struct Sheets {
    /// Cells of sheets that leave no trace yet, by the depth that shows them, with their thickness.
    unseen: BTreeMap<usize, Vec<(usize, f64)>>,
    /// Cells of sheets half shown, by the depth that shows them whole.
    begun: BTreeMap<usize, Vec<usize>>,
    /// Cells that do not show the surface, for whatever reason.
    unknown: Vec<usize>,
}

/// What is done about the sheets of a level.
pub(super) struct Choice {
    /// Cells that are left as they are.
    pub refused: Vec<usize>,
    /// Coefficients that those on the way to be shown will take on deeper levels than the next.
    pub reserved: usize,
}

impl Sheets {
    /// Looks for them among the cells that are not within the tolerance.
    pub fn find<'a>(
        mesh: &MeshDistance,
        depth: usize,
        above: impl Iterator<Item = (usize, &'a Cell, &'a Octants, &'a Quality)>,
    ) -> Self {
        let h = 0.5f64.powi(depth as i32);
        let mut out = Self {
            unseen: BTreeMap::new(),
            begun: BTreeMap::new(),
            unknown: Vec::new(),
        };
        let may_be_unseen = |q: &Quality| q.is_lost() || q.rms() > UNSEEN * h;
        let above: Vec<_> = above.filter(|(.., quality)| may_be_unseen(quality)).collect();
        let thick: Vec<Option<f64>> = above
            .par_iter()
            .map(|(_, cell, octants, _)| thickness(mesh, cell, octants, depth))
            .collect();
        for ((i, .., quality), t) in above.into_iter().zip(thick) {
            let Some(t) = t else {
                out.unknown.push(i);
                continue;
            };
            if t >= SHOWN * h {
                continue;
            }
            let needed = (depth + 1..).find(|d| SHOWN * 0.5f64.powi(*d as i32) <= t.max(1e-12));
            let needed = needed.expect("lengths above 0 are shown at some depth");
            if t < SHREDS * h {
                out.unseen.entry(needed).or_default().push((i, t));
            } else if quality.is_lost() {
                out.begun.entry(needed).or_default().push(i);
            }
        }
        out
    }

    /// Takes the thickest sheets first, as long as there is `room` for all the levels that they need, none deeper than
    /// `max_depth`. `count` tells the functions on the next level, `at` the place of a cell and the area in it. The rims of
    /// sheets left out go with them.
    pub fn choose(
        self,
        depth: usize,
        max_depth: usize,
        mut room: Option<usize>,
        count: impl Fn(&[usize]) -> usize,
        at: impl Fn(usize) -> ([u32; 3], f64),
        spent: usize,
        too_thin: &mut TooThin,
    ) -> Choice {
        let mut out = Choice {
            refused: Vec::new(),
            reserved: 0,
        };
        let mut total = spent;
        for (needed, cells) in &self.begun {
            let next = count(cells);
            let all = to_depth(next, (*needed).min(max_depth) - depth, false);
            out.reserved += all - next;
            room = room.map(|r| r.saturating_sub(all));
            total += all;
        }
        let mut is_full = false;
        for (needed, cells) in self.unseen {
            let (cells, thick): (Vec<usize>, Vec<f64>) = cells.into_iter().unzip();
            let next = count(&cells);
            let thinnest = thick.iter().copied().fold(f64::INFINITY, f64::min);
            let all = to_depth(
                next,
                needed - depth,
                thinnest < WHOLE * 0.5f64.powi(needed as i32),
            );
            is_full |= needed > max_depth || room.is_some_and(|r| all > r);
            if !is_full {
                out.reserved += all - next;
                room = room.map(|r| r - all);
                total += all;
                continue;
            }
            if too_thin.area == 0.0 {
                too_thin.least = f64::INFINITY;
            }
            too_thin.area += cells.iter().map(|&i| at(i).1).sum::<f64>();
            too_thin.shown = too_thin.shown.max(2.0 * SHOWN * 0.5f64.powi(needed as i32));
            too_thin.least = too_thin.least.min(thinnest);
            too_thin.depth = too_thin.depth.max(needed);
            too_thin.coefficients = too_thin.coefficients.max(total).saturating_add(all);
            out.refused.extend(cells);
        }
        let refused: FxHashSet<[u32; 3]> = out.refused.iter().map(|&i| at(i).0).collect();
        out.refused.extend(
            self.unknown
                .into_iter()
                .filter(|&i| !refused.is_empty() && around(at(i).0).any(|cell| refused.contains(&cell))),
        );
        out
    }
}

/// Functions on so many `levels` when the first takes `next`, and on the places of one more.
fn to_depth(next: usize, levels: usize, is_mended: bool) -> usize {
    let mut growing = next as f64;
    let mut sum = 0.0;
    for _ in 0..levels {
        sum += growing;
        growing *= GROWTH;
    }
    if is_mended {
        sum += MENDED * growing;
    }
    sum as usize
}

/// Thickness of the sheet, or width of the gap, that passes through a cell: the largest way between feet of its parts on
/// faces whose normals are opposite, along them. At the tip of a wedge, where it gets as thin as one likes, that is about
/// the edge of the cell. Where all feet are on one side, the way across from one of them.
fn thickness(mesh: &MeshDistance, cell: &Cell, octants: &Octants, depth: usize) -> Option<f64> {
    let h = 0.5f64.powi(depth as i32);
    let sides: Vec<_> = cell
        .places(depth)
        .zip(octants)
        .filter(|(_, found)| found.on_face && found.distance <= h)
        .filter_map(|(place, found)| Some((found, found.gradient(place)?)))
        .collect();
    let mut widest: Option<f64> = None;
    for (i, (p, inward)) in sides.iter().enumerate() {
        for (q, other) in &sides[..i] {
            if inward.dot(*other) < OPPOSITE {
                let way = (p.foot - q.foot).dot(*inward).abs();
                widest = Some(widest.map_or(way, |w| w.max(way)));
            }
        }
    }
    widest.or_else(|| {
        let (found, inward) = sides.first()?;
        let across = [*inward, -*inward].map(|way| mesh.across(found, way, h));
        across.into_iter().flatten().reduce(f64::min)
    })
}
