//! One element of a report: where its bits are and what they may hold.

use super::descriptor::{Descriptor, Field, Usage, Way};

/// An element of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Number of the report.
    pub report: u8,
    /// First bit, behind the number of the report.
    bit: u32,
    /// Bits, 1 to 32.
    size: u32,
    /// Smallest value.
    pub min: i64,
    /// Largest value.
    pub max: i64,
    has_null: bool,
}

impl Slot {
    /// Element `i` of a field.
    pub fn of(field: &Field, i: u32) -> Self {
        Self {
            report: field.report,
            bit: field.bit + field.size * i,
            size: field.size,
            min: field.min,
            max: field.max,
            has_null: field.has_null,
        }
    }

    /// Writes a value into a report that begins with its number. A value out of range is held to its ends.
    pub fn put(&self, report: &mut [u8], value: i64) {
        // What cannot hold its own range says nothing by it: one bit that means 1 to 6.
        let value = if self.min < self.max && self.size > 1 {
            value.clamp(self.min, self.max)
        } else {
            value
        };
        for i in 0..self.size {
            let bit = (8 + self.bit + i) as usize;
            if let Some(byte) = report.get_mut(bit / 8) {
                let mask = 1 << (bit % 8);
                match (value >> i) & 1 {
                    0 => *byte &= !mask,
                    _ => *byte |= mask,
                }
            }
        }
    }

    /// The value in a report that begins with its number. None where the report is too short, or says that there is none.
    pub fn get(&self, report: &[u8]) -> Option<i64> {
        let mut value = 0_i64;
        for i in 0..self.size {
            let bit = (8 + self.bit + i) as usize;
            let byte = *report.get(bit / 8)?;
            value |= i64::from(byte >> (bit % 8) & 1) << i;
        }
        // A range below zero has a sign.
        if self.min < 0 && value >> (self.size - 1) & 1 != 0 {
            value -= 1 << self.size;
        }
        let is_out = self.min < self.max && self.size > 1 && !(self.min..=self.max).contains(&value);
        match is_out {
            true if self.has_null => None,
            true => Some(value.clamp(self.min, self.max)),
            false => Some(value),
        }
    }

    /// The value for a share from -1 to 1 of a range on both sides of zero, or from 0 to 1 of one that begins there.
    pub fn share(&self, share: f64) -> i64 {
        let end = if share < 0.0 { -self.min } else { self.max };
        (share * end as f64).round() as i64
    }
}

/// What has to be written where, for a usage to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The element.
    pub slot: Slot,
    /// Its value.
    pub value: i64,
}

impl Choice {
    /// Writes it.
    pub fn put(&self, report: &mut [u8]) {
        self.slot.put(report, self.value);
    }

    /// Whether it holds in a report.
    pub fn holds(&self, report: &[u8]) -> bool {
        self.slot.get(report) == Some(self.value)
    }
}

/// Fields of a descriptor that go one way and are within some collections.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    descriptor: &'a Descriptor,
    way: Way,
    around: [Option<Usage>; 2],
}

impl<'a> Part<'a> {
    /// All fields that go one way.
    pub fn of(descriptor: &'a Descriptor, way: Way) -> Self {
        Self {
            descriptor,
            way,
            around: [None; 2],
        }
    }

    /// Those within a collection besides. Two can be asked for.
    pub fn within(self, usage: Usage) -> Self {
        let around = match self.around {
            [None, _] => [Some(usage), None],
            [first, _] => [first, Some(usage)],
        };
        Self { around, ..self }
    }

    /// The fields.
    pub fn fields(self) -> impl Iterator<Item = &'a Field> {
        self.descriptor.fields.iter().filter(move |field| {
            let is_within = |usage: Usage| self.descriptor.is_within(field, usage);
            field.way == self.way && self.around.into_iter().flatten().all(is_within)
        })
    }

    /// The element that is the value of a usage.
    pub fn value(self, usage: Usage) -> Option<Slot> {
        self.fields()
            .filter(|field| field.is_variable)
            .find_map(|field| field.place(usage).map(|i| Slot::of(field, i)))
    }

    /// How to have a usage hold: by its place among those of an array, or by a bit of its own.
    pub fn choice(self, usage: Usage) -> Option<Choice> {
        self.fields().find_map(|field| {
            let place = field.place(usage)?;
            Some(match field.is_variable {
                true => Choice {
                    slot: Slot::of(field, place),
                    value: 1,
                },
                false => Choice {
                    slot: Slot::of(field, 0),
                    value: field.min + i64::from(place),
                },
            })
        })
    }
}
