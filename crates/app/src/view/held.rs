//! Triangles on the card.

use std::cell::OnceCell;
use std::ops::Range;

use bspline::Aabb;
use eframe::egui_wgpu::wgpu::{self, util::DeviceExt};
use glam::{DVec3, Vec3};

use super::overlay::{Lines, edges};
use super::shape::Patch;

/// Those of a patch.
pub struct Held {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    /// Which of these are the coarser ones, and the finer ones.
    ranges: [Range<u32>; 2],
    /// Whether no whole picture has shown them yet: what a stroke does is seen at once.
    is_fresh: bool,
    /// The same, to be coloured otherwise and for their sides.
    pub patch: Patch,
    /// A box round them, from the origin of the picture.
    pub within: Aabb,
    /// Whether anything is painted on them.
    pub is_painted: bool,
    wires: OnceCell<Lines>,
}

impl Held {
    /// Of a patch, with what colours tell in place of its paint.
    pub fn new(device: &wgpu::Device, patch: &Patch, tinted: Option<&Patch>) -> Self {
        let shown = tinted.unwrap_or(patch);
        let whole = patch.indices.len() as u32;
        let indices = [&patch.indices[..], patch.rough.as_deref().unwrap_or_default()].concat();
        let moving = match &patch.rough {
            Some(_) => whole..indices.len() as u32,
            None => 0..whole,
        };
        let buffer = |label, contents: &[u8], usage| {
            let contents = wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            };
            device.create_buffer_init(&contents)
        };
        Self {
            vertices: buffer(
                "vertices",
                bytemuck::cast_slice(&shown.vertices),
                wgpu::BufferUsages::VERTEX,
            ),
            indices: buffer(
                "indices",
                bytemuck::cast_slice(&indices),
                wgpu::BufferUsages::INDEX,
            ),
            ranges: [moving, 0..whole],
            is_fresh: true,
            is_painted: shown.vertices.iter().any(|v| v.paint != 0.0),
            within: Aabb::about(patch.vertices.iter().map(|v| Vec3::from(v.at).as_dvec3()))
                .unwrap_or(Aabb::new(DVec3::ZERO, DVec3::ZERO)),
            patch: patch.clone(),
            wires: OnceCell::new(),
        }
    }

    /// Those that are drawn while something moves (0), or where nothing does (1).
    pub fn seen(&self, which: usize) -> Range<u32> {
        self.ranges[which.max(usize::from(self.is_fresh))].clone()
    }

    /// Those that do where a little does not matter.
    pub fn coarse(&self) -> Range<u32> {
        self.ranges[0].clone()
    }

    /// A whole picture has shown them.
    pub fn was_seen(&mut self) {
        self.is_fresh = false;
    }

    /// How many there are where nothing moves.
    pub fn triangles(&self) -> usize {
        self.ranges[1].len() / 3
    }

    /// Bytes on the card.
    pub fn bytes(&self) -> u64 {
        self.vertices.size() + self.indices.size()
    }

    /// Sides of the triangles.
    pub fn wires(&self, device: &wgpu::Device) -> &Lines {
        self.wires.get_or_init(|| Lines::new(device, &edges(&self.patch)))
    }
}

/// Draws those triangles of patches that `which` tells, as a light, or whoever looks, sees them.
pub fn draw<'a>(
    all: impl IntoIterator<Item = &'a Held>,
    which: impl Fn(&Held) -> Range<u32>,
    pass: &mut wgpu::RenderPass<'_>,
    instance: u32,
) {
    for held in all {
        pass.set_vertex_buffer(0, held.vertices.slice(..));
        pass.set_index_buffer(held.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(which(held), 0, instance..instance + 1);
    }
}
