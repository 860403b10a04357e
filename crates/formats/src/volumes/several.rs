//! One volume out of a file that holds several: time steps, echoes, channels.

use super::geometry::checked_dims;
use super::slices::{SliceSource, zeros};
use super::volume::VolumeHeader;
use crate::{Choice, Fault};

/// Which volume of how many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Several {
    pub count: usize,
    /// From 0.
    pub number: usize,
    /// Whether the numbers of a voxel stand together, else a volume follows the other.
    pub is_interleaved: bool,
}

impl Several {
    /// Number `wanted` of `count` volumes, one after the other; `None` where there is one.
    ///
    /// # Errors
    /// [`Fault::Choose`] if there are several and none is wanted, [`Fault::Value`] for a number that is not there.
    pub fn choose(count: u64, wanted: Option<usize>) -> Result<Option<Self>, Fault> {
        let number = match wanted {
            Some(n) if (n as u64) < count => n,
            Some(n) => {
                return Err(Fault::Value {
                    what: "the number of the volume",
                    value: format!("{n} of {count}"),
                    remedy: "volumes are counted from 0",
                });
            }
            None if count == 1 => 0,
            None => {
                return Err(Fault::Choose {
                    what: "the number of volumes in the file",
                    value: count.to_string(),
                    remedy: "a time series, echoes or channels: choose one volume by its number, counted from 0",
                    choice: Choice::Volume,
                });
            }
        };
        let several = Self {
            count: usize::try_from(count).unwrap_or(usize::MAX),
            number,
            is_interleaved: false,
        };
        Ok((count > 1).then_some(several))
    }

    /// Numbers along x, y and z of the whole file, for the dimensions of one volume.
    pub fn file_dims(&self, dims: [usize; 3]) -> Result<[usize; 3], Fault> {
        let axis = if self.is_interleaved { 0 } else { 2 };
        let mut dims = dims.map(|n| i64::try_from(n).unwrap_or(i64::MAX));
        dims[axis] = dims[axis].saturating_mul(i64::try_from(self.count).unwrap_or(i64::MAX));
        checked_dims(dims)
    }

    /// Header of all numbers of the file, for the header of one volume.
    pub fn file_header(&self, header: &VolumeHeader) -> Result<VolumeHeader, Fault> {
        Ok(VolumeHeader {
            dims: self.file_dims(header.dims)?,
            ..header.clone()
        })
    }

    /// What a user reads about it.
    pub fn note(&self) -> String {
        format!("volume {} of {}, counted from 0", self.number, self.count)
    }
}

/// The slices of one volume out of those of a whole file.
pub(super) struct OneOf<'a> {
    inner: Box<dyn SliceSource + 'a>,
    header: VolumeHeader,
    which: Several,
    /// A slice of `inner`, where that is wider.
    scratch: Vec<f32>,
    is_there: bool,
}

impl<'a> OneOf<'a> {
    /// `inner` has the header that [`Several::file_header`] gives for `header`.
    pub fn new(inner: Box<dyn SliceSource + 'a>, header: VolumeHeader, which: Several) -> Self {
        Self {
            inner,
            header,
            which,
            scratch: Vec::new(),
            is_there: which.is_interleaved,
        }
    }

    fn inner_slice(&self) -> usize {
        self.inner.header().dims[0] * self.inner.header().dims[1]
    }

    /// Passes over the volumes before.
    fn go_there(&mut self) -> Result<(), Fault> {
        if !self.is_there {
            for _ in 0..self.which.number * self.header.dims[2] {
                self.inner.skip_slice()?;
            }
            self.is_there = true;
        }
        Ok(())
    }
}

impl SliceSource for OneOf<'_> {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn notes(&mut self) -> Vec<String> {
        self.inner.notes()
    }

    fn next_slice(&mut self, out: &mut [f32]) -> Result<(), Fault> {
        self.go_there()?;
        if !self.which.is_interleaved {
            return self.inner.next_slice(out);
        }
        if self.scratch.is_empty() {
            self.scratch = zeros(self.inner_slice(), u64::MAX)?;
        }
        self.inner.next_slice(&mut self.scratch)?;
        let mine = self
            .scratch
            .iter()
            .skip(self.which.number)
            .step_by(self.which.count);
        out.iter_mut().zip(mine).for_each(|(o, v)| *o = *v);
        Ok(())
    }

    fn skip_slice(&mut self) -> Result<(), Fault> {
        self.go_there()?;
        self.inner.skip_slice()
    }

    fn working_bytes(&self) -> u64 {
        let scratch = if self.which.is_interleaved {
            self.inner_slice() as u64 * 4
        } else {
            0
        };
        self.inner.working_bytes().saturating_add(scratch)
    }

    fn may_have_gaps(&self) -> bool {
        self.inner.may_have_gaps()
    }

    fn finish(&mut self) -> Result<(), Fault> {
        if !self.which.is_interleaved {
            // Text has to be read to be passed over.
            for _ in (self.which.number + 1) * self.header.dims[2]..self.inner.header().dims[2] {
                self.inner.skip_slice()?;
            }
        }
        self.inner.finish()
    }
}
