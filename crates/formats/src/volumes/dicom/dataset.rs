//! What one file says: the elements that bear on a volume, up to where its pixels start. All else is passed over.

use super::element::{self, Element, ITEM, ITEM_END, SEQUENCE_END, Tag, show};
use super::stream::{Location, Stream};
use super::syntax::{Encoding, Syntax};
use super::value::Value;
use crate::Fault;
use crate::limits::{Budget, Counted};

/// One file.
#[derive(Debug)]
pub(super) struct DataSet {
    pub syntax: Syntax,
    pub syntax_uid: String,
    pub series: SeriesId,
    pub sop_class: String,
    /// Third value of the image type: what kind of image it is.
    pub flavour: String,
    /// Whether the image type says that slices lie as tiles in one picture.
    pub is_mosaic: bool,
    /// Whether the file starts with a preamble and its mark.
    pub has_preamble: bool,
    pub rows: u32,
    pub columns: u32,
    /// `None` if the element is absent, as in files of one frame.
    pub frame_count: Option<u32>,
    pub format: PixelFormat,
    /// Read as unsigned.
    pub padding: Option<i64>,
    pub has_modality_table: bool,
    /// Of all frames, unless a frame says otherwise.
    pub common: Attributes,
    /// Of single frames, as far as they have any.
    pub frames: Vec<Attributes>,
    /// Positions of the frames of a dose grid along the normal.
    pub grid_offsets: Vec<f64>,
    pub pixels: Option<PixelElement>,
}

/// What tells series apart, and what users call them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct SeriesId {
    pub uid: String,
    pub number: Option<i64>,
    pub description: String,
    pub modality: String,
}

/// How a pixel is stored.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct PixelFormat {
    pub samples: u32,
    pub photometric: String,
    pub bits_allocated: u32,
    pub bits_stored: u32,
    pub high_bit: u32,
    pub signed: bool,
}

/// What may differ from frame to frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Attributes {
    /// Centre of the first pixel, LPS, mm.
    pub position: Option<[f64; 3]>,
    /// Directions of growing column and of growing row index.
    pub orientation: Option<[f64; 6]>,
    /// Between rows, between columns, mm.
    pub spacing: Option<[f64; 2]>,
    pub between_slices: Option<f64>,
    pub thickness: Option<f64>,
    pub slope: Option<f64>,
    pub intercept: Option<f64>,
    /// Unit of the rescaled values.
    pub rescale_type: Option<String>,
    /// What tells pictures of one position apart: temporal position, trigger time, acquisition, echo time, instance.
    pub order: [Option<f64>; 5],
}

impl Attributes {
    /// These, and where they are silent those of `other`.
    pub fn or(&self, other: &Self) -> Self {
        Self {
            position: self.position.or(other.position),
            orientation: self.orientation.or(other.orientation),
            spacing: self.spacing.or(other.spacing),
            between_slices: self.between_slices.or(other.between_slices),
            thickness: self.thickness.or(other.thickness),
            slope: self.slope.or(other.slope),
            intercept: self.intercept.or(other.intercept),
            rescale_type: self.rescale_type.clone().or_else(|| other.rescale_type.clone()),
            order: std::array::from_fn(|i| self.order[i].or(other.order[i])),
        }
    }
}

/// Where the pixels are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PixelElement {
    pub kind: PixelKind,
    /// First byte of the value in the (inflated) data set.
    pub at: u64,
    /// Bytes of the value; `None` if it is a sequence of fragments.
    pub length: Option<u32>,
    /// Bytes of the file from there on; `None` if the data set is deflated.
    pub left: Option<u64>,
    /// Whether 8-bit pixels come as 16-bit words, which matters for big-endian files alone.
    pub words: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PixelKind {
    Integer,
    Float32,
    Float64,
}

/// Where an element stands. What is wanted lies at most three sequences deep.
#[derive(Clone, Copy, PartialEq)]
enum Scope {
    Root,
    /// Among the functional groups.
    Groups(Owner),
    /// In one of the groups, or in the detector of a multi-frame file.
    Group(Owner),
}

/// Whose attributes they are.
#[derive(Clone, Copy, PartialEq)]
enum Owner {
    All,
    Frame(usize),
}

const SHARED_GROUPS: Tag = 0x5200_9229;
const PER_FRAME_GROUPS: Tag = 0x5200_9230;
const DETECTOR: Tag = 0x0054_0022;
/// Frame content, plane position, plane orientation, pixel measures, pixel value transformation.
const MACROS: [Tag; 5] = [0x0020_9111, 0x0020_9113, 0x0020_9116, 0x0028_9110, 0x0028_9145];
/// Temporal position (and that of a frame), trigger time, acquisition, echo time, instance, each with its place in
/// [`Attributes::order`].
const ORDER: [(Tag, usize); 6] = [
    (0x0020_0100, 0),
    (0x0020_9128, 0),
    (0x0018_1060, 1),
    (0x0020_0012, 2),
    (0x0018_0081, 3),
    (0x0020_0013, 4),
];

/// Longest value that is read; the offsets of thousands of frames fit.
const LONGEST: u32 = 1 << 16;

/// Whether a file starts like DICOM. [`LOOK`] bytes suffice.
pub(crate) fn looks_like_dicom(head: &[u8]) -> bool {
    Start::of(head).is_some()
}

/// A file that cannot be understood.
#[derive(Debug)]
pub(super) struct Broken {
    pub fault: Fault,
    /// Identifier of its series, if it was met before.
    pub series: String,
}

impl From<Fault> for Broken {
    fn from(fault: Fault) -> Self {
        Self {
            fault,
            series: String::new(),
        }
    }
}

/// Opens a file and reads it up to its pixels; `None` if it is no DICOM file.
///
/// # Errors
/// [`Fault::Damaged`], [`Fault::Truncated`]; [`Fault::Value`] for numbers that are none.
pub(super) fn read(location: &Location, budget: &mut Budget) -> Result<Option<DataSet>, Broken> {
    let mut stream = location.open()?;
    let Some((uid, has_preamble)) = meta_group(&mut stream)? else {
        return Ok(None);
    };
    let syntax = Syntax::from_uid(&uid);
    if syntax.deflated {
        stream = stream.inflated();
    }
    let mut reader = Reader {
        stream,
        budget,
        data: DataSet::new(syntax, uid),
        frames: Counted::new("the frames' positions"),
    };
    let result = reader.elements(End::File, Scope::Root, syntax.encoding);
    let mut data = reader.data;
    if let Err(fault) = result {
        return Err(Broken {
            fault,
            series: data.series.uid,
        });
    }
    data.frames = reader.frames.items;
    data.has_preamble = has_preamble;
    Ok(Some(data))
}

/// Opens the stream that positions in `data` refer to.
pub(super) fn reopen(location: &Location, data: &DataSet) -> Result<Stream, Fault> {
    let mut stream = location.open()?;
    if data.syntax.deflated {
        meta_group(&mut stream)?;
        stream = stream.inflated();
    }
    Ok(stream)
}

/// Reads the elements of group 2, which are explicit in every file, and stops after them. The transfer syntax and
/// whether there was a preamble, or `None` if the file is no DICOM.
fn meta_group(stream: &mut Stream) -> Result<Option<(String, bool)>, Fault> {
    const TRANSFER_SYNTAX: Tag = 0x0002_0010;
    let mut head = [0; LOOK];
    let got = stream.fill_or_end(&mut head)?;
    let Some(start) = Start::of(&head[..got]) else {
        return Ok(None);
    };
    let has_preamble = start == Start::Preamble;
    stream.back_to(if has_preamble { 132 } else { 0 })?;
    if let Start::Elements(uid) = start {
        return Ok(Some((uid.into(), false)));
    }
    let mut uid = None;
    loop {
        let at = stream.position();
        let mut head = [0; 8];
        // What follows may be written in another way: only its group is looked at.
        if stream.fill_or_end(&mut head)? < 8 || head[..2] != [2, 0] {
            stream.back_to(at)?;
            let missing = || Fault::Damaged {
                what: "the file names no transfer syntax".into(),
            };
            return uid.ok_or_else(missing).map(|uid| Some((uid, has_preamble)));
        }
        let element = element::parse(&head, stream, Encoding::EXPLICIT)?;
        match element.length {
            Some(length) if element.tag == TRANSFER_SYNTAX && length <= LONGEST => {
                uid = Some(Value::read(stream, &element, length, Encoding::EXPLICIT)?.label());
            }
            _ => element::skip(stream, &element, Encoding::EXPLICIT)?,
        }
    }
}

/// How a file starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Start {
    /// With 128 bytes of anything and the mark, as the standard says.
    Preamble,
    /// With group 2.
    Group2,
    /// With the data set itself, in the syntax of that identifier: networks send them so.
    Elements(&'static str),
}

/// Bytes that tell how a file starts.
pub(super) const LOOK: usize = 400;

impl Start {
    fn of(head: &[u8]) -> Option<Self> {
        if head.get(128..132) == Some(b"DICM") {
            return Some(Self::Preamble);
        }
        // Two short elements, the first of them in group 2 or 8: there are always several in these groups.
        if starts_with_elements(head, Encoding::EXPLICIT, 0x0002) {
            return Some(Self::Group2);
        }
        let big = Encoding {
            explicit: true,
            big_endian: true,
        };
        let ways = [
            (Encoding::EXPLICIT, "1.2.840.10008.1.2.1"),
            (big, "1.2.840.10008.1.2.2"),
            (Encoding::IMPLICIT, "1.2.840.10008.1.2"),
        ];
        ways.into_iter()
            .find(|(encoding, _)| starts_with_elements(head, *encoding, 0x0008))
            .map(|(_, uid)| Self::Elements(uid))
    }
}

/// Whether two elements stand at the start, in order and both of `group`.
fn starts_with_elements(head: &[u8], encoding: Encoding, group: Tag) -> bool {
    let first = element::short_head(head, encoding).filter(|(e, _)| e.tag >> 16 == group);
    let second = first.and_then(|(e, at)| {
        let next = at + e.length? as usize;
        let (second, _) = element::short_head(head.get(next..)?, encoding)?;
        Some((e.tag, second.tag))
    });
    second.is_some_and(|(a, b)| a < b && b >> 16 == group)
}

/// Where a run of elements ends.
#[derive(Clone, Copy)]
enum End {
    File,
    At(u64),
    Delimiter,
}

struct Reader<'a> {
    stream: Stream,
    budget: &'a mut Budget,
    data: DataSet,
    frames: Counted<Attributes>,
}

impl Reader<'_> {
    fn elements(&mut self, end: End, scope: Scope, encoding: Encoding) -> Result<(), Fault> {
        loop {
            if let End::At(at) = end
                && self.stream.position() >= at
            {
                return check_end(&self.stream, at);
            }
            let Some(e) = element::read(&mut self.stream, encoding)? else {
                return match end {
                    End::File => Ok(()),
                    _ => Err(Fault::Truncated {
                        what: "an item of a sequence".into(),
                        needed: 8,
                        found: 0,
                    }),
                };
            };
            if e.tag == ITEM_END && matches!(end, End::Delimiter) {
                return Ok(());
            }
            if matches!(e.tag, ITEM | ITEM_END | SEQUENCE_END) {
                return Err(element::misplaced(&e, &self.stream));
            }
            if scope == Scope::Root && self.is_pixels(&e) {
                return Ok(());
            }
            match scope_of(e.tag, scope) {
                Some(inner) => self.items(&e, inner, encoding)?,
                None if is_wanted(e.tag) && e.length.is_some_and(|n| n <= LONGEST) => {
                    let length = e.length.unwrap_or_default();
                    let value = Value::read(&mut self.stream, &e, length, encoding)?;
                    self.take(e.tag, value, scope)?;
                }
                None => {
                    self.data.has_modality_table |= e.tag == 0x0028_3000 && scope == Scope::Root;
                    element::skip(&mut self.stream, &e, encoding)?;
                }
            }
        }
    }

    fn is_pixels(&mut self, e: &Element) -> bool {
        let kind = match e.tag {
            0x7FE0_0008 => PixelKind::Float32,
            0x7FE0_0009 => PixelKind::Float64,
            0x7FE0_0010 => PixelKind::Integer,
            _ => return false,
        };
        self.data.pixels = Some(PixelElement {
            kind,
            at: self.stream.position(),
            length: e.length,
            left: self.stream.left(),
            words: e.vr != *b"OB",
        });
        true
    }

    /// The items of a sequence whose elements are wanted.
    fn items(&mut self, sequence: &Element, inner: Scope, encoding: Encoding) -> Result<(), Fault> {
        let encoding = element::inside(sequence, encoding);
        let end = sequence.length.map(|n| self.stream.position() + u64::from(n));
        loop {
            if let Some(at) = end
                && self.stream.position() >= at
            {
                return check_end(&self.stream, at);
            }
            let Some(item) = element::read(&mut self.stream, encoding)? else {
                return Err(Fault::Truncated {
                    what: format!("the sequence {}", show(sequence.tag)),
                    needed: 8,
                    found: 0,
                });
            };
            match item.tag {
                ITEM => {}
                SEQUENCE_END if end.is_none() => return Ok(()),
                _ => return Err(element::misplaced(&item, &self.stream)),
            }
            let scope = match inner {
                Scope::Groups(_) if sequence.tag == PER_FRAME_GROUPS => {
                    self.frames.push(Attributes::default(), self.budget)?;
                    Scope::Groups(Owner::Frame(self.frames.items.len() - 1))
                }
                other => other,
            };
            let until = item
                .length
                .map_or(End::Delimiter, |n| End::At(self.stream.position() + u64::from(n)));
            self.elements(until, scope, encoding)?;
        }
    }

    fn take(&mut self, tag: Tag, value: Value, scope: Scope) -> Result<(), Fault> {
        let attributes = match scope {
            Scope::Root | Scope::Groups(Owner::All) | Scope::Group(Owner::All) => &mut self.data.common,
            Scope::Groups(Owner::Frame(i)) | Scope::Group(Owner::Frame(i)) => &mut self.frames.items[i],
        };
        if let Some((_, slot)) = ORDER.iter().find(|(t, _)| *t == tag) {
            // Nothing depends on it but the order of a time series.
            let whole = value.integer(tag).ok().flatten().map(|n| n as f64);
            attributes.order[*slot] = value.real(tag).ok().flatten().or(whole);
        }
        match tag {
            0x0020_0032 => attributes.position = value.reals(tag)?,
            0x0020_0037 => attributes.orientation = value.reals(tag)?,
            0x0028_0030 => attributes.spacing = value.reals(tag)?,
            0x0018_0088 => attributes.between_slices = value.real(tag)?,
            0x0018_0050 => attributes.thickness = value.real(tag)?,
            // The scale of a dose grid is a slope by another name.
            0x0028_1053 | 0x3004_000E => attributes.slope = value.real(tag)?,
            0x0028_1052 => attributes.intercept = value.real(tag)?,
            0x0028_1054 => attributes.rescale_type = Some(value.label()),

            _ if scope == Scope::Root => self.take_root(tag, value)?,
            _ => {}
        }
        Ok(())
    }

    fn take_root(&mut self, tag: Tag, value: Value) -> Result<(), Fault> {
        let d = &mut self.data;
        let count = |value: &Value| value.integer(tag).map(|n| n.and_then(|n| u32::try_from(n).ok()));
        match tag {
            0x0008_0008 => {
                d.flavour = value.part(2);
                d.is_mosaic = value.text().split('\\').any(|part| part.trim() == "MOSAIC");
            }
            0x0008_0016 => d.sop_class = value.label(),
            0x0008_0060 => d.series.modality = value.label(),
            0x0008_103E => d.series.description = value.label(),
            0x0020_000E => d.series.uid = value.label(),
            0x0020_0011 => d.series.number = value.integer(tag)?,
            0x0028_0002 => d.format.samples = count(&value)?.unwrap_or(1),
            0x0028_0004 => d.format.photometric = value.label(),
            0x0028_0008 => d.frame_count = count(&value)?,
            0x0028_0010 => d.rows = count(&value)?.unwrap_or(0),
            0x0028_0011 => d.columns = count(&value)?.unwrap_or(0),
            0x0028_0100 => d.format.bits_allocated = count(&value)?.unwrap_or(0),
            0x0028_0101 => d.format.bits_stored = count(&value)?.unwrap_or(0),
            0x0028_0102 => d.format.high_bit = count(&value)?.unwrap_or(0),
            0x0028_0103 => d.format.signed = value.integer(tag)? == Some(1),
            0x0028_0120 => d.padding = value.integer(tag)?,
            0x3004_000C => d.grid_offsets = value.all_reals(tag)?,
            _ => {}
        }
        Ok(())
    }
}

fn check_end(stream: &Stream, at: u64) -> Result<(), Fault> {
    if stream.position() == at {
        return Ok(());
    }
    Err(Fault::Damaged {
        what: format!("a sequence ends at byte {at}, within the element before it"),
    })
}

/// Where the items of an element stand, if they are wanted.
fn scope_of(tag: Tag, scope: Scope) -> Option<Scope> {
    match (scope, tag) {
        (Scope::Root, SHARED_GROUPS) => Some(Scope::Groups(Owner::All)),
        (Scope::Root, PER_FRAME_GROUPS) => Some(Scope::Groups(Owner::Frame(0))),
        (Scope::Root, DETECTOR) => Some(Scope::Group(Owner::All)),
        (Scope::Groups(owner), tag) if MACROS.contains(&tag) => Some(Scope::Group(owner)),
        _ => None,
    }
}

fn is_wanted(tag: Tag) -> bool {
    matches!(
        tag,
        0x0008_0008
            | 0x0008_0016
            | 0x0008_0060
            | 0x0008_103E
            | 0x0018_0050
            | 0x0018_0081
            | 0x0018_0088
            | 0x0018_1060
            | 0x0020_000E
            | 0x0020_0011..=0x0020_0013
            | 0x0020_0032
            | 0x0020_0037
            | 0x0020_0100
            | 0x0020_9128
            | 0x0028_0002
            | 0x0028_0004
            | 0x0028_0008
            | 0x0028_0010
            | 0x0028_0011
            | 0x0028_0030
            | 0x0028_0100..=0x0028_0103
            | 0x0028_0120
            | 0x0028_1052..=0x0028_1054
            | 0x3004_000C
            | 0x3004_000E
    )
}

impl DataSet {
    fn new(syntax: Syntax, syntax_uid: String) -> Self {
        Self {
            syntax,
            syntax_uid,
            series: SeriesId::default(),
            sop_class: String::new(),
            flavour: String::new(),
            is_mosaic: false,
            has_preamble: true,
            rows: 0,
            columns: 0,
            frame_count: None,
            format: PixelFormat {
                samples: 1,
                ..Default::default()
            },
            padding: None,
            has_modality_table: false,
            common: Attributes::default(),
            frames: Vec::new(),
            grid_offsets: Vec::new(),
            pixels: None,
        }
    }
}
