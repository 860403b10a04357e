//! The density on the cut: a sheet of the clipping plane through each solid, read from the spline once for each place of the plane.

use std::collections::BTreeMap;

use bspline::{Aabb, Field, Frame};
use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::wgpu::{self, util::DeviceExt};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use rayon::prelude::*;

use crate::view::rays::Solid;

/// Nodes along the longer side of a sheet, while something moves and else.
const NODES: [usize; 2] = [192, 512];
/// Density beside the box of a field.
const OUTSIDE: f32 = -1e30;

/// See `shaders/overlay.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Placed {
    corner: [f32; 4],
    right: [f32; 4],
    down: [f32; 4],
    size: [f32; 4],
}

/// A plane: a place on it, and what way it cuts off.
pub type Plane = (DVec3, DVec3);

/// Densities on a plane through a field, in the field's own world.
struct Sheet {
    /// Its first node, and the ways to the next in a row and to the next row.
    place: [DVec3; 3],
    /// Nodes in a row, and rows.
    size: [usize; 2],
    values: Vec<f32>,
}

impl Sheet {
    /// Over all of a field's box, so many nodes along the longer side; none where the plane does not meet that.
    fn new(field: &(impl Field + ?Sized), within: &Aabb, (at, normal): Plane, nodes: usize) -> Option<Self> {
        let right = normal.any_orthonormal_vector();
        let down = right.cross(normal);
        let corners: [DVec3; 8] = std::array::from_fn(|n| {
            let share = DVec3::from_array([n >> 2, n >> 1 & 1, n & 1].map(|n| n as f64));
            within.min + share * within.size() - at
        });
        let heights = corners.map(|p| p.dot(normal));
        if heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0) {
            return None;
        }
        let flat = corners.map(|p| DVec2::new(p.dot(right), p.dot(down)));
        let low = flat.into_iter().reduce(DVec2::min)?;
        let extent = flat.into_iter().reduce(DVec2::max)? - low;
        let step = extent.max_element() / (nodes - 1) as f64;
        let size = extent.to_array().map(|e| ((e / step).ceil() as usize + 1).max(2));
        let place = [at + low.x * right + low.y * down, step * right, step * down];
        let frame = Frame {
            world_from_grid: DAffine3 {
                matrix3: DMat3::from_cols(place[2], place[1], step * normal),
                translation: place[0],
            },
            cells: [size[1] as u32 - 1, size[0] as u32 - 1, 1],
        };
        let mut values = vec![OUTSIDE; size[0] * size[1]];
        values.par_chunks_mut(size[0]).enumerate().for_each(|(row, out)| {
            let mut densities = vec![0.0; out.len()];
            field.frame_values(&frame, [row as i64, 0, 0], [1, out.len(), 1], &mut densities);
            for (n, (out, density)) in out.iter_mut().zip(densities).enumerate() {
                let p = place[0] + n as f64 * place[1] + row as f64 * place[2];
                if p.cmpge(within.min).all() && p.cmple(within.max).all() {
                    *out = density as f32;
                }
            }
        });
        Some(Self { place, size, values })
    }
}

/// A sheet on the card.
struct Cap {
    of: Plane,
    nodes: usize,
    /// None where the plane does not meet the solid.
    bindings: Option<wgpu::BindGroup>,
}

/// The sheets of all solids.
pub struct Caps {
    layout: wgpu::BindGroupLayout,
    caps: BTreeMap<String, Cap>,
}

impl Caps {
    /// Without any.
    pub fn new(device: &wgpu::Device) -> Self {
        let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty,
            count: None,
        };
        let uniform = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let texture = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("cap"),
            // The numbers before these are the lights'.
            entries: &[
                entry(2, wgpu::ShaderStages::VERTEX_FRAGMENT, uniform),
                entry(3, wgpu::ShaderStages::FRAGMENT, texture),
            ],
        });
        Self {
            layout,
            caps: BTreeMap::new(),
        }
    }

    /// How shaders find one.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.caps.clear();
    }

    /// Forgets that of an object; whether there was one.
    pub fn forget(&mut self, object: &str) -> bool {
        self.caps.remove(object).is_some()
    }

    /// Reads the densities that are not known yet of these solids on a plane.
    pub fn prepare<'a>(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        solids: impl Iterator<Item = (&'a String, &'a Solid)>,
        plane: Plane,
        origin: DVec3,
        is_rough: bool,
    ) {
        let nodes = NODES[usize::from(!is_rough)];
        let mut caps = std::mem::take(&mut self.caps);
        // A solid that is shown no more is forgotten.
        for (name, solid) in solids {
            let known = caps
                .remove(name)
                .filter(|cap| cap.of == plane && cap.nodes >= nodes);
            let cap = known.unwrap_or_else(|| Cap {
                of: plane,
                nodes,
                bindings: self.read(device, queue, solid, plane, origin, nodes),
            });
            self.caps.insert(name.clone(), cap);
        }
    }

    fn read(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        solid: &Solid,
        (at, normal): Plane,
        origin: DVec3,
        nodes: usize,
    ) -> Option<wgpu::BindGroup> {
        let placed = solid.world_from_object;
        let own = (
            placed.inverse().transform_point3(at),
            (placed.matrix3.transpose() * normal).try_normalize()?,
        );
        let sheet = Sheet::new(&solid.field, &solid.field.lattice().world_box(), own, nodes)?;
        let [corner, right, down] = sheet.place;
        let four = |v: DVec3| v.as_vec3().extend(0.0).to_array();
        let [width, height] = sheet.size.map(|n| n as f32);
        let placed = Placed {
            corner: four(placed.transform_point3(corner) - origin),
            right: four(placed.transform_vector3(right)),
            down: four(placed.transform_vector3(down)),
            size: [width, height, solid.iso as f32, 0.0],
        };
        let uniform = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("cap"),
            contents: bytemuck::bytes_of(&placed),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let size = wgpu::Extent3d {
            width: sheet.size[0] as u32,
            height: sheet.size[1] as u32,
            depth_or_array_layers: 1,
        };
        let densities = device.create_texture_with_data(
            queue,
            &wgpu::TextureDescriptor {
                label: Some("cap"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::R32Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            },
            wgpu::util::TextureDataOrder::LayerMajor,
            bytemuck::cast_slice(&sheet.values),
        );
        let view = densities.create_view(&wgpu::TextureViewDescriptor::default());
        Some(device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("cap"),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 2,
                    resource: uniform.as_entire_binding(),
                },
                wgpu::BindGroupEntry {
                    binding: 3,
                    resource: wgpu::BindingResource::TextureView(&view),
                },
            ],
        }))
    }

    /// Draws all of them.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        for bindings in self.caps.values().filter_map(|cap| cap.bindings.as_ref()) {
            pass.set_bind_group(1, bindings, &[]);
            pass.draw(0..6, 0..1);
        }
    }
}

#[cfg(test)]
mod tests {
    use bspline::primitives::Sphere;

    use super::*;

    #[test]
    fn sheets_hold_the_densities_of_their_places() {
        let ball = Sphere::new(DVec3::new(1.0, 2.0, 3.0), 4.0).unwrap();
        let within = Aabb::new(DVec3::splat(-4.0), DVec3::splat(8.0));
        let plane = (DVec3::new(1.0, 2.0, 2.0), DVec3::new(1.0, -2.0, 0.5).normalize());
        let sheet = Sheet::new(&ball, &within, plane, 64).unwrap();
        let [corner, right, down] = sheet.place;
        let mut inside = 0;
        for (n, value) in sheet.values.iter().enumerate() {
            let p = corner + (n % sheet.size[0]) as f64 * right + (n / sheet.size[0]) as f64 * down;
            assert!((p - plane.0).dot(plane.1).abs() < 1e-9);
            if *value > OUTSIDE {
                assert!((ball.value(p) - f64::from(*value)).abs() < 1e-5);
                inside += 1;
            }
        }
        // The plane goes through the box from side to side.
        assert!(inside > sheet.values.len() / 3, "{inside} of {:?}", sheet.size);
        let beyond = (DVec3::splat(9.0), DVec3::X);
        assert!(Sheet::new(&ball, &within, beyond, 64).is_none());
    }
}
