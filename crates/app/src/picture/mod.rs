//! Pictures without a graphics card: depth maps of the triangles, shaded with the normals of the field.
//!
//! Light comes from a bright sun and from a sky that is brighter above. What blocks either is found with the
//! depth map of the same triangles seen from that light, so that creases darken and shadows fall where they
//! would.

mod depth_map;

use std::f64::consts::PI;

use bspline::Field;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use depth_map::DepthMap;

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
const SKY: usize = 96;
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
        row[x] = CLAY.powf(2.2) * (0.05 + light / all.max(1e-9) + 0.95 * direct);
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
