//! The text in front of every PLY file.

use crate::Fault;
use crate::error::excerpt;
use crate::text::{Lines, integer};

/// Type of a stored number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::points) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// What a property holds in each row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::points) enum Shape {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(in crate::points) struct Property {
    pub name: String,
    pub shape: Shape,
}

#[derive(Debug)]
pub(in crate::points) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes of a row if every row has the same.
    pub fn fixed_stride(&self) -> Option<usize> {
        self.properties
            .iter()
            .map(|p| match p.shape {
                Shape::One(s) => Some(s.size()),
                Shape::List { .. } => None,
            })
            .sum()
    }

    /// Fewest bytes of a row: what a header's count is checked against before anything is allocated.
    pub fn least_row(&self, encoding: Encoding) -> u64 {
        match encoding {
            // One digit and one separator a value.
            Encoding::Ascii => 2 * self.properties.len() as u64,
            Encoding::Little | Encoding::Big => self
                .properties
                .iter()
                .map(|p| match p.shape {
                    Shape::One(s) | Shape::List { count: s, .. } => s.size() as u64,
                })
                .sum(),
        }
    }

    /// The property of a name, or else one that is written in other letters, or as some programs call it.
    pub fn find(&self, name: &str) -> Option<usize> {
        let called = match name {
            "nx" => "normal_x",
            "ny" => "normal_y",
            "nz" => "normal_z",
            name => name,
        };
        let is_near = |p: &Property| [name, called].iter().any(|n| p.name.eq_ignore_ascii_case(n));
        self.named(name)
            .or_else(|| self.properties.iter().position(is_near))
    }

    fn named(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::points) enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Debug)]
pub(in crate::points) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// Byte at which the rows start.
    pub body: usize,
    /// Lines of the header, `end_header` included.
    pub lines: u64,
}

/// Reads the header at the start of `bytes`.
pub(in crate::points) fn read(bytes: &[u8]) -> Result<Header, Fault> {
    let mut lines = Lines::new(bytes);
    if lines.next().map(<[u8]>::trim_ascii) != Some(b"ply") {
        return Err(Fault::line(
            1,
            "the file does not start with \"ply\"",
            "check that this is a PLY file",
        ));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    while let Some(text) = lines.next() {
        let line = lines.line;
        let bad = |remedy| Fault::line(line, format!("cannot use {}", excerpt(text)), remedy);
        let words: Vec<&[u8]> = text
            .split(u8::is_ascii_whitespace)
            .filter(|w| !w.is_empty())
            .take(6)
            .collect();
        match words[..] {
            [] | [b"comment" | b"obj_info", ..] => {}
            [b"format", name, _version] => {
                encoding = Some(match name {
                    b"ascii" => Encoding::Ascii,
                    b"binary_little_endian" => Encoding::Little,
                    b"binary_big_endian" => Encoding::Big,
                    _ => return Err(bad("known are ascii, binary_little_endian and binary_big_endian")),
                });
            }
            [b"element", name, count] => {
                let count = integer(count).and_then(|n| u64::try_from(n).ok());
                let count = count.ok_or_else(|| bad("an element has a name and a count"))?;
                let name = String::from_utf8_lossy(name).into_owned();
                if elements.iter().any(|e| e.name == name) {
                    return Err(bad("an element is declared once"));
                }
                elements.push(Element {
                    name,
                    count,
                    properties: Vec::new(),
                });
            }
            [b"property", ref rest @ ..] => {
                let shape_name = match *rest {
                    [b"list", count, item, name] => Scalar::from_name(count)
                        .filter(|c| !matches!(c, Scalar::F32 | Scalar::F64))
                        .zip(Scalar::from_name(item))
                        .map(|(count, item)| (Shape::List { count, item }, name)),
                    [kind, name] => Scalar::from_name(kind).map(|s| (Shape::One(s), name)),
                    _ => None,
                };
                let known = "known types are char, uchar, short, ushort, int, uint, float, double \
                             (int8 to float64), and list COUNT ITEM";
                let (shape, name) = shape_name.ok_or_else(|| bad(known))?;
                let element = elements
                    .last_mut()
                    .ok_or_else(|| bad("a property follows its element"))?;
                let name = String::from_utf8_lossy(name).into_owned();
                if element.named(&name).is_some() {
                    return Err(bad("a property is declared once"));
                }
                element.properties.push(Property { name, shape });
            }
            [b"end_header"] => {
                let encoding = encoding
                    .ok_or_else(|| bad("the header lacks its format line; add \"format ascii 1.0\""))?;
                let body = bytes.len() - lines.left();
                return Ok(Header {
                    encoding,
                    elements,
                    body,
                    lines: line,
                });
            }
            _ => {
                return Err(bad(
                    "a header holds format, element, property, comment and end_header lines",
                ));
            }
        }
    }
    Err(Fault::Truncated {
        what: "the header (up to \"end_header\")".into(),
        needed: bytes.len() as u64 + 1,
        found: bytes.len() as u64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_gives_elements_strides_and_the_start_of_the_body() {
        let text = b"ply\r\nformat binary_big_endian 1.0\r\ncomment x\r\nelement vertex 3\r\n\
            property double x\r\nproperty uchar c\r\nelement face 2\r\n\
            property list uchar int vertex_index\r\nend_header\r\n\nrest";
        let h = read(text).unwrap();
        assert_eq!(h.encoding, Encoding::Big);
        assert_eq!(h.elements[0].fixed_stride(), Some(9));
        assert_eq!(h.elements[1].fixed_stride(), None);
        assert_eq!(
            (
                h.elements[1].least_row(Encoding::Big),
                h.elements[1].least_row(Encoding::Ascii)
            ),
            (1, 2)
        );
        assert_eq!(&text[h.body..], b"\nrest");
    }

    #[test]
    fn header_faults_name_line_text_and_remedy() {
        for (text, line, word) in [
            ("plx\n", 1, "PLY"),
            ("ply\nformat text 1.0\n", 2, "ascii"),
            ("ply\nelement vertex -1\n", 2, "count"),
            ("ply\nproperty float x\n", 2, "follows"),
            ("ply\nelement v 1\nproperty half x\n", 3, "half"),
            ("ply\nelement v 1\nproperty list float int x\n", 3, "list"),
            ("ply\nelement v 1\nelement v 1\n", 3, "once"),
            ("ply\nelement v 1\nend_header\n", 3, "format"),
            ("ply\nwhat is this\n", 2, "what is"),
        ] {
            let e = read(text.as_bytes()).unwrap_err().to_string();
            assert!(
                e.starts_with(&format!("line {line}:")) && e.contains(word),
                "{text:?}: {e}"
            );
        }
        assert!(matches!(
            read(b"ply\nformat ascii 1.0\n"),
            Err(Fault::Truncated { .. })
        ));
    }
}
