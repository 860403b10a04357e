use glam::{DMat3, DVec3};

use super::Surface;

/// The nearest triangle and its depth in each pixel, seen from far away.
pub struct DepthMap {
    /// Rows: right, up, toward the eye.
    pub axes: DMat3,
    center: DVec3,
    pub pixels_per_length: f64,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Largest coordinate toward the eye, relative to the centre.
    depth: Vec<f32>,
    /// Triangle seen; `u32::MAX` for none.
    pub triangle: Vec<u32>,
}

impl DepthMap {
    /// Looks at a surface along the third row of `axes`; the surface fills the map.
    pub fn filled(surface: &Surface, axes: DMat3, size: [usize; 2]) -> Self {
        let (center, pixels_per_length) = fill([surface], axes, size);
        Self::draw(surface, axes, size, center, pixels_per_length)
    }

    /// Looks at the point `center`, which comes to the middle of the map.
    pub fn draw(
        surface: &Surface,
        axes: DMat3,
        size: [usize; 2],
        center: DVec3,
        pixels_per_length: f64,
    ) -> Self {
        let mut map = Self {
            axes,
            center,
            pixels_per_length,
            size,
            depth: vec![f32::NEG_INFINITY; size[0] * size[1]],
            triangle: vec![u32::MAX; size[0] * size[1]],
        };
        let seen: Vec<DVec3> = surface.positions.iter().map(|&p| map.pixel(p)).collect();
        for (t, corners) in (0..).zip(surface.triangles) {
            map.add(t, corners.map(|v| seen[v as usize]));
        }
        map
    }

    /// Column, row and depth of a point; pixel centres are whole numbers.
    fn pixel(&self, p: DVec3) -> DVec3 {
        let q = self.axes * (p - self.center);
        let middle = DVec3::new(self.size[0] as f64, self.size[1] as f64, 1.0) * 0.5 - 0.5;
        middle + DVec3::new(q.x * self.pixels_per_length, -q.y * self.pixels_per_length, q.z)
    }

    /// World point seen in a pixel.
    pub fn point(&self, x: usize, y: usize) -> DVec3 {
        let middle = [self.size[0], self.size[1]].map(|n| n as f64 * 0.5 - 0.5);
        let depth = self.depth[y * self.size[0] + x] as f64;
        let q = DVec3::new(
            (x as f64 - middle[0]) / self.pixels_per_length,
            (middle[1] - y as f64) / self.pixels_per_length,
            depth,
        );
        self.center + self.axes.transpose() * q
    }

    fn add(&mut self, t: u32, [a, b, c]: [DVec3; 3]) {
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        // Rows run downwards. Of a closed surface no far side is ever seen.
        if area >= 0.0 {
            return;
        }
        let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
        // Whole numbers from `lo` to `hi`; casts cut off and saturate, and cost less than `ceil`.
        let range = |lo: f64, hi: f64, n: usize| {
            let first = lo.max(0.0) as usize;
            let end = if hi < 0.0 { 0 } else { n.min(hi as usize + 1) };
            first + usize::from((first as f64) < lo)..end
        };
        let columns = range(lo.x, hi.x, self.size[0]);
        for y in range(lo.y, hi.y, self.size[1]) {
            for x in columns.clone() {
                let p = DVec3::new(x as f64, y as f64, 0.0);
                let u = (b - p).truncate().perp_dot((c - p).truncate()) / area;
                let v = (c - p).truncate().perp_dot((a - p).truncate()) / area;
                if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                    let depth = (u * a.z + v * b.z + (1.0 - u - v) * c.z) as f32;
                    let slot = y * self.size[0] + x;
                    if depth > self.depth[slot] {
                        self.depth[slot] = depth;
                        self.triangle[slot] = t;
                    }
                }
            }
        }
    }

    /// Whether nothing lies before `p`, whose normal is `normal`.
    pub fn is_visible(&self, p: DVec3, normal: DVec3) -> bool {
        let q = self.off_surface(p, normal, 2.5) + 0.5;
        // Casts cut off towards 0: what is left of the map or above it counts as its first column or row.
        let (x, y) = (q.x as usize, q.y as usize);
        let is_outside = x >= self.size[0] || y >= self.size[1];
        is_outside || (q.z - 0.5) as f32 >= self.depth[y * self.size[0] + x]
    }

    /// Pixel of a point some pixels off the surface, so that it does not shade itself, and triangles across a hollow do not.
    fn off_surface(&self, p: DVec3, normal: DVec3, pixels: f64) -> DVec3 {
        self.pixel(p + normal * (pixels / self.pixels_per_length))
    }

    /// Share of the pixels round `p`'s own, `reach` on each side, in which nothing lies before it.
    pub fn visible(&self, p: DVec3, normal: DVec3, reach: i64) -> f64 {
        let q = self.off_surface(p, normal, 2.5 * reach as f64);
        let (x, y) = (q.x.round() as i64, q.y.round() as i64);
        let mut seen = 0;
        for (i, j) in (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (x + i, y + j))) {
            let inside = i >= 0 && j >= 0 && i < self.size[0] as i64 && j < self.size[1] as i64;
            seen += usize::from(!inside || q.z as f32 >= self.depth[j as usize * self.size[0] + i as usize]);
        }
        seen as f64 / ((2 * reach + 1) * (2 * reach + 1)) as f64
    }
}

/// The point in the middle and the pixels in a length with which surfaces fill a map of `size`.
pub fn fill<'a>(
    surfaces: impl IntoIterator<Item = &'a Surface<'a>>,
    axes: DMat3,
    size: [usize; 2],
) -> (DVec3, f64) {
    let (lo, hi) = surfaces
        .into_iter()
        .flat_map(|s| s.positions)
        .map(|&p| axes * p)
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), q| {
            (l.min(q), h.max(q))
        });
    let extent = (hi - lo).max(DVec3::splat(f64::MIN_POSITIVE));
    let scale = (0.92 * size[0] as f64 / extent.x).min(0.92 * size[1] as f64 / extent.y);
    (axes.transpose() * ((lo + hi) * 0.5), scale)
}
