//! Bricks on the card, as many as there is room for.

use std::collections::HashMap;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, BRICK_LEN, HALO, HALO_LEN};
use eframe::egui_wgpu::wgpu;
use rayon::prelude::*;
use rustc_hash::FxBuildHasher;

use super::cube::Totals;

/// Cells of a brick.
const CELLS: usize = BRICK_LEN;
/// Numbers that the card has of a brick: its coefficients, the ranges of its cells, two in each, and its own.
const RECORD: usize = HALO_LEN + CELLS / 2 + 2;
/// Bytes of them.
pub const RECORD_BYTES: u64 = (RECORD * size_of::<f32>()) as u64;

/// A brick on the card.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    /// Which.
    pub number: u32,
    /// Its least and its largest coefficient.
    pub range: [f32; 2],
}

/// Bricks on the card.
pub struct Atlas {
    device: wgpu::Device,
    queue: wgpu::Queue,
    most: usize,
    buffer: wgpu::Buffer,
    capacity: usize,
    /// By the address of their numbers, which they keep from being another's.
    held: HashMap<usize, (Slot, Totals), FxBuildHasher>,
    free: Vec<u32>,
}

impl Atlas {
    /// With room for so many bytes, or as many as the card lets a picture read.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, budget: u64) -> Self {
        let limits = device.limits();
        let most = budget
            .min(limits.max_storage_buffer_binding_size)
            .min(limits.max_buffer_size);
        Self {
            most: ((most / RECORD_BYTES) as usize).max(1),
            buffer: buffer(device, 1),
            capacity: 1,
            held: HashMap::default(),
            free: vec![0],
            device: device.clone(),
            queue: queue.clone(),
        }
    }

    /// Bricks that there is room for.
    pub fn most(&self) -> usize {
        self.most
    }

    /// Whether a brick is there.
    pub fn has(&self, totals: &Totals) -> bool {
        self.held.contains_key(&address(totals))
    }

    /// All of it.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Holds these bricks, [`most`](Self::most) at most, and no others; where they are. There will be `soon` of them before long.
    pub fn hold(&mut self, bricks: &[&Totals], soon: usize) -> Vec<Slot> {
        if bricks.len() > self.capacity {
            // Some more than needed, so that edits find room; never two buffers at once.
            self.capacity = (soon.max(bricks.len()) * 9 / 8).min(self.most);
            self.buffer.destroy();
            self.buffer = buffer(&self.device, self.capacity);
            self.held.clear();
            self.free = (0..self.capacity as u32).rev().collect();
        }
        let wanted: std::collections::HashSet<usize, FxBuildHasher> =
            bricks.iter().map(|totals| address(totals)).collect();
        let free = &mut self.free;
        self.held.retain(|address, (slot, _)| {
            let is_kept = wanted.contains(address);
            if !is_kept {
                free.push(slot.number);
            }
            is_kept
        });
        self.free.sort_unstable_by(|a, b| b.cmp(a));
        let mut new: Vec<&Totals> = bricks.iter().copied().filter(|t| !self.has(t)).collect();
        new.sort_unstable_by_key(|totals| address(totals));
        new.dedup_by_key(|totals| address(totals));
        let records: Vec<(Vec<u32>, [f32; 2])> = new.par_iter().map(|totals| record(totals)).collect();
        for (totals, (record, range)) in new.into_iter().zip(records) {
            let number = self.free.pop().expect("there is room for all that are wanted");
            let at = u64::from(number) * RECORD_BYTES;
            self.queue
                .write_buffer(&self.buffer, at, bytemuck::cast_slice(&record));
            let slot = Slot { number, range };
            self.held.insert(address(totals), (slot, totals.clone()));
        }
        // Copies on their way need memory until then.
        self.queue.submit([]);
        let slot = |totals: &&Totals| self.held[&address(totals)].0;
        bricks.iter().map(slot).collect()
    }
}

fn address(totals: &Totals) -> usize {
    Arc::as_ptr(totals).cast::<u8>() as usize
}

fn buffer(device: &wgpu::Device, bricks: usize) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("bricks"),
        size: bricks as u64 * RECORD_BYTES,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// What the card has of a brick, see `shaders/rays.wgsl`, and the range of its coefficients.
fn record(totals: &Totals) -> (Vec<u32>, [f32; 2]) {
    const MOST: f32 = 255.0;
    let [low, high] = range(totals.iter().copied());
    // Rounding, and that of the sums that evaluate it, stays below this.
    let slack = 1e-5 * low.abs().max(high.abs()).max(f32::MIN_POSITIVE);
    let (least, span) = (low - slack, high - low + 2.0 * slack);
    let share = |x: f32| (x - least) / span * MOST;
    let of_cell = |cell: usize| {
        let at = [cell / (BRICK * BRICK), cell / BRICK % BRICK, cell % BRICK];
        let rows = (0..4).flat_map(|i| (0..4).map(move |j| ((at[0] + i) * HALO + at[1] + j) * HALO + at[2]));
        let [low, high] = range(rows.flat_map(|row| totals[row..row + 4].iter().copied()));
        let low = (share(low - slack) - 0.1).floor().clamp(0.0, MOST) as u32;
        let high = (share(high + slack) + 0.1).ceil().clamp(0.0, MOST) as u32;
        low | high << 8
    };
    let mut record: Vec<u32> = totals.iter().map(|total| total.to_bits()).collect();
    record.extend(
        (0..CELLS)
            .step_by(2)
            .map(|cell| of_cell(cell) | of_cell(cell + 1) << 16),
    );
    record.extend([least, span].map(f32::to_bits));
    (record, [least, least + span])
}

fn range(numbers: impl Iterator<Item = f32>) -> [f32; 2] {
    numbers.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| {
        [if x < low { x } else { low }, if x > high { x } else { high }]
    })
}
