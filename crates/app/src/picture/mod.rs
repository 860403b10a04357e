//! Pictures without a graphics card: depth maps of the triangles, shaded with the normals of the field.
//!
//! Light comes from a bright sun and from a sky that is brighter above. What blocks either is found with the
//! depth map of triangles seen from that light, so that creases darken and shadows fall where they would. These
//! triangles may be coarser than those that are seen: what a shadow needs is its outline.

mod depth_map;
mod part;

use std::f64::consts::PI;

use bspline::Field;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use depth_map::{DepthMap, fill};
pub use part::Part;

/// A closed triangle mesh, counter-clockwise from outside.
pub struct Surface<'a> {
    /// Vertices, world coordinates.
    pub positions: &'a [DVec3],
    /// Triangles.
    pub triangles: &'a [[u32; 3]],
}

/// What to draw.
pub struct Scene<'a> {
    /// The field whose gradient gives the normals.
    pub field: &'a dyn Field,
    /// What is seen.
    pub seen: Surface<'a>,
    /// What casts shadows.
    pub shading: Surface<'a>,
}

/// From where.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Width and height of the picture in pixels.
    pub size: [usize; 2],
    /// Rows: right, up, toward the eye.
    pub axes: DMat3,
    /// The point in the middle of the picture.
    pub center: DVec3,
    /// Scale.
    pub pixels_per_length: f64,
}

/// Samples of a pixel along one side.
const SAMPLES: usize = 2;
/// Directions of the sky, and pixels of the longest side of a picture for each where there are fewer.
const SKY: usize = 64;
const SKY_PIXELS: usize = 15;
/// Cosine between the triangles of a pixel's samples above which one colour will do for them all.
const SMOOTH: f64 = 0.95;
/// The same for their depths: the most that they differ, in sides of a sample.
const LEVEL: f64 = 8.0;
const CLAY: DVec3 = DVec3::new(0.80, 0.56, 0.42);
const PAPER: DVec3 = DVec3::new(0.93, 0.94, 0.95);

impl View {
    /// Looks from `toward_eye`, with `up` pointing up, at the whole of a surface.
    pub fn of(surface: &Surface, size: [usize; 2], toward_eye: DVec3, up: DVec3) -> Self {
        let axes = axes(toward_eye, up);
        let (center, pixels_per_length) = fill([surface], axes, size);
        Self {
            size,
            axes,
            center,
            pixels_per_length,
        }
    }
}

/// A scene with its lights, ready to be coloured.
pub struct Drawing<'a> {
    scene: &'a Scene<'a>,
    camera: DepthMap,
    sky: Vec<DepthMap>,
    sun: DepthMap,
    up: DVec3,
}

/// Colour of the solid at a point, in sRGB, each component in `[0, 1]`.
pub type Color<'a> = &'a (dyn Fn(DVec3) -> DVec3 + Sync);

/// Clay everywhere.
pub fn clay(_: DVec3) -> DVec3 {
    CLAY
}

impl<'a> Drawing<'a> {
    /// Finds what is seen, and what each light reaches.
    pub fn new(scene: &'a Scene, view: &View) -> Self {
        let [w, h] = view.size;
        let scale = view.pixels_per_length * SAMPLES as f64;
        let camera = DepthMap::draw(
            &scene.seen,
            view.axes,
            [w * SAMPLES, h * SAMPLES],
            view.center,
            scale,
        );
        let up = view.axes.row(1);
        // Small pictures show no more of a shadow than they have pixels.
        let side = |share: f64, most: usize| ((w.max(h) as f64 * share) as usize).clamp(most / 4, most);
        let directions = (w.max(h) / SKY_PIXELS).clamp(SKY / 4, SKY);
        let sky: Vec<DepthMap> = (0..directions)
            .into_par_iter()
            .map(|i| {
                // A spiral of equal areas over the sphere.
                let z = 1.0 - (2 * i + 1) as f64 / directions as f64;
                let angle = PI * (3.0 - 5f64.sqrt()) * i as f64;
                let r = (1.0 - z * z).sqrt();
                let d = view.axes.transpose() * DVec3::new(r * angle.cos(), z, r * angle.sin());
                DepthMap::filled(&scene.shading, axes(d, up), [side(0.5, 288); 2])
            })
            .collect();
        let sun_direction = view.axes.transpose() * DVec3::new(-0.45, 0.65, 0.62);
        let sun = DepthMap::filled(&scene.shading, axes(sun_direction, up), [side(2.0, 1024); 2]);
        Self {
            scene,
            camera,
            sky,
            sun,
            up,
        }
    }

    /// RGB bytes, rows from the top.
    pub fn pixels(&self, color: Color) -> Vec<u8> {
        let [pixels] = self.pictures([color]);
        pixels
    }

    /// The same for pictures that differ in their colours alone: light is the same for all.
    pub fn pictures<const N: usize>(&self, colors: [Color; N]) -> [Vec<u8>; N] {
        let lights = Lights {
            sky: &self.sky,
            sun: &self.sun,
            up: self.up,
        };
        let height = self.camera.size[1] / SAMPLES;
        let rows: Vec<[Vec<u8>; N]> = (0..height)
            .into_par_iter()
            .map(|y| draw_row(self.scene, &self.camera, &lights, colors, y))
            .collect();
        std::array::from_fn(|n| rows.iter().flat_map(|row| &row[n]).copied().collect())
    }
}

/// How far towards the eye, from the middle of the view, a surface is in each pixel; none where there is none.
#[cfg(all(test, feature = "window"))]
pub fn depths(surface: &Surface, view: &View) -> Vec<Option<f64>> {
    let map = DepthMap::draw(surface, view.axes, view.size, view.center, view.pixels_per_length);
    let [w, h] = view.size;
    let back = view.axes.row(2);
    let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
    let depth = |(x, y): (usize, usize)| {
        let is_seen = map.triangle[y * w + x] != u32::MAX;
        is_seen.then(|| (map.point(x, y) - view.center).dot(back))
    };
    pixels.map(depth).collect()
}

struct Lights<'a> {
    sky: &'a [DepthMap],
    sun: &'a DepthMap,
    up: DVec3,
}

/// A point that is shaded, and where its colour goes.
struct Shaded {
    pixel: usize,
    /// Samples that it stands for.
    samples: usize,
    flat: DVec3,
}

/// RGB bytes of one row of pixels, in each of the colours.
fn draw_row<const N: usize>(
    scene: &Scene,
    camera: &DepthMap,
    lights: &Lights,
    colors: [Color; N],
    y: usize,
) -> [Vec<u8>; N] {
    let width = camera.size[0] / SAMPLES;
    let (mut points, mut shaded) = (Vec::new(), Vec::new());
    let fade = 1.0 - 0.25 * y as f64 * SAMPLES as f64 / camera.size[1] as f64;
    let mut row = vec![(PAPER * fade).powf(2.2) * (SAMPLES * SAMPLES) as f64; width];
    for (pixel, sum) in row.iter_mut().enumerate() {
        let mut hits = [(DVec3::ZERO, DVec3::ZERO); SAMPLES * SAMPLES];
        let mut count = 0;
        for s in 0..SAMPLES * SAMPLES {
            let (i, j) = (pixel * SAMPLES + s % SAMPLES, y * SAMPLES + s / SAMPLES);
            let triangle = camera.triangle[j * camera.size[0] + i];
            if triangle != u32::MAX {
                hits[count] = (camera.point(i, j), scene.seen.normal(triangle));
                count += 1;
            }
        }
        let hits = &hits[..count];
        *sum *= 1.0 - count as f64 / (SAMPLES * SAMPLES) as f64;
        let is_even = count == SAMPLES * SAMPLES && {
            let (first, flat) = hits[0];
            let reach = LEVEL / camera.pixels_per_length;
            hits.iter()
                .all(|(p, n)| n.dot(flat) > SMOOTH && (*p - first).dot(camera.axes.row(2)).abs() < reach)
        };
        if is_even {
            points.push(hits.iter().map(|h| h.0).sum::<DVec3>() / count as f64);
            shaded.push(Shaded {
                pixel,
                samples: count,
                flat: hits[0].1,
            });
        } else {
            points.extend(hits.iter().map(|h| h.0));
            shaded.extend(hits.iter().map(|h| Shaded {
                pixel,
                samples: 1,
                flat: h.1,
            }));
        }
    }
    let mut rows: [_; N] = std::array::from_fn(|_| row.clone());
    let mut jets = vec![(0.0, DVec3::ZERO); points.len()];
    scene.field.values_gradients(&points, &mut jets);
    for ((s, &p), (_, gradient)) in shaded.iter().zip(&points).zip(&jets) {
        let smooth = (-*gradient).normalize_or_zero();
        // Where the solid was cut at its box, the field's normal is not that of the cut.
        let n = if smooth.dot(s.flat) > 0.5 { smooth } else { s.flat };
        let n = if n.dot(camera.axes.row(2)) < -0.2 { -n } else { n };
        let light = lights.reaching(p, n);
        for (row, color) in rows.iter_mut().zip(colors) {
            row[s.pixel] += color(p).powf(2.2) * light * s.samples as f64;
        }
    }
    rows.map(|row| {
        let byte = |c: f64| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8;
        let linear = row.into_iter().map(|sum| sum / (SAMPLES * SAMPLES) as f64);
        linear.flat_map(|c| c.to_array().map(byte)).collect()
    })
}

impl Lights<'_> {
    /// Light that reaches `p` with normal `n`.
    fn reaching(&self, p: DVec3, n: DVec3) -> f64 {
        let (mut light, mut all) = (0.0, 0.0);
        for d in self.sky {
            let toward = d.axes.row(2);
            let weight = n.dot(toward);
            if weight > 0.0 {
                all += weight;
                if d.is_visible(p, n) {
                    light += weight * (0.55 + 0.45 * toward.dot(self.up));
                }
            }
        }
        let facing = n.dot(self.sun.axes.row(2));
        let direct = if facing > 0.0 {
            facing * self.sun.visible(p, n, 2)
        } else {
            0.0
        };
        0.05 + light / all.max(1e-9) + 0.95 * direct
    }
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

impl Surface<'_> {
    fn normal(&self, t: u32) -> DVec3 {
        let [a, b, c] = self.triangles[t as usize].map(|v| self.positions[v as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    }
}
