use std::fmt;
use std::str::FromStr;

use crate::Fault;

/// Unit of length of a file's coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Unit {
    /// The file does not say; lengths are in the file's own unit.
    #[default]
    Unknown = 0,
    /// 1e-3 mm.
    Micrometre = 1,
    /// 1 mm.
    Millimetre = 2,
    /// 10 mm.
    Centimetre = 3,
    /// 1000 mm.
    Metre = 4,
}

impl Unit {
    /// Length of this unit in millimetres, if known.
    pub fn in_mm(self) -> Option<f64> {
        match self {
            Self::Unknown => None,
            Self::Micrometre => Some(1e-3),
            Self::Millimetre => Some(1.0),
            Self::Centimetre => Some(10.0),
            Self::Metre => Some(1000.0),
        }
    }

    /// The unit stored under `code`, the number of its variant.
    pub fn from_code(code: u8) -> Option<Self> {
        [
            Self::Unknown,
            Self::Micrometre,
            Self::Millimetre,
            Self::Centimetre,
            Self::Metre,
        ]
        .into_iter()
        .find(|u| *u as u8 == code)
    }

    /// Factor to millimetres of `what`, whose file was in `found`, once the user stated this unit.
    pub(crate) fn scale_for(self, what: &str, found: Self) -> Result<f64, Fault> {
        match (found, self.in_mm()) {
            (Self::Unknown, Some(scale)) => Ok(scale),
            _ => Err(Fault::Value {
                what: "the unit",
                value: format!("stated as {self} for a {what} in {found}"),
                remedy: "state um, mm, cm or m, once, for a file that names no unit",
            }),
        }
    }

    /// Symbol: `mm`, `cm`, `m`, `um`, or `file unit`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Unknown => "file unit",
            Self::Micrometre => "um",
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Metre => "m",
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol())
    }
}

impl FromStr for Unit {
    type Err = String;

    /// Reads a symbol as given on a command line.
    fn from_str(s: &str) -> Result<Self, String> {
        match s {
            "um" | "µm" => Ok(Self::Micrometre),
            "mm" => Ok(Self::Millimetre),
            "cm" => Ok(Self::Centimetre),
            "m" => Ok(Self::Metre),
            _ => Err(format!("unit {s:?} is not known; use um, mm, cm or m")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_symbols_come_back_as_the_same_unit() {
        for code in 0..=4 {
            let unit = Unit::from_code(code).unwrap();
            assert_eq!(unit as u8, code);
            if unit != Unit::Unknown {
                assert_eq!(unit.symbol().parse::<Unit>(), Ok(unit));
            }
        }
        assert_eq!(Unit::from_code(5), None);
        assert!("inch".parse::<Unit>().unwrap_err().contains("inch"));
    }
}
