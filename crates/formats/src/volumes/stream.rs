//! Voxels as they lie in a stream of bytes, slice by slice.

use std::io::Read;

use super::slices::SliceSource;
use super::volume::VolumeHeader;
use super::voxel::VoxelType;
use crate::Fault;
use crate::input::{SkipRead, read_fault};

/// Bytes read at a time: small enough to stay in the second-level cache. A multiple of every voxel's size.
pub(super) const BUFFER: usize = 1 << 17;

/// A source whose voxels follow each other in a stream, without gaps.
pub(super) struct StreamSlices<'a> {
    header: VolumeHeader,
    notes: Vec<String>,
    big_endian: bool,
    source: Box<dyn SkipRead + 'a>,
    buffer: Vec<u8>,
    /// Bytes of `buffer` that are read and not yet given.
    ready: std::ops::Range<usize>,
    /// Bytes of voxels that the stream still has to give.
    left: u64,
}

impl<'a> StreamSlices<'a> {
    /// `source` stands at the first voxel.
    pub fn new(
        header: VolumeHeader,
        notes: Vec<String>,
        big_endian: bool,
        source: Box<dyn SkipRead + 'a>,
    ) -> Self {
        Self {
            left: stored_bytes(&header),
            header,
            notes,
            big_endian,
            source,
            buffer: Vec::new(),
            ready: 0..0,
        }
    }

    fn refill(&mut self) -> Result<(), Fault> {
        if self.buffer.is_empty() {
            self.buffer = vec![0; BUFFER];
        }
        let want = (BUFFER as u64).min(self.left) as usize;
        let mut got = 0;
        while got < want {
            match self.source.read(&mut self.buffer[got..want]) {
                Ok(0) => return Err(self.cut(got as u64)),
                Ok(n) => got += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(read_fault(e)),
            }
        }
        self.left -= want as u64;
        self.ready = 0..want;
        Ok(())
    }

    fn cut(&self, got: u64) -> Fault {
        let needed = stored_bytes(&self.header);
        Fault::Truncated {
            what: "the voxels".into(),
            needed,
            found: needed - self.left + got,
        }
    }
}

/// Bytes of all voxels in the file.
pub(super) fn stored_bytes(header: &VolumeHeader) -> u64 {
    header.voxel_count() as u64 * header.stored.size() as u64
}

/// Refuses a file that cannot hold the voxels, before anything is reserved for them; `found` bytes may be there.
pub(super) fn check_length(header: &VolumeHeader, found: u64) -> Result<(), Fault> {
    let needed = stored_bytes(header);
    if needed <= found {
        return Ok(());
    }
    let [x, y, z] = header.dims;
    Err(Fault::Truncated {
        what: format!("{x} x {y} x {z} voxels of {}", header.stored),
        needed,
        found,
    })
}

/// Passes over `count` bytes that have to be there.
pub(super) fn skip(source: &mut (impl SkipRead + ?Sized), count: u64) -> Result<(), Fault> {
    let skipped = source.skip(count).map_err(read_fault)?;
    if skipped < count {
        return Err(Fault::Truncated {
            what: "the part between header and voxels".into(),
            needed: count,
            found: skipped,
        });
    }
    Ok(())
}

impl SliceSource for StreamSlices<'_> {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    fn next_slice(&mut self, mut out: &mut [f32]) -> Result<(), Fault> {
        let size = self.header.stored.size();
        while !out.is_empty() {
            if self.ready.is_empty() {
                self.refill()?;
            }
            let count = (self.ready.len() / size).min(out.len());
            let (now, later) = out.split_at_mut(count);
            let raw = &self.buffer[self.ready.start..self.ready.start + count * size];
            if self.big_endian {
                convert::<true>(raw, self.header.stored, self.header.rescale, now);
            } else {
                convert::<false>(raw, self.header.stored, self.header.rescale, now);
            }
            self.ready.start += count * size;
            out = later;
        }
        Ok(())
    }

    fn skip_slice(&mut self) -> Result<(), Fault> {
        let slice = (self.header.dims[0] * self.header.dims[1]) as u64 * self.header.stored.size() as u64;
        let held = slice.min(self.ready.len() as u64);
        self.ready.start += held as usize;
        let skipped = self.source.skip(slice - held).map_err(read_fault)?;
        if skipped < slice - held {
            return Err(self.cut(skipped));
        }
        self.left -= skipped;
        Ok(())
    }

    fn working_bytes(&self) -> u64 {
        BUFFER as u64
    }

    /// A compressed stream is checked against its checksum when its end is met, so goes and meets it.
    fn finish(&mut self) -> Result<(), Fault> {
        self.buffer.resize(BUFFER, 0);
        while self.source.read(&mut self.buffer).map_err(read_fault)? > 0 {}
        Ok(())
    }
}

/// Voxels of `raw` as densities; rescaling is done in double precision. `out` has one value a voxel.
pub(super) fn convert<const BIG: bool>(
    raw: &[u8],
    stored: VoxelType,
    rescale: Option<[f64; 2]>,
    out: &mut [f32],
) {
    macro_rules! each {
        ($t:ty) => {{
            let voxels = raw.chunks_exact(size_of::<$t>()).map(|b| {
                let b = b.try_into().expect("chunks of this size");
                if BIG {
                    <$t>::from_be_bytes(b)
                } else {
                    <$t>::from_le_bytes(b)
                }
            });
            match rescale {
                None => out.iter_mut().zip(voxels).for_each(|(o, v)| *o = v as f32),
                Some([slope, intercept]) => out
                    .iter_mut()
                    .zip(voxels)
                    .for_each(|(o, v)| *o = (v as f64 * slope + intercept) as f32),
            }
        }};
    }
    match stored {
        VoxelType::U8 => each!(u8),
        VoxelType::I8 => each!(i8),
        VoxelType::U16 => each!(u16),
        VoxelType::I16 => each!(i16),
        VoxelType::U32 => each!(u32),
        VoxelType::I32 => each!(i32),
        VoxelType::U64 => each!(u64),
        VoxelType::I64 => each!(i64),
        VoxelType::F32 => each!(f32),
        VoxelType::F64 => each!(f64),
    }
}
