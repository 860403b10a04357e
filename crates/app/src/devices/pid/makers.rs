//! Descriptors as two makers' layouts say, written by the rules of HID from the documented fields: not those of the devices.

/// Items of a descriptor.
#[derive(Clone, Default)]
pub struct Items(pub Vec<u8>);

/// A field that varies, or an array.
pub const VARIABLE: u8 = 0x02;
pub const ARRAY: u8 = 0x00;

impl Items {
    /// Any item, with as few bytes as hold the value.
    pub fn item(mut self, tag: u8, value: i64) -> Self {
        let bytes = (value as i32).to_le_bytes();
        let size = match value {
            0 => 0,
            -128..=127 => 1,
            -32_768..=32_767 => 2,
            _ => 4,
        };
        self.0.push(tag | if size == 4 { 3 } else { size as u8 });
        self.0.extend(&bytes[..size]);
        self
    }

    pub fn page(self, page: u16) -> Self {
        self.item(0x04, page.into())
    }

    /// Usages, with their page where it is not the one that holds. Numbers above 0x7fff are none here.
    pub fn usages(self, ids: &[u16]) -> Self {
        ids.iter().fold(self, |items, id| items.item(0x08, (*id).into()))
    }

    /// A usage with its page.
    pub fn extended(mut self, page: u16, id: u16) -> Self {
        self.0.push(0x0b);
        self.0.extend(id.to_le_bytes());
        self.0.extend(page.to_le_bytes());
        self
    }

    /// A collection and what is in it: 1 application, 2 logical.
    pub fn collection(self, usage: u16, kind: i64, inside: impl FnOnce(Self) -> Self) -> Self {
        inside(self.usages(&[usage]).item(0xa0, kind)).item(0xc0, 0)
    }

    pub fn report(self, id: u8) -> Self {
        self.item(0x84, id.into())
    }

    /// Elements of some bits with a range.
    fn elements(self, tag: u8, bits: u8, count: u8, range: (i64, i64), flags: u8) -> Self {
        self.item(0x14, range.0)
            .item(0x24, range.1)
            .item(0x74, bits.into())
            .item(0x94, count.into())
            .item(tag, flags.into())
    }

    pub fn input(self, bits: u8, count: u8, range: (i64, i64), flags: u8) -> Self {
        self.elements(0x80, bits, count, range, flags)
    }

    pub fn output(self, bits: u8, count: u8, range: (i64, i64), flags: u8) -> Self {
        self.elements(0x90, bits, count, range, flags)
    }

    pub fn feature(self, bits: u8, count: u8, range: (i64, i64), flags: u8) -> Self {
        self.elements(0xb0, bits, count, range, flags)
    }

    /// Elements of zeros that fill up.
    pub fn fill_output(self, bits: u8) -> Self {
        self.item(0x74, bits.into()).item(0x94, 1).item(0x90, 1)
    }

    /// Output values of usages that share a range.
    fn values(self, ids: &[u16], bits: u8, range: (i64, i64)) -> Self {
        let count = ids.len() as u8;
        self.usages(ids).output(bits, count, range, VARIABLE)
    }
}

const KINDS: [u16; 11] = [0x26, 0x27, 0x30, 0x31, 0x32, 0x33, 0x34, 0x40, 0x41, 0x42, 0x43];

/// Bytes of a value without a sign.
const BYTE: (i64, i64) = (0, 255);
const WORD: (i64, i64) = (0, 32_767);
const INDEX: (i64, i64) = (1, 40);

/// Which of several usages holds.
fn kinds(items: Items, ids: &'static [u16], first: i64) -> Items {
    let last = first + ids.len() as i64 - 1;
    items.usages(ids).output(8, 1, (first, last), ARRAY)
}

/// The parts that both makers have, with their numbers and widths.
struct Maker {
    effect: fn(Items) -> Items,
    input: fn(Items) -> Items,
    control: fn(Items) -> Items,
    /// Numbers of condition, constant, operation, free, control, gain; create, load.
    ids: [u8; 8],
    magnitude: i64,
    /// Whether both saturations and the dead band have a sign.
    unsigned: i64,
}

fn device(maker: &Maker) -> Vec<u8> {
    let [condition, constant, operation, free, control, gain, create, load] = maker.ids;
    let (range, zero) = ((-maker.magnitude, maker.magnitude), (0, maker.unsigned));
    let body = |items: Items| {
        let items = (maker.input)(items).page(0x0f);
        let items = items.collection(0x92, 2, |i| {
            i.report(2)
                .usages(&[0x9f, 0xa0, 0xa4, 0xa6])
                .input(1, 4, (0, 1), VARIABLE)
                .usages(&[0x94])
                .input(1, 1, (0, 1), VARIABLE)
                .item(0x74, 3)
                .item(0x94, 1)
                .item(0x80, 1)
                .usages(&[0x22])
                .input(8, 1, INDEX, VARIABLE)
        });
        let items = items.collection(0x21, 2, maker.effect);
        let items = items.collection(0x5f, 2, |i| {
            i.report(condition)
                .values(&[0x22], 8, INDEX)
                .values(&[0x23], 8, (0, 1))
                .values(&[0x60, 0x61, 0x62], 16, range)
                .values(&[0x63, 0x64, 0x65], 16, zero)
        });
        let items = items.collection(0x73, 2, |i| {
            i.report(constant)
                .values(&[0x22], 8, INDEX)
                .values(&[0x70], 16, range)
        });
        let items = items.collection(0x77, 2, |i| {
            i.report(operation)
                .values(&[0x22], 8, INDEX)
                .collection(0x78, 2, |i| kinds(i, &[0x79, 0x7a, 0x7b], 1))
                .values(&[0x7c], 8, BYTE)
        });
        let items = items.collection(0x90, 2, |i| i.report(free).values(&[0x22], 8, INDEX));
        let items = items.collection(0x95, 2, |i| {
            let items = i.report(control);
            items.collection(0x96, 2, maker.control)
        });
        let items = items.collection(0x7d, 2, |i| i.report(gain).values(&[0x7e], 8, BYTE));
        let items = items.collection(0xab, 2, |i| {
            i.report(create)
                .collection(0x25, 2, |i| i.usages(&KINDS).feature(8, 1, (1, 11), ARRAY))
                .extended(0x01, 0x3b)
                .feature(16, 1, (0, 511), VARIABLE)
        });
        items.collection(0x89, 2, |i| {
            i.report(load)
                .usages(&[0x22])
                .feature(8, 1, INDEX, VARIABLE)
                .collection(0x8b, 2, |i| {
                    i.usages(&[0x8c, 0x8d, 0x8e]).feature(8, 1, (1, 3), ARRAY)
                })
                .usages(&[0xac])
                .feature(16, 1, (0, 65_535), VARIABLE)
        })
    };
    Items::default().page(0x01).collection(0x04, 1, body).0
}

/// OpenFFBoard: 64 buttons and eight axes, commands as bits of a mask.
pub fn openffboard() -> Vec<u8> {
    device(&Maker {
        input: |i| {
            i.report(1)
                .page(0x09)
                .item(0x18, 1)
                .item(0x28, 64)
                .input(1, 64, (0, 1), VARIABLE)
                .page(0x01)
                .usages(&[0x30, 0x31, 0x32, 0x33, 0x34, 0x35, 0x37, 0x36])
                .input(16, 8, (-32_767, 32_767), VARIABLE)
        },
        effect: |i| {
            i.report(1)
                .values(&[0x22], 8, INDEX)
                .collection(0x25, 2, |i| kinds(i, &KINDS, 1))
                .values(&[0x50, 0x54, 0x51, 0xa7], 16, WORD)
                .values(&[0x52], 8, BYTE)
                .values(&[0x53], 8, (1, 8))
                .collection(0x55, 2, |i| {
                    i.page(0x01)
                        .usages(&[0x30, 0x31])
                        .output(1, 2, (0, 1), VARIABLE)
                        .page(0x0f)
                })
                .values(&[0x56], 1, (0, 1))
                .fill_output(5)
                .collection(0x57, 2, |i| {
                    i.extended(0x0a, 1)
                        .extended(0x0a, 2)
                        .output(16, 2, (0, 36_000), VARIABLE)
                })
        },
        // The range is that of an enumeration, the bits are one each: so it is in the field.
        control: |i| {
            i.values(&[0x97, 0x98, 0x99, 0x9a, 0x9b, 0x9c], 1, (1, 6))
                .fill_output(2)
        },
        ids: [3, 5, 0x0a, 0x0b, 0x0c, 0x0d, 0x11, 0x12],
        magnitude: 32_767,
        unsigned: 32_767,
    })
}

/// VPforce Rhino: other numbers, another order, and commands that are counted.
pub fn rhino() -> Vec<u8> {
    device(&Maker {
        input: |i| {
            i.report(1)
                .page(0x01)
                .usages(&[0x30, 0x31, 0x32])
                .input(16, 3, (-4096, 4096), VARIABLE)
                .usages(&[0x35, 0x34, 0x33, 0x36])
                .input(8, 4, BYTE, VARIABLE)
                .page(0x09)
                .item(0x18, 1)
                .item(0x28, 48)
                .input(1, 48, (0, 1), VARIABLE)
        },
        effect: |i| {
            i.report(101)
                .values(&[0x22], 8, INDEX)
                .collection(0x25, 2, |i| kinds(i, &KINDS, 1))
                .values(&[0x50, 0x54, 0x51], 16, WORD)
                .values(&[0x52], 16, (0, 4096))
                .values(&[0x53], 8, (1, 8))
                .collection(0x55, 2, |i| {
                    i.page(0x01)
                        .usages(&[0x30, 0x31])
                        .output(1, 2, (0, 1), VARIABLE)
                        .page(0x0f)
                })
                .values(&[0x56], 1, (0, 1))
                .fill_output(5)
                .collection(0x57, 2, |i| {
                    i.extended(0x0a, 1).extended(0x0a, 2).output(8, 2, BYTE, VARIABLE)
                })
                .values(&[0xa7], 16, WORD)
        },
        control: |i| kinds(i, &[0x98, 0x97, 0x99, 0x9a, 0x9b, 0x9c], 1),
        ids: [103, 105, 110, 111, 112, 113, 5, 6],
        magnitude: 4096,
        unsigned: 4096,
    })
}
