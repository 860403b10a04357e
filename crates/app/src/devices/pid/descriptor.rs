//! Report descriptors: what a HID device says about its reports \[Usb01 6.2.2\].
//!
//! `hidreport`, the crate for this, expands usages and counts as the device states them, so that 12 bytes ask for gigabytes, and
//! panics where a usage comes without its page. Here ranges stay ranges, and every size has a bound.

/// Largest descriptor that Linux takes (HID_MAX_DESCRIPTOR_SIZE).
const LONGEST: usize = 4096;
/// Most bits of a report: those of the longest that Linux takes.
const MOST_BITS: u32 = 8 * 16_384;
/// Most collections in each other, and most global states on the stack.
const DEEPEST: usize = 32;
/// Most usages of a field that are listed one by one.
const MOST_USAGES: usize = 1024;

/// Page in the high half, number in the low one.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Usage(pub u32);

impl Usage {
    /// A usage of a page.
    pub const fn new(page: u16, id: u16) -> Self {
        Self((page as u32) << 16 | id as u32)
    }
}

impl std::fmt::Debug for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{:02x}:{:02x}", self.0 >> 16, self.0 & 0xffff)
    }
}

/// Which way a report goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// From the device.
    Input,
    /// To the device.
    Output,
    /// Both ways, when asked.
    Feature,
}

/// A group of fields that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collection {
    /// What it is.
    pub usage: Usage,
    /// The one around it.
    pub parent: Option<usize>,
}

/// Elements of one size side by side in a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Which way its report goes.
    pub way: Way,
    /// Number of its report, 0 where reports have none.
    pub report: u8,
    /// Where it begins, in bits behind the number of the report.
    pub bit: u32,
    /// Bits of an element, 1 to 32.
    pub size: u32,
    /// Elements.
    pub count: u32,
    /// Smallest value.
    pub min: i64,
    /// Largest value.
    pub max: i64,
    /// Whether each element is the value of its usage; else each says which of the usages holds.
    pub is_variable: bool,
    /// Whether a value out of range means that there is none.
    pub has_null: bool,
    /// Usages, as ranges that include both ends.
    usages: Vec<(Usage, Usage)>,
    /// The collection that it is in.
    pub collection: Option<usize>,
}

impl Field {
    /// The first place of a usage among the elements of a variable, or among the values of an array.
    pub fn place(&self, usage: Usage) -> Option<u32> {
        let mut before = 0_u32;
        for (first, last) in &self.usages {
            if (first.0..=last.0).contains(&usage.0) {
                let place = before.checked_add(usage.0 - first.0)?;
                return (!self.is_variable || place < self.count).then_some(place);
            }
            before = before.checked_add(last.0 - first.0)?.checked_add(1)?;
        }
        None
    }
}

/// Why a descriptor is of no use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DescriptorError {
    /// More bytes than the system would take.
    #[error("the descriptor has {0} bytes and may have {LONGEST}")]
    TooLong(usize),
    /// The last item is not whole.
    #[error("the descriptor ends within the item at byte {at}")]
    Truncated {
        /// Where the item begins.
        at: usize,
    },
    /// An end without its beginning, or the other way round.
    #[error("the item at byte {at} ends or restores what nothing began")]
    Unbalanced {
        /// Where the item begins, or the length if something never ends.
        at: usize,
    },
    /// Too many in each other, or too many usages.
    #[error("the item at byte {at} nests or lists more than this program follows")]
    TooDeep {
        /// Where the item begins.
        at: usize,
    },
    /// A value that no item may have.
    #[error("the item at byte {at} has the value {value}, which it may not have")]
    Value {
        /// Where the item begins.
        at: usize,
        /// What it says.
        value: u32,
    },
}

/// What a device says about its reports.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Descriptor {
    /// Fields in their order.
    pub fields: Vec<Field>,
    /// Collections in their order: none is before the one around it.
    pub collections: Vec<Collection>,
    /// Bits of every report, behind its number.
    reports: Vec<(Way, u8, u32)>,
    /// Whether reports have numbers.
    pub is_numbered: bool,
}

/// Globals: they hold until they change.
#[derive(Clone, Copy, Default)]
struct Globals {
    page: u16,
    min: i64,
    /// The largest value as written: its sign depends on the smallest one.
    max: (u32, u32),
    size: u32,
    count: u32,
    report: u8,
}

/// Locals: they hold for the next main item.
#[derive(Clone, Default)]
struct Locals {
    usages: Vec<(Usage, Usage)>,
    min: Option<Usage>,
}

/// A value of so many bytes with its sign.
fn signed(value: u32, bytes: u32) -> i64 {
    match bytes {
        0 => 0,
        1 => (value as u8).cast_signed().into(),
        2 => (value as u16).cast_signed().into(),
        _ => value.cast_signed().into(),
    }
}

impl Descriptor {
    /// Reads a descriptor.
    ///
    /// # Errors
    /// [`DescriptorError`].
    pub fn parse(bytes: &[u8]) -> Result<Self, DescriptorError> {
        if bytes.len() > LONGEST {
            return Err(DescriptorError::TooLong(bytes.len()));
        }
        let mut reader = Reader::default();
        let mut at = 0;
        while at < bytes.len() {
            at = reader.item(bytes, at)?;
        }
        if reader.open.is_some() {
            return Err(DescriptorError::Unbalanced { at });
        }
        Ok(reader.read)
    }

    /// Bytes of a report, with the first one for its number. 1 of a report that is nowhere.
    pub fn length(&self, way: Way, report: u8) -> usize {
        let found = self.reports.iter().find(|(w, id, _)| (*w, *id) == (way, report));
        1 + found.map_or(0, |(.., bits)| bits.div_ceil(8) as usize)
    }

    /// Whether a field is somewhere within a collection of this usage.
    pub fn is_within(&self, field: &Field, usage: Usage) -> bool {
        let mut around = field.collection;
        while let Some(i) = around {
            let collection = &self.collections[i];
            if collection.usage == usage {
                return true;
            }
            around = collection.parent;
        }
        false
    }
}

#[derive(Default)]
struct Reader {
    read: Descriptor,
    globals: Globals,
    stack: Vec<Globals>,
    locals: Locals,
    /// The innermost collection, and how many are around it.
    open: Option<usize>,
    depth: usize,
}

impl Reader {
    /// Takes the item at a byte. Where the next one begins.
    fn item(&mut self, bytes: &[u8], at: usize) -> Result<usize, DescriptorError> {
        let truncated = DescriptorError::Truncated { at };
        let prefix = bytes[at];
        if prefix == 0xfe {
            // A long item: its size, its tag, and data that HID 1.11 leaves to makers.
            let size = usize::from(*bytes.get(at + 1).ok_or(truncated)?);
            let end = at + 3 + size;
            return if end <= bytes.len() {
                Ok(end)
            } else {
                Err(truncated)
            };
        }
        let size = [0, 1, 2, 4][usize::from(prefix & 3)];
        let data = bytes.get(at + 1..at + 1 + size).ok_or(truncated)?;
        let value = data
            .iter()
            .rev()
            .fold(0_u32, |value, byte| value << 8 | u32::from(*byte));
        let (tag, size) = (prefix & 0xfc, size as u32);
        match (prefix >> 2) & 3 {
            0 => self.main(tag, value, at)?,
            1 => self.global(tag, value, size, at)?,
            2 => self.local(tag, value, size, at)?,
            _ => {}
        }
        Ok(at + 1 + size as usize)
    }

    fn main(&mut self, tag: u8, value: u32, at: usize) -> Result<(), DescriptorError> {
        match tag {
            0x80 => self.field(Way::Input, value, at)?,
            0x90 => self.field(Way::Output, value, at)?,
            0xb0 => self.field(Way::Feature, value, at)?,
            0xa0 => {
                if self.depth == DEEPEST {
                    return Err(DescriptorError::TooDeep { at });
                }
                let usage = self.locals.usages.first().map_or(Usage(0), |(first, _)| *first);
                self.read.collections.push(Collection {
                    usage,
                    parent: self.open,
                });
                self.open = Some(self.read.collections.len() - 1);
                self.depth += 1;
            }
            0xc0 => {
                let ended = self.open.ok_or(DescriptorError::Unbalanced { at })?;
                self.open = self.read.collections[ended].parent;
                self.depth -= 1;
            }
            _ => {}
        }
        self.locals = Locals::default();
        Ok(())
    }

    fn global(&mut self, tag: u8, value: u32, size: u32, at: usize) -> Result<(), DescriptorError> {
        let wrong = Err(DescriptorError::Value { at, value });
        let globals = &mut self.globals;
        match tag {
            0x04 => match u16::try_from(value) {
                Ok(page) => globals.page = page,
                Err(_) => return wrong,
            },
            0x14 => globals.min = signed(value, size),
            0x24 => globals.max = (value, size),
            0x74 if value > 32 => return wrong,
            0x74 => globals.size = value,
            0x84 => match u8::try_from(value) {
                Ok(id @ 1..) => {
                    globals.report = id;
                    self.read.is_numbered = true;
                }
                _ => return wrong,
            },
            0x94 => globals.count = value,
            0xa4 if self.stack.len() == DEEPEST => return Err(DescriptorError::TooDeep { at }),
            0xa4 => self.stack.push(*globals),
            0xb4 => *globals = self.stack.pop().ok_or(DescriptorError::Unbalanced { at })?,
            // Physical ranges and units: forces of game controllers have none that could be relied on.
            _ => {}
        }
        Ok(())
    }

    fn local(&mut self, tag: u8, value: u32, size: u32, at: usize) -> Result<(), DescriptorError> {
        // One of four bytes brings its own page.
        let usage = match size {
            4 => Usage(value),
            _ => Usage::new(self.globals.page, value as u16),
        };
        let range = match tag {
            0x08 => (usage, usage),
            0x18 => {
                self.locals.min = Some(usage);
                return Ok(());
            }
            0x28 => match self.locals.min.take() {
                Some(min) if min <= usage => (min, usage),
                _ => return Err(DescriptorError::Value { at, value }),
            },
            // Designators, strings and alternatives.
            _ => return Ok(()),
        };
        if self.locals.usages.len() == MOST_USAGES {
            return Err(DescriptorError::TooDeep { at });
        }
        self.locals.usages.push(range);
        Ok(())
    }

    fn field(&mut self, way: Way, flags: u32, at: usize) -> Result<(), DescriptorError> {
        let Globals {
            min,
            max,
            size,
            count,
            report,
            ..
        } = self.globals;
        let reports = &mut self.read.reports;
        let known = reports.iter().position(|(w, id, _)| (*w, *id) == (way, report));
        let index = known.unwrap_or_else(|| {
            reports.push((way, report, 0));
            reports.len() - 1
        });
        let bit = reports[index].2;
        let bits = size
            .checked_mul(count)
            .and_then(|more| bit.checked_add(more))
            .filter(|bits| *bits <= MOST_BITS)
            .ok_or(DescriptorError::Value { at, value: count })?;
        reports[index].2 = bits;
        // Constants fill up; what has no size or no usage says nothing.
        let is_constant = flags & 1 != 0;
        if is_constant || size == 0 || count == 0 || self.locals.usages.is_empty() {
            return Ok(());
        }
        // Many write 255 as one byte, which is -1 by the letter.
        let max = match signed(max.0, max.1) {
            max if max < min && min >= 0 => max_unsigned(max, self.globals.max.1),
            max => max,
        };
        self.read.fields.push(Field {
            way,
            report,
            bit,
            size,
            count,
            min,
            max,
            is_variable: flags & 2 != 0,
            has_null: flags & 0x40 != 0,
            usages: self.locals.usages.clone(),
            collection: self.open,
        });
        Ok(())
    }
}

/// What a value of so many bytes is without its sign.
fn max_unsigned(value: i64, bytes: u32) -> i64 {
    value & ((1_i64 << (8 * bytes)) - 1)
}
