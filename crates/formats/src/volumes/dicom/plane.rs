//! One picture of a series in space.

use glam::DVec3;

use super::dataset::{Attributes, DataSet};
use super::pixels::Rescale;
use crate::Fault;

/// A frame: where it is in the files and in the patient.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    /// Index of the file.
    pub file: u32,
    /// Frame in the file, from 0.
    pub frame: u32,
    /// Centre of the first pixel, LPS, mm.
    pub position: DVec3,
    /// Step from column to column and from row to row, LPS, mm.
    pub steps: [DVec3; 2],
    pub rescale: Rescale,
    /// What tells it from others at the same position, see [`Attributes::order`].
    pub order: [f64; 5],
}

/// Deviation from unit length or a right angle that directions may have: they are written with 6 digits or more.
const SLOPPINESS: f64 = 1e-3;

impl Plane {
    /// Unit normal, the side that rows and columns see as counter-clockwise.
    pub fn normal(&self) -> DVec3 {
        self.steps[0].cross(self.steps[1]).normalize()
    }

    /// A frame of the first file, wherever it lies, with its numbers as they are stored.
    pub fn bare(frame: u32) -> Self {
        Self {
            file: 0,
            frame,
            position: DVec3::ZERO,
            steps: [DVec3::X, DVec3::Y],
            rescale: Rescale::NONE,
            order: [f64::NEG_INFINITY; 5],
        }
    }

    fn of(attributes: &Attributes, file: u32, frame: u32) -> Result<Self, Fault> {
        let missing = |what: &'static str, tag: &str| Fault::Value {
            what,
            value: format!("missing {tag}"),
            remedy: "without it the picture has no place in space; export the series again with its geometry, or \
                     move such pictures (localizers, reports) to another directory",
        };
        let position = attributes
            .position
            .ok_or_else(|| missing("the position of a picture", "(0020,0032)"))?;
        let [a, b, c, d, e, f] = attributes
            .orientation
            .ok_or_else(|| missing("the orientation of a picture", "(0020,0037)"))?;
        let (row, column) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
        let is_unit = |v: DVec3| (v.length() - 1.0).abs() < SLOPPINESS;
        if !is_unit(row) || !is_unit(column) || row.dot(column).abs() > SLOPPINESS {
            return Err(Fault::Value {
                what: "the orientation of a picture",
                value: format!("({row}, {column}), which are no two unit vectors at a right angle"),
                remedy: "the header is damaged; export the series again",
            });
        }
        let [between_rows, between_columns] = attributes
            .spacing
            .ok_or_else(|| missing("the spacing of the pixels", "(0028,0030)"))?;
        let usable = |s: f64| (1e-6..1e6).contains(&s);
        if !usable(between_rows) || !usable(between_columns) {
            return Err(Fault::Value {
                what: "the spacing of the pixels",
                value: format!("{between_rows} x {between_columns} mm"),
                remedy: "both are above 0; export the series again",
            });
        }
        let position = DVec3::from_array(position);
        if position.abs().max_element() > 1e9 {
            return Err(Fault::Value {
                what: "the position of a picture",
                value: format!("{position}"),
                remedy: "the header is damaged; export the series again",
            });
        }
        let rescale = Rescale {
            slope: attributes.slope.unwrap_or(1.0),
            intercept: attributes.intercept.unwrap_or(0.0),
        };
        let magnitude = rescale.slope.abs();
        if !(1e-25..1e25).contains(&magnitude) || rescale.intercept.abs() > 1e30 {
            return Err(Fault::Value {
                what: "the rescaling of a picture (slope, intercept)",
                value: format!("{}, {}", rescale.slope, rescale.intercept),
                remedy: "a slope is not 0 and neither is out of proportion; export the series again",
            });
        }
        Ok(Self {
            file,
            frame,
            position,
            // The spacing between columns is the step along a row, and the second of the two.
            steps: [row * between_columns, column * between_rows],
            rescale,
            order: attributes.order.map(|n| n.unwrap_or(f64::NEG_INFINITY)),
        })
    }
}

/// The planes of one file.
///
/// # Errors
/// [`Fault::Value`] if one has no place in space.
pub(super) fn of_file(data: &DataSet, file: u32, frame_count: u32) -> Result<Vec<Plane>, Fault> {
    if frame_count == 1 && data.frames.len() <= 1 {
        let attributes = match data.frames.first() {
            Some(own) => own.or(&data.common),
            None => data.common.clone(),
        };
        return Ok(vec![Plane::of(&attributes, file, 0)?]);
    }
    if !data.frames.is_empty() {
        if data.frames.len() != frame_count as usize {
            return Err(Fault::Value {
                what: "the number of frames",
                value: format!("{frame_count}, with positions of {}", data.frames.len()),
                remedy: "the header is damaged; export the series again",
            });
        }
        let frames = data.frames.iter().enumerate();
        return frames
            .map(|(i, own)| Plane::of(&own.or(&data.common), file, i as u32))
            .collect();
    }
    // Dose grids and nuclear medicine place the first frame and say how far the others are along the normal.
    let first = Plane::of(&data.common, file, 0)?;
    let normal = first.normal();
    let offset = |i: u32| match (data.grid_offsets.get(i as usize), data.common.between_slices) {
        (Some(offset), _) if data.grid_offsets.len() == frame_count as usize => {
            // The first is 0; otherwise they are coordinates along the normal (PS3.3, C.8.8.3.2).
            Some(offset - data.grid_offsets[0])
        }
        (_, Some(step)) if step != 0.0 => Some(step * f64::from(i)),
        _ => None,
    };
    (0..frame_count)
        .map(|i| {
            let offset = offset(i).ok_or_else(|| Fault::Value {
                what: "the positions of the frames",
                value: format!("missing for {frame_count} frames"),
                remedy: "films and old multi-frame files do not say where their frames are; export the series as \
                         one file a slice, or as an enhanced multi-frame file",
            })?;
            Ok(Plane {
                frame: i,
                position: first.position + normal * offset,
                ..first.clone()
            })
        })
        .collect()
}
