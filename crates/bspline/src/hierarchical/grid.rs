//! Values at the nodes of a grid that lies along the lattice: tensor products, brick by brick.

use crate::vectorized::vectorized;
use std::ops::Range;

use glam::DVec3;

use super::bounds::lanes;
use super::brick::{BRICK, HALO, HALO_LEN};
use super::node::Node;
use super::spline::HierarchicalSpline;
use crate::field::values_node_by_node;
use crate::{Frame, Real, cubic};

/// [`crate::Field::frame_values`]. Frames that are turned against the lattice fall back to single points.
pub(super) fn frame_values<T: Real>(
    spline: &HierarchicalSpline<T>,
    frame: &Frame,
    lo: [i64; 3],
    count: [usize; 3],
    out: &mut [f64],
) {
    assert_eq!(
        out.len(),
        count.iter().product::<usize>(),
        "one output slot per node"
    );
    if out.is_empty() {
        return;
    }
    let Some(axes) = aligned_axes(spline, frame, lo, count) else {
        return values_node_by_node(spline, frame, lo, count, out);
    };
    let mut block = Block {
        spline,
        axes: &axes,
        out,
        nodes: Nodes::default(),
    };
    let whole = axes.each_ref().map(|a| 0..a.cell.len());
    block.visit(&spline.root, whole);
    if axes.iter().any(|a| a.leaves_box) {
        block.fall_outside();
    }
}

/// The nodes of one axis.
struct Axis {
    /// Lattice coordinates, clamped to the box.
    clamped: Vec<f64>,
    /// What was clamped off.
    beyond: Vec<f64>,
    /// Cell of the finest level.
    cell: Vec<u32>,
    leaves_box: bool,
}

fn aligned_axes<T: Real>(
    spline: &HierarchicalSpline<T>,
    frame: &Frame,
    lo: [i64; 3],
    count: [usize; 3],
) -> Option<[Axis; 3]> {
    let (start, step) = spline.place.alignment(frame)?;
    let finest = spline.level_count() - 1;
    let limit = spline.lattice().cells_at(finest);
    let extent = spline.lattice().extent();
    Some(std::array::from_fn(|a| {
        let q: Vec<f64> = (0..count[a] as i64)
            .map(|i| start[a] + step[a] * (lo[a] + i) as f64)
            .collect();
        let clamped: Vec<f64> = q.iter().map(|q| q.clamp(0.0, extent[a])).collect();
        let scale = (1u64 << finest) as f64;
        Axis {
            cell: clamped
                .iter()
                .map(|q| ((q * scale) as u32).min(limit[a] - 1))
                .collect(),
            beyond: q.iter().zip(&clamped).map(|(q, c)| q - c).collect(),
            leaves_box: q != clamped,
            clamped,
        }
    }))
}

struct Block<'a, T> {
    spline: &'a HierarchicalSpline<T>,
    axes: &'a [Axis; 3],
    out: &'a mut [f64],
    nodes: Nodes<T>,
}

/// The cells of nodes within the brick at hand and their weights there, by axis.
type Nodes<T> = [Vec<(usize, [T; 4])>; 3];

impl<T: Real> Block<'_, T> {
    /// Evaluates the nodes `ranges`, all of which lie in `brick`.
    fn visit(&mut self, brick: &Node<T>, ranges: [Range<usize>; 3]) {
        if !brick.has_children() {
            return self.evaluate(brick, ranges);
        }
        let finest = self.spline.level_count() as i32 - 1;
        let shift = finest - i32::from(brick.level) - 1 + BRICK.ilog2() as i32;
        let middle: [usize; 3] = std::array::from_fn(|a| {
            let cells = &self.axes[a].cell[ranges[a].clone()];
            ranges[a].start + cells.partition_point(|c| c >> shift & 1 == 0)
        });
        for octant in 0..8usize {
            let half: [Range<usize>; 3] = std::array::from_fn(|a| match octant >> (2 - a) & 1 {
                0 => ranges[a].start..middle[a],
                _ => middle[a]..ranges[a].end,
            });
            if half.iter().any(Range::is_empty) {
                continue;
            }
            match brick.child(octant) {
                None => self.evaluate(brick, half),
                Some(child) => self.visit(child, half),
            }
        }
    }

    /// `Σ_c w_c Σ_b w_b Σ_a w_a C_abc` in the order of `kernel::value`, so with its bits.
    fn evaluate(&mut self, brick: &Node<T>, ranges: [Range<usize>; 3]) {
        let shift = self.spline.level_count() - 1 - brick.level as usize;
        let scale = brick.scale();
        for a in 0..3 {
            let axis = &self.axes[a];
            let nodes = &mut self.nodes[a];
            nodes.clear();
            nodes.extend(ranges[a].clone().map(|i| {
                let cell = axis.cell[i] >> shift;
                let t = T::from_f64(axis.clamped[i] * scale - cell as f64);
                (cell as usize % BRICK, cubic::values(t))
            }));
        }
        let (counts, offsets) = (
            self.axes.each_ref().map(|a| a.cell.len()),
            ranges.map(|r| r.start),
        );
        let (out, nodes) = (&mut *self.out, &self.nodes);
        let totals: &[T; HALO_LEN] = brick.own_totals();
        let (first, end) = span(&nodes[2]);
        vectorized(
            #[inline(always)]
            || {
                if end - first <= 8 {
                    tensor::<T, 8>(totals, nodes, counts, offsets, out);
                } else {
                    tensor::<T, 16>(totals, nodes, counts, offsets, out);
                }
            },
        );
    }

    fn fall_outside(&mut self) {
        let map = self.spline.lattice().world_from_lattice.matrix3;
        let slope = self.spline.slope();
        let [x, y, z] = self.axes;
        let mut slot = self.out.iter_mut();
        for dx in &x.beyond {
            for dy in &y.beyond {
                for dz in &z.beyond {
                    let value = slot.next().expect("one slot per node");
                    *value -= slope * (map * DVec3::new(*dx, *dy, *dz)).length();
                }
            }
        }
    }
}

/// `L` lanes along z, no fewer than the coefficients that the nodes read. What those beyond them find nobody looks at.
#[inline(always)]
fn tensor<T: Real, const L: usize>(
    totals: &[T; HALO_LEN],
    [xs, ys, zs]: &Nodes<T>,
    counts: [usize; 3],
    offsets: [usize; 3],
    out: &mut [f64],
) {
    let ((y0, y1), (z0, _)) = (span(ys), span(zs));
    // As at all knots of a brick: then those of a row are found at once.
    let is_regular = zs.len() == BRICK && zs.windows(2).all(|w| w[1].0 == w[0].0 + 1 && w[1].1 == w[0].1);
    let mut plane = [[T::zero(); L]; HALO];
    for (i, (cell, w)) in xs.iter().enumerate() {
        for y in y0..y1 {
            // Written out: a closure handed on is compiled for the baseline, and called.
            let at = (cell * HALO + y) * HALO + z0;
            plane[y - y0] = blend(
                w,
                &lanes(totals, at),
                &lanes(totals, at + HALO * HALO),
                &lanes(totals, at + 2 * HALO * HALO),
                &lanes(totals, at + 3 * HALO * HALO),
            );
        }
        for (j, (cell, w)) in ys.iter().enumerate() {
            let rows = &plane[cell - y0..cell - y0 + 4];
            let row = blend(w, &rows[0], &rows[1], &rows[2], &rows[3]);
            let start = ((offsets[0] + i) * counts[1] + offsets[1] + j) * counts[2] + offsets[2];
            let out = &mut out[start..start + zs.len()];
            if is_regular && let Ok(out) = <&mut [f64; BRICK]>::try_from(&mut *out) {
                let w = &zs[0].1;
                for z in 0..BRICK {
                    let v = [row[z], row[(z + 1) % L], row[(z + 2) % L], row[(z + 3) % L]];
                    out[z] = ((w[0] * v[0] + w[1] * v[1]) + (w[2] * v[2] + w[3] * v[3])).as_f64();
                }
                continue;
            }
            for ((cell, w), value) in zs.iter().zip(out) {
                let v = &row[cell - z0..cell - z0 + 4];
                *value = ((w[0] * v[0] + w[1] * v[1]) + (w[2] * v[2] + w[3] * v[3])).as_f64();
            }
        }
    }
}

/// First coefficient that nodes read, and the one after the last.
#[inline(always)]
fn span<T>(nodes: &[(usize, [T; 4])]) -> (usize, usize) {
    (nodes[0].0, nodes[nodes.len() - 1].0 + 4)
}

#[inline(always)]
fn blend<T: Real, const L: usize>(w: &[T; 4], a: &[T; L], b: &[T; L], c: &[T; L], d: &[T; L]) -> [T; L] {
    let mut sum = [T::zero(); L];
    for z in 0..L {
        sum[z] = ((w[0] * a[z] + w[1] * b[z]) + w[2] * c[z]) + w[3] * d[z];
    }
    sum
}
