//! Pictures without a graphics card: depth maps of the triangles, shaded with the normals of the field.
//!
//! Light comes from a bright sun and from a sky that is brighter above. What blocks either is found with the
//! depth map of the same triangles seen from that light, so that creases darken and shadows fall where they
//! would.

use std::f64::consts::PI;

use bspline::Field;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// What to draw.
pub struct Scene<'a> {
    /// The field whose gradient gives the normals.
    pub field: &'a dyn Field,
    /// Vertices, world coordinates.
    pub positions: &'a [DVec3],
    /// Triangles, counter-clockwise from outside.
    pub triangles: &'a [[u32; 3]],
}

/// From where.
pub struct View {
    /// Width and height of the picture in pixels.
    pub size: [usize; 2],
    /// Direction that points up in the picture.
    pub up: DVec3,
    /// Direction from the object to the eye.
    pub toward_eye: DVec3,
}

/// Samples of a pixel along one side.
const SAMPLES: usize = 2;
/// Directions of the sky; each sample of a pixel sees every `SAMPLES²`-th of them.
const SKY: usize = 128;
const CLAY: DVec3 = DVec3::new(0.80, 0.56, 0.42);
const PAPER: DVec3 = DVec3::new(0.93, 0.94, 0.95);

/// Draws the scene; RGB bytes, rows from the top.
pub fn draw(scene: &Scene, view: &View) -> Vec<u8> {
    let [w, h] = view.size;
    let axes = axes(view.toward_eye, view.up);
    let camera = DepthMap::draw(scene, axes, [w * SAMPLES, h * SAMPLES]);
    let sky: Vec<DepthMap> = (0..SKY)
        .into_par_iter()
        .map(|i| {
            // A spiral of equal areas over the sphere.
            let z = 1.0 - (2 * i + 1) as f64 / SKY as f64;
            let angle = PI * (3.0 - 5f64.sqrt()) * i as f64;
            let r = (1.0 - z * z).sqrt();
            let d = axes.transpose() * DVec3::new(r * angle.cos(), z, r * angle.sin());
            DepthMap::draw(scene, self::axes(d, view.up), [384, 384])
        })
        .collect();
    let sun_direction = axes.transpose() * DVec3::new(-0.45, 0.65, 0.62);
    let sun = DepthMap::draw(scene, self::axes(sun_direction, view.up), [1536, 1536]);

    let rows: Vec<Vec<DVec3>> = (0..h * SAMPLES)
        .into_par_iter()
        .map(|y| shade_row(scene, &camera, &sun, &sky, axes.row(1), y))
        .collect();
    let mut bytes = Vec::with_capacity(3 * w * h);
    for y in 0..h {
        for x in 0..w {
            let mut sum = DVec3::ZERO;
            for s in 0..SAMPLES * SAMPLES {
                sum += rows[y * SAMPLES + s / SAMPLES][x * SAMPLES + s % SAMPLES];
            }
            let linear = sum / (SAMPLES * SAMPLES) as f64;
            bytes.extend(
                linear
                    .to_array()
                    .map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8),
            );
        }
    }
    bytes
}

/// Linear colours of one row of samples.
fn shade_row(
    s: &Scene,
    camera: &DepthMap,
    sun: &DepthMap,
    sky: &[DepthMap],
    up: DVec3,
    y: usize,
) -> Vec<DVec3> {
    let width = camera.size[0];
    let hits: Vec<usize> = (0..width)
        .filter(|x| camera.triangle[y * width + x] != u32::MAX)
        .collect();
    let points: Vec<DVec3> = hits.iter().map(|&x| camera.point(x, y)).collect();
    let mut jets = vec![(0.0, DVec3::ZERO); points.len()];
    s.field.values_gradients(&points, &mut jets);
    let fade = 1.0 - 0.25 * y as f64 / camera.size[1] as f64;
    let mut row = vec![(PAPER * fade).powf(2.2); width];
    for ((&x, &p), (_, gradient)) in hits.iter().zip(&points).zip(&jets) {
        let flat = s.triangle_normal(camera.triangle[y * width + x]);
        let smooth = (-*gradient).normalize_or_zero();
        // Where the solid was cut at its box, the field's normal is not that of the cut.
        let n = if smooth.dot(flat) > 0.5 { smooth } else { flat };
        let n = if n.dot(camera.axes.row(2)) < -0.2 { -n } else { n };
        let (mut light, mut all) = (0.0, 0.0);
        for d in sky
            .iter()
            .skip((x % SAMPLES) * SAMPLES + y % SAMPLES)
            .step_by(SAMPLES * SAMPLES)
        {
            let toward = d.axes.row(2);
            let weight = n.dot(toward).max(0.0);
            all += weight;
            light += weight * (0.55 + 0.45 * toward.dot(up)) * d.visible(p, n, 0);
        }
        let direct = n.dot(sun.axes.row(2)).max(0.0) * sun.visible(p, n, 2);
        row[x] = CLAY.powf(2.2) * (1.15 * light / all.max(1e-9) + 1.05 * direct);
    }
    row
}

/// Rows: right, up, toward the eye.
fn axes(toward: DVec3, up: DVec3) -> DMat3 {
    let back = toward.normalize();
    let side = up.cross(back);
    let right = if side.length() > 1e-6 {
        side.normalize()
    } else {
        back.any_orthonormal_vector()
    };
    DMat3::from_cols(right, back.cross(right), back).transpose()
}

impl Scene<'_> {
    fn corners(&self, t: u32) -> [DVec3; 3] {
        self.triangles[t as usize].map(|v| self.positions[v as usize])
    }

    fn triangle_normal(&self, t: u32) -> DVec3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a).normalize_or_zero()
    }
}

/// The nearest triangle and its depth in each pixel, seen from far away.
struct DepthMap {
    axes: DMat3,
    center: DVec3,
    pixels_per_length: f64,
    size: [usize; 2],
    /// Largest coordinate toward the eye, relative to the centre.
    depth: Vec<f32>,
    triangle: Vec<u32>,
}

impl DepthMap {
    fn draw(scene: &Scene, axes: DMat3, size: [usize; 2]) -> Self {
        let seen = scene.positions.iter().map(|&p| axes * p);
        let (lo, hi) = seen.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), q| {
            (l.min(q), h.max(q))
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
        for t in 0..scene.triangles.len() as u32 {
            map.add(t, scene.corners(t).map(|p| map.pixel(p)));
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
    fn point(&self, x: usize, y: usize) -> DVec3 {
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
    fn visible(&self, p: DVec3, normal: DVec3, reach: i64) -> f64 {
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
