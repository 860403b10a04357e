//! What shaders are told of the eye and of solids.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat4, DVec3};

use super::Solid;
use super::cube::Cube;
use crate::view::Look;

/// Radius of curvature, over the diagonal of the box, at which a hollow is half as dark as it can be.
pub const HOLLOW: f64 = crate::view::shape::HOLLOW;
/// Radii of the scene after which white has taken all but a twentieth of the light.
const DEEP: f64 = 1.0 / 40.0;
/// Cells from one look at the density to the next, while something moves and else.
const STEPS: [f32; 2] = [2.0, 0.9];

/// See `shaders/rays.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Eye {
    start: [[f32; 4]; 3],
    way: [[f32; 4]; 3],
    picture: [f32; 4],
    density: [f32; 4],
}

/// The same.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Record {
    lattice_from_world: [[f32; 4]; 4],
    cells: [f32; 4],
    root: u32,
    width: f32,
    iso: f32,
    little: f32,
    second: [f32; 4],
}

impl Eye {
    /// Of a picture of so many pixels of so many solids in a ball round the origin.
    pub fn new(
        look: &Look,
        size: [u32; 2],
        count: usize,
        origin: DVec3,
        radius: f64,
        is_rough: bool,
    ) -> Self {
        let camera = &look.camera;
        let [right, up, _] = camera.axes();
        let toward_eye = camera.toward_eye();
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let aside = [0.5 * camera.height * aspect * right, 0.5 * camera.height * up];
        let center = camera.center - origin;
        let reach = radius + center.length();
        let (start, way) = match camera.perspective {
            true => {
                let far = camera.distance() * toward_eye;
                (
                    [center + far, DVec3::ZERO, DVec3::ZERO],
                    [-far, aside[0], aside[1]],
                )
            }
            false => (
                [center + reach * toward_eye, aside[0], aside[1]],
                [-toward_eye, DVec3::ZERO, DVec3::ZERO],
            ),
        };
        let four = |v: DVec3| v.as_vec3().extend(0.0).to_array();
        let [black, white] = look.density;
        Self {
            start: start.map(four),
            way: way.map(four),
            picture: [size[0] as f32, size[1] as f32, count as f32, radius as f32],
            density: [
                black as f32,
                white.max(black + 1e-6 * (1.0 + black.abs())) as f32,
                (3.0 / (DEEP * radius)) as f32,
                STEPS[usize::from(!is_rough)],
            ],
        }
    }
}

impl Record {
    /// Of a solid whose tree begins at a node.
    pub fn new(solid: &Solid, origin: DVec3, root: u32) -> Self {
        let lattice = solid.field.lattice();
        let map = solid.world_from_object * lattice.world_from_lattice;
        let from_world = (DAffine3::from_translation(-origin) * map).inverse();
        let cells = lattice.extent();
        let finest = (1.0 - solid.field.level_count() as f64).exp2();
        let longest = [
            from_world.matrix3.x_axis,
            from_world.matrix3.y_axis,
            from_world.matrix3.z_axis,
        ]
        .map(DVec3::length)
        .into_iter()
        .fold(0.0, f64::max);
        // Far more than numbers of single precision that are as large as the lattice are rounded by.
        let little = f64::max(1e-3 * finest, 4e-7 * cells.max_element()) / longest;
        let hollow = HOLLOW * lattice.world_box().size().length();
        Self {
            lattice_from_world: DMat4::from(from_world).as_mat4().to_cols_array_2d(),
            cells: cells.extend(hollow).as_vec4().to_array(),
            root,
            width: Cube::root(0, solid).width() as f32,
            iso: solid.iso as f32,
            little: little as f32,
            second: match solid.second {
                Some(density) => [density as f32, 1.0, 0.0, 0.0],
                None => [0.0; 4],
            },
        }
    }
}
