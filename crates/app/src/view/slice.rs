//! A plane through a field, as a picture of its values.

use bspline::{Aabb, Field, Frame};
use glam::{DAffine3, DMat3, DVec3};

/// Pixels of the longer side.
const PIXELS: f64 = 256.0;

/// A plane of values: rows from the top.
pub struct Slice {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Values of the field.
    pub values: Vec<f64>,
    /// Where pixel (0, 0) is, and the ways to the next one on the right and below.
    pub place: [DVec3; 3],
}

impl Slice {
    /// The plane across an axis of a field's own world, at a share of its box. `turned` has the first axis run to the left.
    pub fn new(field: &dyn Field, within: &Aabb, axis: usize, share: f64, turned: bool) -> Self {
        let (across, up) = axes_of(axis);
        let extent = within.size();
        let pixel = f64::max(extent[across], extent[up]) / PIXELS;
        let size = [across, up].map(|a| ((extent[a] / pixel).round() as usize).max(2));
        let mut corner = within.min;
        corner[axis] += share.clamp(0.0, 1.0) * extent[axis];
        corner[up] = within.max[up];
        let mut right = pixel * DVec3::AXES[across];
        if turned {
            corner[across] = within.max[across];
            right = -right;
        }
        let down = -pixel * DVec3::AXES[up];
        let half = 0.5 * (right + down);
        let frame = Frame {
            world_from_grid: DAffine3 {
                matrix3: DMat3::from_cols(down, right, DVec3::AXES[axis] * pixel),
                translation: corner + half,
            },
            cells: [size[1] as u32 - 1, size[0] as u32 - 1, 1],
        };
        let mut values = vec![0.0; size[0] * size[1]];
        field.frame_values(&frame, [0; 3], [size[1], size[0], 1], &mut values);
        Self {
            size,
            values,
            place: [corner + half, right, down],
        }
    }

    /// Value below which a share of all lie.
    pub fn quantile(&self, share: f64) -> f64 {
        let mut sorted: Vec<f64> = self.values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        sorted
            .get((share * last as f64).round() as usize)
            .copied()
            .unwrap_or(0.0)
    }

    /// Grey from `black` to `white`, and the line where the surface is.
    pub fn picture(&self, [black, white]: [f64; 2], iso: f64) -> egui::ColorImage {
        let [w, h] = self.size;
        let range = (white - black).max(f64::MIN_POSITIVE);
        let is_inside = |n: usize| self.values[n] > iso;
        let color = |n: usize| {
            let right = (n % w + 1 < w).then_some(n + 1);
            let below = (n / w + 1 < h).then_some(n + w);
            let is_line = [right, below]
                .into_iter()
                .flatten()
                .any(|m| is_inside(m) != is_inside(n));
            if is_line {
                return LINE;
            }
            egui::Color32::from_gray((255.0 * ((self.values[n] - black) / range).clamp(0.0, 1.0)) as u8)
        };
        egui::ColorImage::new([w, h], (0..w * h).map(color).collect())
    }

    /// The place and the value of a share of the picture, from its upper left corner.
    pub fn at(&self, share: [f64; 2]) -> (DVec3, f64) {
        let pixel: [usize; 2] = std::array::from_fn(|a| {
            let n = (share[a] * self.size[a] as f64) as usize;
            n.min(self.size[a] - 1)
        });
        let [corner, right, down] = self.place;
        let p = corner + pixel[0] as f64 * right + pixel[1] as f64 * down;
        (p, self.values[pixel[1] * self.size[0] + pixel[0]])
    }
}

impl Slice {
    /// The share of the picture at which a place is, or the one that it is over.
    pub fn share_of(&self, p: DVec3) -> [f64; 2] {
        let [corner, right, down] = self.place;
        let pixel = [right, down].map(|way| (p - corner).dot(way) / way.length_squared());
        std::array::from_fn(|a| (pixel[a] + 0.5) / self.size[a] as f64)
    }

    /// The place of a share of the picture, between pixels too.
    pub fn place_at(&self, share: [f64; 2]) -> DVec3 {
        let [corner, right, down] = self.place;
        let pixel: [f64; 2] = std::array::from_fn(|a| share[a] * self.size[a] as f64 - 0.5);
        corner + pixel[0] * right + pixel[1] * down
    }
}

/// Of the surface in the picture: told from all greys by all eyes.
const LINE: egui::Color32 = egui::Color32::from_rgb(255, 170, 60);

/// The axes that run to the right and up in the plane across one.
fn axes_of(axis: usize) -> (usize, usize) {
    match axis {
        0 => (1, 2),
        1 => (0, 2),
        _ => (0, 1),
    }
}

/// Names of the ends of the picture, left, right, above and below, in a world whose axes run to the right, to the front and up of a
/// patient.
pub fn sides(axis: usize, turned: bool) -> [&'static str; 4] {
    const ENDS: [[&str; 2]; 3] = [["L", "R"], ["P", "A"], ["I", "S"]];
    let (across, up) = axes_of(axis);
    let [mut left, mut right] = ENDS[across];
    if turned {
        std::mem::swap(&mut left, &mut right);
    }
    let [below, above] = ENDS[up];
    [left, right, above, below]
}

#[cfg(test)]
mod tests {
    use bspline::primitives::Sphere;

    use super::*;

    #[test]
    fn pixels_are_the_values_of_their_places() {
        let ball = Sphere::new(DVec3::new(1.0, 2.0, 3.0), 4.0).unwrap();
        let within = Aabb::new(DVec3::new(-5.0, -4.0, -3.0), DVec3::new(7.0, 8.0, 12.0));
        for axis in 0..3 {
            for turned in [false, true] {
                let slice = Slice::new(&ball, &within, axis, 0.4, turned);
                assert_eq!(slice.values.len(), slice.size[0] * slice.size[1]);
                for share in [[0.0, 0.0], [0.3, 0.8], [0.999, 0.999]] {
                    let (p, value) = slice.at(share);
                    assert!((ball.value(p) - value).abs() < 1e-9);
                    assert!((p[axis] - (within.min[axis] + 0.4 * within.size()[axis])).abs() < 1e-9);
                    let pixel = within.size().max_element() / PIXELS;
                    assert!(
                        p.cmpge(within.min).all() && p.cmple(within.max + pixel).all(),
                        "{p}"
                    );
                }
                for share in [[0.0, 0.0], [0.3, 0.8], [1.0, 1.0]] {
                    let again = slice.share_of(slice.place_at(share));
                    assert!((0..2).all(|a| (again[a] - share[a]).abs() < 1e-9), "{again:?}");
                    let pixel = 2.0 * within.size().max_element() / PIXELS;
                    assert!(slice.place_at(share).distance(slice.at(share).0) < pixel);
                }
                // Up in the picture is up in the world.
                let (above, below) = (slice.at([0.5, 0.1]).0, slice.at([0.5, 0.9]).0);
                assert!(above[axes_of(axis).1] > below[axes_of(axis).1]);
                let (left, right) = (slice.at([0.1, 0.5]).0, slice.at([0.9, 0.5]).0);
                assert_eq!(left[axes_of(axis).0] > right[axes_of(axis).0], turned);
            }
        }
    }

    #[test]
    fn the_line_is_where_the_surface_is() {
        let ball = Sphere::new(DVec3::ZERO, 4.0).unwrap();
        let within = Aabb::new(DVec3::splat(-6.0), DVec3::splat(6.0));
        let slice = Slice::new(&ball, &within, 2, 0.5, false);
        let picture = slice.picture([-2.0, 4.0], 0.0);
        let pixel = 12.0 / PIXELS;
        let mut count = 0;
        for (n, color) in picture.pixels.iter().enumerate() {
            if *color == LINE {
                let share = [n % 256, n / 256].map(|k| (k as f64 + 0.5) / 256.0);
                assert!((slice.at(share).0.length() - 4.0).abs() < 1.5 * pixel);
                count += 1;
            }
        }
        assert!(count > 500, "{count}");
    }
}
