//! Triangles on the card.

use std::cell::OnceCell;
use std::ops::Range;

use eframe::egui_wgpu::wgpu::{self, util::DeviceExt};

use super::overlay::{Lines, edges};
use super::shape::Patch;

/// Those of a patch.
pub struct Held {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    /// Which of these are drawn while something moves, and where nothing does.
    ranges: [Range<u32>; 2],
    /// Whether no whole picture has shown them yet: what a stroke does is seen at once.
    is_fresh: bool,
    /// The same, to be coloured otherwise and for their sides.
    pub patch: Patch,
    /// Whether anything is painted on them.
    pub is_painted: bool,
    wires: OnceCell<Lines>,
}

impl Held {
    /// Of a patch, with what colours tell in place of its paint.
    pub fn new(device: &wgpu::Device, patch: &Patch, tinted: Option<&Patch>) -> Self {
        let shown = tinted.unwrap_or(patch);
        let [whole, rough] = [&patch.indices, &patch.rough].map(|indices| indices.len() as u32);
        let moving = if rough == 0 {
            0..whole
        } else {
            whole..whole + rough
        };
        let buffer = |label, contents: &[u8], usage| {
            let contents = wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            };
            device.create_buffer_init(&contents)
        };
        let indices = [&patch.indices[..], &patch.rough].concat();
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
            patch: patch.clone(),
            wires: OnceCell::new(),
        }
    }

    fn range(&self, which: usize) -> Range<u32> {
        self.ranges[which.max(usize::from(self.is_fresh))].clone()
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

/// Draws triangles, all (1) or those for where something moves (0), as a light, or whoever looks, sees them.
pub fn draw<'a>(
    all: impl IntoIterator<Item = &'a Held>,
    which: usize,
    pass: &mut wgpu::RenderPass<'_>,
    instance: u32,
) {
    for held in all {
        pass.set_vertex_buffer(0, held.vertices.slice(..));
        pass.set_index_buffer(held.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(held.range(which), 0, instance..instance + 1);
    }
}
