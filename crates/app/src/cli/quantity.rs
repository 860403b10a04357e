use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;
use std::time::Duration;

pub use document::{human_count, human_number};
use formats::Unit;

/// A tolerance as the user wrote it: `T`, `Tmm` or `T%`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// In the unit of the file: a length for clouds, a density for volumes.
    Plain(f64),
    /// Millimetres.
    Mm(f64),
    /// Per cent of the diagonal (clouds) or of the range between the 1st and the 99th percentile (volumes).
    Percent(f64),
}

impl Tolerance {
    /// World length, given the diagonal of the points' box and the unit of the file, if known.
    ///
    /// # Errors
    /// A sentence with the remedy, if millimetres are asked of a file whose unit nobody knows.
    pub fn length(self, diagonal: f64, unit: Unit) -> Result<f64, String> {
        match (self, unit.in_mm()) {
            (Self::Plain(t), _) => Ok(t),
            (Self::Percent(t), _) => Ok(t * 0.01 * diagonal),
            (Self::Mm(t), Some(mm)) => Ok(t / mm),
            (Self::Mm(t), None) => Err(format!(
                "--tolerance {t}mm needs the unit of the coordinates, which the file does not tell; \
                 give --unit mm, cm or m to fit, or a tolerance in the file's own unit ({t}) or in per cent of \
                 the diagonal (0.01%)"
            )),
        }
    }

    /// Density, given the range between the 1st and the 99th percentile of the volume.
    ///
    /// # Errors
    /// A sentence with the remedy, if a length is asked of a volume.
    pub fn density(self, range: f64) -> Result<f64, String> {
        match self {
            Self::Plain(t) => Ok(t),
            Self::Percent(t) => Ok(t * 0.01 * range),
            Self::Mm(t) => Err(format!(
                "--tolerance {t}mm is a length, but the tolerance of a volume is a density; \
                 give it in the volume's own unit ({t}) or in per cent of its range (0.5%)"
            )),
        }
    }
}

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let text = s.trim();
        let (number, make): (&str, fn(f64) -> Self) = if let Some(n) = text.strip_suffix("mm") {
            (n, Self::Mm)
        } else if let Some(n) = text.strip_suffix('%') {
            (n, Self::Percent)
        } else {
            (text, Self::Plain)
        };
        positive(number.trim_end()).map(make).map_err(|e| {
            format!("{e}; write a number, with mm or % behind it if you like: 0.2, 0.2mm, 0.01%")
        })
    }
}

/// A finite number above zero.
///
/// # Errors
/// A sentence, if it is something else.
pub fn positive(s: &str) -> Result<f64, String> {
    match s.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        Ok(x) => Err(format!("{x} is not a finite number above zero")),
        Err(_) => Err(format!("{s:?} is not a number")),
    }
}

/// A number of threads.
///
/// # Errors
/// A sentence, if it is none or too many.
pub fn threads(s: &str) -> Result<NonZeroUsize, String> {
    match s.parse::<NonZeroUsize>() {
        Ok(n) if n.get() <= 1024 => Ok(n),
        _ => Err("write a whole number from 1 to 1024".into()),
    }
}

/// A parser of whole numbers from `low` to `high`.
pub fn between<T>(low: T, high: T) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + fmt::Display + Copy + Send + Sync + 'static,
{
    move |s| match s.parse::<T>() {
        Ok(n) if low <= n && n <= high => Ok(n),
        _ => Err(format!("write a whole number from {low} to {high}")),
    }
}

/// A time, as in 90s, 10m or 2h; seconds without a unit.
///
/// # Errors
/// A sentence, if it is something else.
pub fn duration(s: &str) -> Result<Duration, String> {
    let text = s.trim();
    let units = [("s", 1.0), ("m", 60.0), ("h", 3600.0), ("d", 86400.0)];
    let (number, unit) = (units.iter())
        .find_map(|(name, seconds)| Some((text.strip_suffix(name)?, *seconds)))
        .unwrap_or((text, 1.0));
    let time = positive(number.trim_end()).map(|n| Duration::try_from_secs_f64(n * unit));
    match time {
        Ok(Ok(time)) => Ok(time),
        Ok(Err(_)) => Err("too long; write a time: 90s, 10m, 2h".into()),
        Err(e) => Err(format!("{e}; write a time: 90s, 10m, 2h")),
    }
}

/// A whole number above zero.
///
/// # Errors
/// A sentence, if it is something else.
pub fn count(s: &str) -> Result<NonZeroUsize, String> {
    s.parse()
        .map_err(|_| "write a whole number above zero, in digits".into())
}

/// A finite number.
///
/// # Errors
/// A sentence, if it is something else.
pub fn finite(s: &str) -> Result<f64, String> {
    match s.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(x) => Err(format!("{x} is not finite")),
        Err(_) => Err(format!("{s:?} is not a number")),
    }
}

/// A size in memory: `2GiB`, `512MiB`, `1.5GB`, or plain bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory(pub u64);

impl FromStr for Memory {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        const UNITS: [(&str, f64); 9] = [
            ("KiB", 1024.0),
            ("MiB", 1048576.0),
            ("GiB", 1073741824.0),
            ("TiB", 1099511627776.0),
            ("kB", 1e3),
            ("MB", 1e6),
            ("GB", 1e9),
            ("TB", 1e12),
            ("B", 1.0),
        ];
        let text = s.trim();
        let (number, scale) = UNITS
            .iter()
            .find_map(|(name, scale)| text.strip_suffix(name).map(|n| (n.trim_end(), *scale)))
            .unwrap_or((text, 1.0));
        let bytes = positive(number)
            .map_err(|e| format!("{e}; write a size such as 2GiB, 512MiB, 1.5GB or a number of bytes"))?
            * scale;
        if !(1.0..1e18).contains(&bytes) {
            return Err(format!("{s} is out of range; write a size such as 2GiB"));
        }
        Ok(Self(bytes as u64))
    }
}

/// `bytes` for people: `640 B`, `1.2 MiB`.
pub fn human_bytes(bytes: u64) -> String {
    let mut value = bytes as f64;
    for unit in ["B", "KiB", "MiB", "GiB"] {
        if value < 1024.0 {
            return if unit == "B" {
                format!("{value:.0} B")
            } else {
                format!("{value:.1} {unit}")
            };
        }
        value /= 1024.0;
    }
    format!("{value:.1} TiB")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerance_grammar() {
        let parse = |s: &str| s.parse::<Tolerance>();
        assert_eq!(parse("0.2"), Ok(Tolerance::Plain(0.2)));
        assert_eq!(parse("2e-3mm"), Ok(Tolerance::Mm(0.002)));
        assert_eq!(parse("0.5 mm"), Ok(Tolerance::Mm(0.5)));
        assert_eq!(parse(".01%"), Ok(Tolerance::Percent(0.01)));
        assert_eq!(parse(" 3 % "), Ok(Tolerance::Percent(3.0)));
        for bad in [
            "", "%", "mm", "0", "-1", "nan", "inf", "1cm", "1m", "1e400", "1%%", "0%", "x", "1,5",
        ] {
            let e = parse(bad).unwrap_err();
            assert!(
                e.contains("0.2mm"),
                "{bad:?} must be refused with a remedy, got {e:?}"
            );
        }
    }

    #[test]
    fn tolerance_becomes_a_length_of_the_file() {
        assert_eq!(Tolerance::Plain(0.2).length(10.0, Unit::Unknown), Ok(0.2));
        assert_eq!(Tolerance::Percent(1.0).length(250.0, Unit::Unknown), Ok(2.5));
        assert_eq!(Tolerance::Mm(2.0).length(1.0, Unit::Metre), Ok(0.002));
        assert_eq!(Tolerance::Mm(2.0).length(1.0, Unit::Centimetre), Ok(0.2));
        assert!(
            Tolerance::Mm(2.0)
                .length(1.0, Unit::Unknown)
                .unwrap_err()
                .contains("--unit")
        );
    }

    #[test]
    fn tolerance_becomes_a_density_of_the_volume() {
        assert_eq!(Tolerance::Plain(3.0).density(100.0), Ok(3.0));
        assert_eq!(Tolerance::Percent(0.5).density(200.0), Ok(1.0));
        assert!(Tolerance::Mm(0.5).density(200.0).unwrap_err().contains("density"));
    }

    #[test]
    fn time_grammar() {
        assert_eq!(duration("90"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("1.5 m"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("2h"), Ok(Duration::from_secs(7200)));
        for bad in ["", "0", "-1s", "1w", "nan", "1e300h"] {
            assert!(duration(bad).unwrap_err().contains("10m"), "{bad:?}");
        }
    }

    #[test]
    fn memory_grammar() {
        let parse = |s: &str| s.parse::<Memory>().map(|m| m.0);
        assert_eq!(parse("2GiB"), Ok(2 << 30));
        assert_eq!(parse("512 MiB"), Ok(512 << 20));
        assert_eq!(parse("1.5GB"), Ok(1_500_000_000));
        assert_eq!(parse("100kB"), Ok(100_000));
        assert_eq!(parse("4096"), Ok(4096));
        assert_eq!(parse("4096B"), Ok(4096));
        for bad in ["", "GiB", "0", "-1GiB", "2Gib", "2 G", "1e30GiB", "nan", "0.1B"] {
            assert!(
                parse(bad).unwrap_err().contains("2GiB"),
                "{bad:?} must be refused with a remedy"
            );
        }
    }

    #[test]
    fn numbers_for_people() {
        assert_eq!(human_bytes(0), "0 B");
        assert_eq!(human_bytes(1536), "1.5 KiB");
        assert_eq!(human_bytes(3 << 30), "3.0 GiB");
        assert_eq!(human_count(7), "7");
        assert_eq!(human_count(34834), "34 834");
        assert_eq!(human_count(1234567), "1 234 567");
        assert_eq!(human_number(0.0), "0");
        assert_eq!(human_number(-0.0), "0");
        assert_eq!(human_number(0.012346), "0.01235");
        assert_eq!(human_number(1234.56), "1235");
        assert_eq!(human_number(1.5e-9), "1.500e-9");
    }
}
