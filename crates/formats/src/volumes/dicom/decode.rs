//! Pictures out of files.

use std::collections::VecDeque;

use rayon::prelude::*;

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
use crate::guard;
use crate::limits::Budget;

/// Reads pictures, compressed ones several at a time.
pub(super) struct Decoder {
    sources: Vec<Source>,
    /// One for each picture that is decoded at a time.
    workers: Vec<Worker>,
    /// Pictures that were decoded before they are asked for, with their places in the order.
    ahead: VecDeque<(usize, Result<Picture, Fault>)>,
    /// The picture asked for last.
    last: Option<usize>,
    pixel_count: usize,
    working_bytes: u64,
    padded: usize,
}

/// A decoded picture.
struct Picture {
    pixels: Vec<f32>,
    padded: usize,
}

/// What decoding a picture needs; keeps the file open that it read last.
#[derive(Default)]
struct Worker {
    open: Option<(u32, Stream)>,
    compressed: Vec<u8>,
    raw: Vec<u8>,
}

/// How the pixels of a file are reached.
struct Source {
    codec: Codec,
    shape: Shape,
    layout: Layout,
    /// First byte of the pixels, where they are not compressed.
    at: u64,
    deflated: bool,
    fragments: Option<Fragments>,
    padding: Option<f64>,
}

/// Pictures decoded at a time: more would fill memory where cores are many.
const MOST_AHEAD: usize = 16;
/// Buffers of an open file.
const FILE_BUFFERS: u64 = 1 << 14;
/// Window and tables of a deflated one.
const INFLATING: u64 = 1 << 18;

impl Decoder {
    /// Finds the pixels of all files, which are known to be such that can be read. `volume_bytes` will be held beside
    /// what this one holds: several pictures are decoded at a time as far as memory allows.
    pub fn new(files: &[File], volume_bytes: u64, budget: &mut Budget) -> Result<Self, Fault> {
        budget.reserve("the list of files", files.len() as u64, size_of::<Source>())?;
        let sources = files
            .iter()
            .map(|f| Source::of(f, budget).map_err(|e| e.inside(&f.name)));
        let sources = sources.collect::<Result<Vec<_>, _>>()?;
        let largest = |bytes: &dyn Fn(&Source) -> u64| sources.iter().map(bytes).max().unwrap_or(0);
        let worker = largest(&|s| s.fragments.as_ref().map_or(0, Fragments::longest))
            + largest(&|s| s.frame_bytes() as u64)
            + largest(&|s| codec::working_bytes(s.codec, &s.shape))
            + largest(&|s| if s.deflated { INFLATING } else { FILE_BUFFERS });
        let pixel_count = sources.first().map_or(0, |s| s.shape.pixel_count());
        let is_slow = sources.iter().any(|s| s.fragments.is_some());
        let ahead = worker + 4 * pixel_count as u64;
        let room = budget.left().saturating_sub(volume_bytes) / ahead;
        let width = match room {
            2.. if is_slow => rayon::current_num_threads().min(MOST_AHEAD).min(room as usize),
            _ => 1,
        };
        Ok(Self {
            workers: (0..width).map(|_| Worker::default()).collect(),
            ahead: VecDeque::new(),
            last: None,
            pixel_count,
            working_bytes: if width > 1 { ahead * width as u64 } else { worker },
            padded: 0,
            sources,
        })
    }

    /// Bytes held while pictures are decoded.
    pub fn working_bytes(&self) -> u64 {
        self.working_bytes
    }

    /// Pixels met since the last call that hold their file's padding value.
    pub fn take_padded(&mut self) -> usize {
        std::mem::take(&mut self.padded)
    }

    /// Decodes the picture of a plane into `out`, a density a pixel.
    pub fn read(&mut self, files: &[File], plane: &Plane, out: &mut [f32]) -> Result<(), Fault> {
        self.padded += self.workers[0].decode(files, &self.sources, plane, out)?;
        Ok(())
    }

    /// The same for plane `index` of those in order. If it follows the last, those after it are decoded with it.
    pub fn read_in_order(
        &mut self,
        files: &[File],
        planes: &[Plane],
        index: usize,
        out: &mut [f32],
    ) -> Result<(), Fault> {
        let follows = self.last.map_or(0, |i| i + 1) == index;
        self.last = Some(index);
        if self.ahead.front().is_none_or(|(i, _)| *i != index) {
            self.ahead.clear();
            if !follows || self.workers.len() == 1 {
                return self.read(files, &planes[index], out);
            }
            let (sources, pixel_count) = (&self.sources, self.pixel_count);
            let decode = |(worker, plane): (&mut Worker, &Plane)| {
                let mut pixels = vec![0.0; pixel_count];
                let padded = worker.decode(files, sources, plane, &mut pixels)?;
                Ok(Picture { pixels, padded })
            };
            let work = self.workers.par_iter_mut().zip(&planes[index..]);
            let pictures: Vec<_> = work.map(decode).collect();
            self.ahead = (index..).zip(pictures).collect();
        }
        let (_, picture) = self.ahead.pop_front().expect("it was just put there");
        let picture = picture?;
        self.padded += picture.padded;
        out.copy_from_slice(&picture.pixels);
        Ok(())
    }
}

impl Worker {
    /// Decodes a plane; gives how many of its pixels are padding.
    fn decode(
        &mut self,
        files: &[File],
        sources: &[Source],
        plane: &Plane,
        out: &mut [f32],
    ) -> Result<usize, Fault> {
        let file = &files[plane.file as usize];
        self.decode_frame(file, &sources[plane.file as usize], plane, out)
            .map_err(|e| e.inside(&file.name))
    }

    fn decode_frame(
        &mut self,
        file: &File,
        source: &Source,
        plane: &Plane,
        out: &mut [f32],
    ) -> Result<usize, Fault> {
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
                source
                    .layout
                    .decoded(guard::decode("decoder of compressed pixels", decode)?)
            }
        };
        self.open = Some((plane.file, stream));
        Ok(convert(&self.raw, &layout, plane.rescale, source.padding, out))
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
        let shape = Shape {
            rows: data.rows as usize,
            columns: data.columns as usize,
            bytes_per_pixel: layout.bytes,
            bits_stored: layout.bits_stored,
            signed: layout.signed,
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
            deflated: data.syntax.deflated,
            fragments,
            padding: data.padding.map(|n| data.format.signed_number(n)),
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
