//! Points of a LAS file.

use super::Layout;
use super::rows::Rows;
use crate::points::las::header::{u16_at, u32_at, u64_at};

/// None where they are compressed, or records follow them, which may tell the unit.
pub fn layout(head: &[u8]) -> Option<Layout> {
    // What is no header is told when all of it is read.
    if head.len() < 375 || head[104] & 0xc0 != 0 {
        return None;
    }
    let is_1_4 = head[25] >= 4;
    if is_1_4 && u32_at(head, 243) > 0 {
        return None;
    }
    let long = if is_1_4 { u64_at(head, 247) } else { 0 };
    let count = if long > 0 {
        long
    } else {
        u64::from(u32_at(head, 107))
    };
    let (start, stride) = (u64::from(u32_at(head, 96)), u64::from(u16_at(head, 105)));
    let before = head.get(..start as usize)?.to_vec();
    if stride == 0 {
        return None;
    }
    Some(Layout {
        rows: Rows {
            start,
            end: start.checked_add(count.checked_mul(stride)?)?,
            stride: Some(stride),
        },
        count: Some(count),
        faces: 0,
        head: Box::new(move |count| {
            let mut bytes = before.clone();
            bytes[107..111].copy_from_slice(&(count as u32).to_le_bytes());
            if is_1_4 {
                bytes[247..255].copy_from_slice(&count.to_le_bytes());
            }
            bytes
        }),
    })
}
