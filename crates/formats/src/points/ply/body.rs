//! The rows of a PLY file, in any of its three encodings.

use super::header::{Element, Encoding, Header, Scalar, Shape};
use crate::Fault;
use crate::error::{Place, excerpt};
use crate::limits::{Budget, Counted};
use crate::text::{Words, integer, number};

/// Numbers one after the other. Each fits an `f64` exactly.
pub(super) trait Values {
    fn next(&mut self, kind: Scalar) -> Result<f64, Fault>;
    /// The length of a list.
    fn length(&mut self, kind: Scalar) -> Result<u64, Fault>;
    fn skip(&mut self, kind: Scalar, count: u64) -> Result<(), Fault>;
}

/// Rows as raw bytes.
pub(super) struct Binary<'a, const BIG: bool> {
    pub bytes: &'a [u8],
    pub at: usize,
}

#[inline(always)]
fn decode<const BIG: bool>(kind: Scalar, b: &[u8]) -> f64 {
    macro_rules! get {
        ($t:ty) => {{
            let raw = b[..size_of::<$t>()].try_into().expect("length by construction");
            f64::from(if BIG {
                <$t>::from_be_bytes(raw)
            } else {
                <$t>::from_le_bytes(raw)
            })
        }};
    }
    match kind {
        Scalar::F32 => get!(f32),
        Scalar::F64 => get!(f64),
        Scalar::I32 => get!(i32),
        Scalar::U32 => get!(u32),
        Scalar::I16 => get!(i16),
        Scalar::U16 => get!(u16),
        Scalar::I8 => get!(i8),
        Scalar::U8 => f64::from(b[0]),
    }
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    #[inline(always)]
    fn take(&mut self, size: usize) -> Result<&'a [u8], Fault> {
        match self.bytes.get(self.at..self.at + size) {
            Some(b) => {
                self.at += size;
                Ok(b)
            }
            None => Err(self.cut(size as u64)),
        }
    }

    #[cold]
    fn cut(&self, needed: u64) -> Fault {
        let what = format!("the row at byte {}", self.at);
        Fault::Truncated {
            what,
            needed,
            found: (self.bytes.len() - self.at) as u64,
        }
    }

    /// Reads the given properties of every row of an element without lists.
    ///
    /// `columns` are byte offsets and types; the count was checked against the bytes there are.
    pub fn gather<const N: usize>(
        &mut self,
        rows: usize,
        stride: usize,
        columns: &[(usize, Scalar); N],
        mut each: impl FnMut([f64; N]),
    ) {
        for row in self.bytes[self.at..self.at + rows * stride].chunks_exact(stride) {
            each(columns.map(|(offset, kind)| decode::<BIG>(kind, &row[offset..])));
        }
        self.at += rows * stride;
    }
}

impl<const BIG: bool> Values for Binary<'_, BIG> {
    #[inline(always)]
    fn next(&mut self, kind: Scalar) -> Result<f64, Fault> {
        Ok(decode::<BIG>(kind, self.take(kind.size())?))
    }

    #[inline(always)]
    fn length(&mut self, kind: Scalar) -> Result<u64, Fault> {
        let at = self.at as u64;
        let length = self.next(kind)?;
        if length < 0.0 {
            return Err(Fault::Syntax {
                place: Place::Byte(at),
                what: format!("a list has {length} entries"),
                remedy: "the file is damaged or its header names the wrong types",
            });
        }
        Ok(length as u64)
    }

    fn skip(&mut self, kind: Scalar, count: u64) -> Result<(), Fault> {
        let size = count.saturating_mul(kind.size() as u64);
        if size > (self.bytes.len() - self.at) as u64 {
            return Err(self.cut(size));
        }
        self.at += size as usize;
        Ok(())
    }
}

impl Values for Words<'_> {
    fn next(&mut self, _: Scalar) -> Result<f64, Fault> {
        let word = Words::next(self).ok_or_else(|| Fault::Truncated {
            what: format!("the row at line {}", self.line),
            needed: 1,
            found: 0,
        })?;
        // All digits, also where the header says `float`: coordinates of a survey need more than its 24 bits.
        match integer(word) {
            Some(n) => Ok(n as f64),
            None => number(word, self.line),
        }
    }

    fn length(&mut self, kind: Scalar) -> Result<u64, Fault> {
        let length = Values::next(self, kind)?;
        if !(length >= 0.0 && length.fract() == 0.0 && length <= u32::MAX as f64) {
            let what = format!("a list has {} entries", excerpt(length.to_string().as_bytes()));
            return Err(Fault::line(
                self.line,
                what,
                "a list starts with its whole, non-negative length",
            ));
        }
        Ok(length as u64)
    }

    fn skip(&mut self, kind: Scalar, count: u64) -> Result<(), Fault> {
        for _ in 0..count {
            Values::next(self, kind)?;
        }
        Ok(())
    }
}

/// Refuses a count that the bytes left cannot hold.
pub(super) fn check_count(element: &Element, header: &Header, left: usize) -> Result<(), Fault> {
    let needed = element.count.saturating_mul(element.least_row(header.encoding));
    // The last ascii value needs no separator.
    let slack = u64::from(header.encoding == Encoding::Ascii);
    if needed > left as u64 + slack {
        return Err(Fault::Truncated {
            what: format!("element \"{}\" with {} rows", element.name, element.count),
            needed,
            found: left as u64,
        });
    }
    Ok(())
}

/// Walks the rows of any element: `row_done` gets its number, the values of the properties with a slot, and the entries
/// of the list at `wanted`, which are booked in `budget`.
pub(super) fn walk<V: Values>(
    values: &mut V,
    element: &Element,
    slots: &[Option<usize>],
    wanted: Option<usize>,
    budget: &mut Budget,
    mut row_done: impl FnMut(u64, &[f64; 9], &[f64], &mut Budget) -> Result<(), Fault>,
) -> Result<(), Fault> {
    if element.properties.is_empty() {
        return Ok(());
    }
    let mut row_values = [0.0; 9];
    let mut entries = Counted::new("the entries of a list");
    for row in 0..element.count {
        for (p, property) in element.properties.iter().enumerate() {
            match property.shape {
                Shape::One(kind) => match slots[p] {
                    Some(slot) => row_values[slot] = values.next(kind)?,
                    None => values.skip(kind, 1)?,
                },
                Shape::List { count, item } => {
                    let length = values.length(count)?;
                    if wanted == Some(p) {
                        entries.items.clear();
                        for _ in 0..length {
                            entries.push(values.next(item)?, budget)?;
                        }
                    } else {
                        values.skip(item, length)?;
                    }
                }
            }
        }
        row_done(row, &row_values, &entries.items, budget)?;
    }
    Ok(())
}
