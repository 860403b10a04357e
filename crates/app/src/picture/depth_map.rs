use glam::{DMat3, DVec3};

use super::Scene;

/// The nearest triangle and its depth in each pixel, seen from far away.
pub struct DepthMap {
    /// Rows: right, up, toward the eye.
    pub axes: DMat3,
    center: DVec3,
    pixels_per_length: f64,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Largest coordinate toward the eye, relative to the centre.
    depth: Vec<f32>,
    /// Triangle seen; `u32::MAX` for none.
    pub triangle: Vec<u32>,
}

impl DepthMap {
    /// Looks at the scene along the third row of `axes`; the scene fills the map.
    pub fn draw(scene: &Scene, axes: DMat3, size: [usize; 2]) -> Self {
        let mut seen: Vec<DVec3> = scene.positions.iter().map(|&p| axes * p).collect();
        let (lo, hi) = seen
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), q| {
                (l.min(*q), h.max(*q))
            });
        let extent = (hi - lo).max(DVec3::splat(f64::MIN_POSITIVE));
        let scale = (0.92 * size[0] as f64 / extent.x).min(0.92 * size[1] as f64 / extent.y);
        let mut map = Self {
            axes,
            center: axes.transpose() * ((lo + hi) * 0.5),
            pixels_per_length: scale,
            size,
            depth: vec![f32::NEG_INFINITY; size[0] * size[1]],
            triangle: vec![u32::MAX; size[0] * size[1]],
        };
        let middle = (lo + hi) * 0.5;
        seen.iter_mut().for_each(|q| *q = map.pixel_of(*q - middle));
        for (t, corners) in (0..).zip(scene.triangles) {
            map.add(t, corners.map(|v| seen[v as usize]));
        }
        map
    }

    /// Column, row and depth of a point; pixel centres are whole numbers.
    fn pixel(&self, p: DVec3) -> DVec3 {
        self.pixel_of(self.axes * (p - self.center))
    }

    /// The same of a point given along the axes, from the centre.
    fn pixel_of(&self, q: DVec3) -> DVec3 {
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
        if area == 0.0 {
            return;
        }
        let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
        for y in lo.y.ceil().max(0.0) as usize..(hi.y.floor() + 1.0).clamp(0.0, self.size[1] as f64) as usize
        {
            for x in
                lo.x.ceil().max(0.0) as usize..(hi.x.floor() + 1.0).clamp(0.0, self.size[0] as f64) as usize
            {
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

    /// Share of the pixels round `p`'s own, `reach` on each side, in which nothing lies before it.
    pub fn visible(&self, p: DVec3, normal: DVec3, reach: i64) -> f64 {
        // A step off the surface, so that it does not shade itself.
        let q = self.pixel(p + normal * (2.5 / self.pixels_per_length));
        let (x, y) = (q.x.round() as i64, q.y.round() as i64);
        let mut seen = 0;
        for (i, j) in (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (x + i, y + j))) {
            let inside = i >= 0 && j >= 0 && i < self.size[0] as i64 && j < self.size[1] as i64;
            seen += usize::from(!inside || q.z as f32 >= self.depth[j as usize * self.size[0] + i as usize]);
        }
        seen as f64 / ((2 * reach + 1) * (2 * reach + 1)) as f64
    }
}
