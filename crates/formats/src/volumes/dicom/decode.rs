//! Frames out of files, one at a time.

use super::check::layout_of;
use super::codec::{self, Shape};
use super::dataset::reopen;
use super::fragments::Fragments;
use super::pixels::{Layout, convert};
use super::plane::Plane;
use super::scan::File;
use super::stream::Stream;
use super::syntax::Codec;
use crate::Fault;
use crate::foreign::guarded;
use crate::limits::Budget;

/// Reads frames; keeps the file open that it read last.
pub(super) struct Decoder {
    sources: Vec<Source>,
    open: Option<(u32, Stream)>,
    compressed: Vec<u8>,
    raw: Vec<u8>,
    working_bytes: u64,
    padded: usize,
}

/// How the pixels of a file are reached.
struct Source {
    codec: Codec,
    shape: Shape,
    layout: Layout,
    /// First byte of the pixels, where they are not compressed.
    at: u64,
    fragments: Option<Fragments>,
    padding: Option<f64>,
}

impl Decoder {
    /// Finds the pixels of all files, which are known to be such that can be read.
    pub fn new(files: &[File], budget: &mut Budget) -> Result<Self, Fault> {
        budget.reserve("the list of files", files.len() as u64, size_of::<Source>())?;
        let sources = files
            .iter()
            .map(|f| Source::of(f, budget).map_err(|e| e.inside(&f.name)));
        let sources = sources.collect::<Result<Vec<_>, _>>()?;
        let largest = |bytes: &dyn Fn(&Source) -> u64| sources.iter().map(bytes).max().unwrap_or(0);
        let compressed = largest(&|s| s.fragments.as_ref().map_or(0, Fragments::longest));
        let raw = largest(&|s| s.frame_bytes() as u64);
        let codec = largest(&|s| codec::working_bytes(s.codec, &s.shape));
        Ok(Self {
            sources,
            open: None,
            compressed: Vec::new(),
            raw: Vec::new(),
            working_bytes: compressed + raw + codec,
            padded: 0,
        })
    }

    /// Bytes held while frames are decoded.
    pub fn working_bytes(&self) -> u64 {
        self.working_bytes
    }

    /// Pixels met since the last call that hold their file's padding value.
    pub fn take_padded(&mut self) -> usize {
        std::mem::take(&mut self.padded)
    }

    /// Decodes a plane into `out`, a density a pixel.
    pub fn read(&mut self, files: &[File], plane: &Plane, out: &mut [f32]) -> Result<(), Fault> {
        let file = &files[plane.file as usize];
        self.decode(file, plane, out).map_err(|e| e.inside(&file.name))
    }

    fn decode(&mut self, file: &File, plane: &Plane, out: &mut [f32]) -> Result<(), Fault> {
        let source = &self.sources[plane.file as usize];
        let wanted = source.at + u64::from(plane.frame) * source.frame_bytes() as u64;
        // Streams of deflated files cannot go back.
        let kept = self
            .open
            .take()
            .filter(|(f, stream)| *f == plane.file && stream.position() <= wanted);
        let mut stream = match kept {
            Some((_, stream)) => stream,
            None => reopen(&file.location, &file.data)?,
        };
        let layout = match &source.fragments {
            None => {
                stream.skip(wanted - stream.position(), "the pixels")?;
                self.raw.resize(source.frame_bytes(), 0);
                stream.fill(&mut self.raw, "the pixels")?;
                source.layout
            }
            Some(fragments) => {
                fragments.read(&mut stream, plane.frame, &mut self.compressed)?;
                let (compressed, raw) = (&self.compressed, &mut self.raw);
                let decode = || codec::decode(source.codec, compressed, &source.shape, raw);
                source.layout.decoded(guarded("compressed pixels", decode)?)
            }
        };
        self.padded += convert(&self.raw, &layout, plane.rescale, source.padding, out);
        self.open = Some((plane.file, stream));
        Ok(())
    }
}

impl Source {
    fn of(file: &File, budget: &mut Budget) -> Result<Self, Fault> {
        let data = &file.data;
        let (pixels, codec) = (data.pixels.as_ref(), data.syntax.codec);
        let (pixels, codec) = pixels.zip(codec).expect("other files were refused");
        let layout = layout_of(data);
        let frame_count = data.frame_count.unwrap_or(1);
        let fragments = match codec {
            Codec::Native => None,
            _ => Some(Fragments::find(
                &file.location,
                data,
                pixels,
                frame_count,
                budget,
            )?),
        };
        let padding = match &data.padding {
            Some(value) => value.integer(0x0028_0120)?.map(|n| data.format.signed_number(n)),
            None => None,
        };
        let shape = Shape {
            rows: data.rows as usize,
            columns: data.columns as usize,
            bytes_per_pixel: layout.bytes,
        };
        if layout.swapped_pairs && frame_count > 1 && shape.pixel_count() % 2 == 1 {
            return Err(Fault::Value {
                what: "the number of pixels of a frame",
                value: format!("{}, odd, in 16-bit words", shape.pixel_count()),
                remedy: "convert the files first, for instance by gdcmconv --raw IN OUT",
            });
        }
        Ok(Self {
            codec,
            shape,
            layout,
            at: if fragments.is_some() { 0 } else { pixels.at },
            fragments,
            padding,
        })
    }

    /// Bytes of a decoded frame.
    fn frame_bytes(&self) -> usize {
        let bytes = self.shape.pixel_count() * self.layout.bytes;
        if self.layout.swapped_pairs {
            bytes.next_multiple_of(2)
        } else {
            bytes
        }
    }
}
