//! A box of voxels and a stride of any source, as a source.

use glam::{DAffine3, DMat3, DVec3};

use super::geometry::is_usable;
use super::options::VolumeOptions;
use super::slices::{SliceSource, zeros};
use super::volume::VolumeHeader;
use crate::{Fault, Unit};

/// The part of `inner` that the options ask for.
pub(super) struct Part<'a> {
    inner: Box<dyn SliceSource + 'a>,
    header: VolumeHeader,
    first: [usize; 3],
    stride: [usize; 3],
    /// A slice of `inner`, where that is more than what is taken of it.
    scratch: Option<Vec<f32>>,
    /// Slices of `inner` that are behind.
    passed: usize,
    /// Slices that were given.
    given: usize,
}

impl<'a> Part<'a> {
    pub fn new(inner: Box<dyn SliceSource + 'a>, options: &VolumeOptions) -> Result<Self, Fault> {
        let mut header = inner.header().clone();
        if let Some(spacing) = options.spacing_mm {
            state_spacing(&mut header, spacing)?;
        }
        let dims = header.dims;
        let region = options.region.unwrap_or_else(|| dims.map(|n| [0, n]));
        let is_box = (0..3).all(|a| region[a][0] < region[a][1] && region[a][1] <= dims[a]);
        if !is_box {
            return Err(Fault::Value {
                what: "the region",
                value: format!("{region:?} of {dims:?} voxels"),
                remedy: "each axis has a first voxel and a later end, at most the number of voxels",
            });
        }
        if options.stride.contains(&0) {
            return Err(Fault::Value {
                what: "the stride",
                value: format!("{:?}", options.stride),
                remedy: "it is at least 1 along each axis; 1 takes every voxel",
            });
        }
        let (first, stride) = (region.map(|[from, _]| from), options.stride);
        header.dims = std::array::from_fn(|a| (region[a][1] - first[a]).div_ceil(stride[a]));
        if first != [0; 3] || stride != [1; 3] {
            let map = header.world_from_voxel;
            let step = DVec3::from_array(stride.map(|n| n as f64));
            header.world_from_voxel = DAffine3 {
                matrix3: map.matrix3 * DMat3::from_diagonal(step),
                translation: map.transform_point3(DVec3::from_array(first.map(|n| n as f64))),
            };
            if !is_usable(&header.world_from_voxel) {
                return Err(Fault::Value {
                    what: "the stride",
                    value: format!("{stride:?}"),
                    remedy: "the distance between the voxels taken is beyond all bounds; take a smaller one",
                });
            }
        }
        let is_whole_slice = header.dims[..2] == dims[..2];
        Ok(Self {
            scratch: (!is_whole_slice).then(Vec::new),
            inner,
            header,
            first,
            stride,
            passed: 0,
            given: 0,
        })
    }

    /// Slice of `inner` that is the next one here.
    fn pass_to_next(&mut self) -> Result<(), Fault> {
        let next = self.first[2] + self.given * self.stride[2];
        self.given += 1;
        while self.passed < next {
            self.inner.skip_slice()?;
            self.passed += 1;
        }
        self.passed += 1;
        Ok(())
    }

    fn inner_slice(&self) -> usize {
        self.inner.header().dims[0] * self.inner.header().dims[1]
    }
}

/// Replaces the lengths of the axes.
fn state_spacing(header: &mut VolumeHeader, spacing: [f64; 3]) -> Result<(), Fault> {
    let map = &mut header.world_from_voxel;
    let [x, y, z] = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(DVec3::normalize);
    map.matrix3 = DMat3::from_cols(x * spacing[0], y * spacing[1], z * spacing[2]);
    header.unit = Unit::Millimetre;
    if spacing.iter().any(|s| *s <= 0.0) || !is_usable(map) {
        return Err(Fault::Value {
            what: "the stated spacing",
            value: format!("{spacing:?}"),
            remedy: "give three finite lengths above 0 in millimetres",
        });
    }
    Ok(())
}

impl SliceSource for Part<'_> {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn notes(&mut self) -> Vec<String> {
        self.inner.notes()
    }

    fn next_slice(&mut self, out: &mut [f32]) -> Result<(), Fault> {
        self.pass_to_next()?;
        let slice = self.inner_slice();
        let Some(scratch) = &mut self.scratch else {
            return self.inner.next_slice(out);
        };
        if scratch.is_empty() {
            *scratch = zeros(slice, u64::MAX)?;
        }
        self.inner.next_slice(scratch)?;
        let (nx, [x0, y0, _], [sx, sy, _]) = (self.inner.header().dims[0], self.first, self.stride);
        for (y, row) in out.chunks_exact_mut(self.header.dims[0]).enumerate() {
            let from = &scratch[nx * (y0 + y * sy) + x0..nx * (y0 + y * sy + 1)];
            for (value, taken) in row.iter_mut().zip(from.iter().step_by(sx)) {
                *value = *taken;
            }
        }
        Ok(())
    }

    fn skip_slice(&mut self) -> Result<(), Fault> {
        self.pass_to_next()?;
        self.inner.skip_slice()
    }

    fn working_bytes(&self) -> u64 {
        let scratch = if self.scratch.is_some() {
            self.inner_slice() as u64 * 4
        } else {
            0
        };
        self.inner.working_bytes().saturating_add(scratch)
    }

    fn may_have_gaps(&self) -> bool {
        self.inner.may_have_gaps()
    }

    /// Also passes over what follows the region: damage there is found as in a whole reading.
    fn finish(&mut self) -> Result<(), Fault> {
        while self.passed < self.inner.header().dims[2] {
            self.inner.skip_slice()?;
            self.passed += 1;
        }
        self.inner.finish()
    }
}
