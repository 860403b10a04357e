//! Typed views into buffers, every promise checked against the bytes there are.

use super::json::{Accessor, Root};
use crate::Fault;
use crate::error::Place;

/// Type of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

/// A checked accessor.
#[derive(Debug)]
pub(super) struct View<'a> {
    bytes: &'a [u8],
    stride: usize,
    component: Component,
    normalized: bool,
    pub count: usize,
    pub width: usize,
}

fn bad(index: u32, what: impl Into<String>, remedy: &'static str) -> Fault {
    Fault::Syntax {
        place: Place::Row("accessor", u64::from(index)),
        what: what.into(),
        remedy,
    }
}

impl<'a> View<'a> {
    pub fn new(root: &Root, buffers: &'a [Vec<u8>], index: u32) -> Result<Self, Fault> {
        const EXPORT: &str = "the document contradicts itself; export the file again";
        let accessor: &Accessor = root.accessors.get(index as usize).ok_or_else(|| {
            bad(
                index,
                format!("the document has {}", root.accessors.len()),
                EXPORT,
            )
        })?;
        if accessor.sparse.is_some() {
            return Err(bad(
                index,
                "it is sparse",
                "sparse accessors are not read; export without them",
            ));
        }
        let component = match accessor.component_type {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            other => {
                return Err(bad(
                    index,
                    format!("component type {other}"),
                    "5120 to 5126 without 5124 are known",
                ));
            }
        };
        let width = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => return Err(bad(index, "it is neither scalar nor vector", EXPORT)),
        };
        let view = accessor.buffer_view.ok_or_else(|| {
            bad(
                index,
                "it has no buffer view",
                "its values are compressed or left out; export without compression",
            )
        })?;
        let view = root.buffer_views.get(view as usize).ok_or_else(|| {
            bad(
                index,
                format!("buffer view {view} of {}", root.buffer_views.len()),
                EXPORT,
            )
        })?;
        let buffer = buffers.get(view.buffer as usize).ok_or_else(|| {
            bad(
                index,
                format!("buffer {} of {}", view.buffer, buffers.len()),
                EXPORT,
            )
        })?;
        let size = (component.size() * width) as u64;
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size || stride > 252.max(size) {
            return Err(bad(
                index,
                format!("a stride of {stride} bytes for {size}"),
                EXPORT,
            ));
        }
        let needed = match accessor.count {
            0 => 0,
            n => (n - 1)
                .saturating_mul(stride)
                .saturating_add(size)
                .saturating_add(accessor.byte_offset),
        };
        let end = view.byte_offset.saturating_add(view.byte_length);
        if needed > view.byte_length || end > buffer.len() as u64 {
            return Err(Fault::Truncated {
                what: format!("accessor {index} in a view of {} bytes", view.byte_length),
                needed: needed.max(end),
                found: buffer.len() as u64,
            });
        }
        let start = (view.byte_offset + accessor.byte_offset.min(view.byte_length)) as usize;
        Ok(Self {
            bytes: &buffer[start..end as usize],
            stride: stride as usize,
            component,
            normalized: accessor.normalized,
            count: accessor.count as usize,
            width,
        })
    }

    /// Component `c` of element `i`, both below their counts.
    pub fn at(&self, i: usize, c: usize) -> f64 {
        let b = &self.bytes[i * self.stride + c * self.component.size()..];
        let (value, top) = match self.component {
            Component::I8 => (f64::from(b[0] as i8), 127.0),
            Component::U8 => (f64::from(b[0]), 255.0),
            Component::I16 => (f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            Component::U16 => (f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            Component::U32 => (
                f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
                4294967295.0,
            ),
            Component::F32 => return f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        };
        if self.normalized {
            (value / top).max(-1.0)
        } else {
            value
        }
    }

    /// Whether this can be a list of indices.
    pub fn is_whole(&self) -> bool {
        self.width == 1
            && !self.normalized
            && matches!(self.component, Component::U8 | Component::U16 | Component::U32)
    }
}

impl Component {
    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}
