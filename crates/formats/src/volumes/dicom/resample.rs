//! Slices between and across planes.

use super::stack::Slice;
use crate::Fault;

/// Planes in memory while slices are made of two of them.
pub(super) struct Blend {
    plane_dims: [usize; 2],
    /// The two planes read last, with their indices.
    held: [(usize, Vec<f32>); 2],
    /// A slice before it is shifted.
    mixed: Vec<f32>,
}

const NONE: usize = usize::MAX;

impl Blend {
    pub fn new(plane_dims: [usize; 2]) -> Self {
        Self {
            plane_dims,
            held: [(NONE, Vec::new()), (NONE, Vec::new())],
            mixed: Vec::new(),
        }
    }

    /// Bytes that are held.
    pub fn bytes(plane_dims: [usize; 2]) -> u64 {
        3 * 4 * (plane_dims[0] * plane_dims[1]) as u64
    }

    /// Makes a slice of `out_dims` columns and rows. `read` gives a plane; each is read once, if slices come in order.
    pub fn slice(
        &mut self,
        slice: &Slice,
        out_dims: [usize; 2],
        out: &mut [f32],
        mut read: impl FnMut(usize, &mut [f32]) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let pixels = self.plane_dims[0] * self.plane_dims[1];
        self.mixed.resize(pixels, 0.0);
        let below = self.hold(slice.below, pixels, slice.below, &mut read)?;
        if slice.above > 0.0 {
            let above = self.hold(slice.below + 1, pixels, slice.below, &mut read)?;
            let (a, b) = (&self.held[below].1, &self.held[above].1);
            for ((m, a), b) in self.mixed.iter_mut().zip(a).zip(b) {
                *m = mix(*a, *b, slice.above);
            }
        } else {
            self.mixed.copy_from_slice(&self.held[below].1);
        }
        if slice.shift == [0.0; 2] && out_dims == self.plane_dims {
            out.copy_from_slice(&self.mixed);
        } else {
            shift(&self.mixed, self.plane_dims, slice.shift, out, out_dims);
        }
        Ok(())
    }

    /// Place of a plane among those held; read over the other one than `keep` if it is not.
    fn hold(
        &mut self,
        plane: usize,
        pixels: usize,
        keep: usize,
        read: &mut impl FnMut(usize, &mut [f32]) -> Result<(), Fault>,
    ) -> Result<usize, Fault> {
        if let Some(i) = self.held.iter().position(|(p, _)| *p == plane) {
            return Ok(i);
        }
        let i = usize::from(self.held[0].0 == keep);
        let (held, values) = &mut self.held[i];
        // Not what it was, should the reading fail.
        *held = NONE;
        values.resize(pixels, 0.0);
        read(plane, values)?;
        *held = plane;
        Ok(i)
    }
}

fn mix(a: f32, b: f32, share: f64) -> f32 {
    let (a, b) = (f64::from(a), f64::from(b));
    (a + (b - a) * share) as f32
}

/// Moves a picture by a share of pixels, bilinearly; what lies outside of it is NaN.
fn shift(from: &[f32], from_dims: [usize; 2], by: [f64; 2], out: &mut [f32], out_dims: [usize; 2]) {
    let columns: Vec<_> = (0..out_dims[0]).map(|x| at(x, by[0], from_dims[0])).collect();
    for (y, row) in out.chunks_exact_mut(out_dims[0]).enumerate() {
        let Some((y0, ty)) = at(y, by[1], from_dims[1]) else {
            row.fill(f32::NAN);
            continue;
        };
        let line = |y: usize| &from[y * from_dims[0]..(y + 1) * from_dims[0]];
        let (low, high) = (line(y0), line((y0 + 1).min(from_dims[1] - 1)));
        for (value, column) in row.iter_mut().zip(&columns) {
            *value = match column {
                None => f32::NAN,
                Some((x, tx)) => {
                    let next = (x + 1).min(from_dims[0] - 1);
                    mix(mix(low[*x], low[next], *tx), mix(high[*x], high[next], *tx), ty)
                }
            };
        }
    }
}

/// Pixel at or before place `i` of the shifted grid, and the share of the next one; `None` outside.
fn at(i: usize, by: f64, count: usize) -> Option<(usize, f64)> {
    // Positions are sums of rounded numbers: this much outside is the edge.
    const EDGE: f64 = 1e-6;
    let place = i as f64 - by;
    let last = (count - 1) as f64;
    if place < -EDGE || place > last + EDGE {
        return None;
    }
    let place = place.clamp(0.0, last);
    Some((place.floor() as usize, place.fract()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_of_numbers_shifts_by_shares_of_pixels() {
        // 4 x 3 values of x + 10 y, moved by 0.5 and -1 on a grid of 6 x 3.
        let from: Vec<f32> = (0..12).map(|i| (i % 4 + 10 * (i / 4)) as f32).collect();
        let mut out = [0.0; 18];
        shift(&from, [4, 3], [0.5, -1.0], &mut out, [6, 3]);
        for y in 0..3 {
            for x in 0..6 {
                let (fx, fy) = (x as f32 - 0.5, y as f32 + 1.0);
                let value = out[x + 6 * y];
                if (0.0..=3.0).contains(&fx) && (0.0..=2.0).contains(&fy) {
                    assert_eq!(value, fx + 10.0 * fy, "{x} {y}");
                } else {
                    assert!(value.is_nan(), "{x} {y}");
                }
            }
        }
    }

    #[test]
    fn each_plane_is_read_once_and_mixed_by_its_share() {
        let mut blend = Blend::new([2, 1]);
        let mut reads = Vec::new();
        for (below, above) in [(0, 0.0), (0, 0.25), (1, 0.5), (2, 0.0)] {
            let slice = Slice {
                below,
                above,
                shift: [0.0; 2],
            };
            let mut out = [0.0; 2];
            let read = |p: usize, values: &mut [f32]| {
                reads.push(p);
                values.copy_from_slice(&[p as f32, 10.0 * p as f32]);
                Ok(())
            };
            blend.slice(&slice, [2, 1], &mut out, read).unwrap();
            let z = below as f32 + above as f32;
            assert_eq!(out, [z, 10.0 * z]);
        }
        assert_eq!(reads, [0, 1, 2]);
    }
}
