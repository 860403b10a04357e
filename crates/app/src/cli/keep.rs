use std::fmt;
use std::str::FromStr;

use bspline::polygonize::Mesh;
use formats::Unit;
use serde::Serialize;

use super::failure::{Failure, Outcome};
use super::quantity::{human_count, human_number, positive};
use super::trim::drop_marked;
use crate::pieces::{Part, Pieces};

/// Which pieces of a surface are kept, by the volume that they enclose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Keep {
    /// So many of the largest.
    Largest(usize),
    /// Those that enclose at least so much, in a unit of length cubed.
    Volume(f64, Unit),
    /// Those that enclose at least so many per cent of the largest.
    Percent(f64),
}

/// What was left out of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LeftOut {
    /// Pieces in the mesh.
    pub pieces_kept: usize,
    /// Pieces that are not.
    pub pieces_left_out: usize,
    /// Cavities of pieces that were kept, filled.
    pub cavities_filled: usize,
    /// Triangles of both.
    pub triangles_left_out: usize,
    /// What the largest piece that is not there encloses, in the unit of the field cubed.
    pub largest_left_out: f64,
}

/// Units of `VOLUME`; the last is the field's own.
const UNITS: [(&str, Unit); 5] = [
    ("um3", Unit::Micrometre),
    ("mm3", Unit::Millimetre),
    ("cm3", Unit::Centimetre),
    ("unit3", Unit::Unknown),
    ("m3", Unit::Metre),
];

impl FromStr for Keep {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let text = s.trim();
        let remedy = "write largest, a number of pieces (3), or the least volume of a piece: 5mm3, 0.2cm3, 5unit3 (in \
                      the field's own unit), 1% (of the largest)";
        if text == "largest" {
            return Ok(Self::Largest(1));
        }
        let amount = |n: &str| positive(n.trim_end()).map_err(|e| format!("{e}; {remedy}"));
        if let Some(n) = text.strip_suffix('%') {
            return match amount(n)? {
                share if share <= 100.0 => Ok(Self::Percent(share)),
                share => Err(format!(
                    "{share} is more than 100 per cent of the largest; {remedy}"
                )),
            };
        }
        if let Some((n, unit)) = UNITS
            .iter()
            .find_map(|(name, unit)| Some((text.strip_suffix(name)?, unit)))
        {
            return Ok(Self::Volume(amount(n)?, *unit));
        }
        match text.parse::<usize>() {
            Ok(n) if n > 0 => Ok(Self::Largest(n)),
            _ => Err(format!("neither a number of pieces nor a volume; {remedy}")),
        }
    }
}

impl fmt::Display for Keep {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Largest(n) => write!(f, "{n}"),
            Self::Percent(share) => write!(f, "{share}%"),
            Self::Volume(volume, unit) => {
                let name = UNITS.iter().find(|u| u.1 == *unit).map_or("", |u| u.0);
                write!(f, "{volume}{name}")
            }
        }
    }
}

impl Keep {
    /// Drops the other pieces from `mesh`, whose lengths are in `unit`. A cavity stays with the piece around it, unless
    /// it is smaller than the volume asked for. `None` if nothing is left out.
    ///
    /// # Errors
    /// Wrong usage, if no piece is as large, or if the volume has a unit and the field has none.
    pub fn apply(self, mesh: &mut Mesh, unit: Unit) -> Outcome<Option<LeftOut>> {
        let pieces = Pieces::of(mesh);
        let size = |p: &Part| p.volume.abs();
        let mut order: Vec<usize> = (0..pieces.parts.len())
            .filter(|&i| pieces.parts[i].owner.is_none())
            .collect();
        order.sort_by(|&a, &b| size(&pieces.parts[b]).total_cmp(&size(&pieces.parts[a])));
        let Some(&first) = order.first() else {
            return Ok(None);
        };
        let largest = size(&pieces.parts[first]);
        let (most, least) = match self {
            Self::Largest(n) => (n, 0.0),
            Self::Percent(share) => (usize::MAX, 0.01 * share * largest),
            Self::Volume(volume, stated) => (usize::MAX, volume * self.scale(stated, unit)?),
        };
        if largest < least {
            return Err(Failure::usage(format!(
                "--keep {self}: the largest piece encloses only {}; give a smaller volume",
                volume_text(largest, unit)
            )));
        }
        let mut is_kept = vec![false; pieces.parts.len()];
        for &i in order.iter().take(most) {
            is_kept[i] = size(&pieces.parts[i]) >= least;
        }
        let mut left = LeftOut {
            pieces_kept: order.iter().filter(|&&i| is_kept[i]).count(),
            ..Default::default()
        };
        left.pieces_left_out = order.len() - left.pieces_kept;
        left.largest_left_out = (order.iter().filter(|&&i| !is_kept[i]))
            .map(|&i| size(&pieces.parts[i]))
            .fold(0.0, f64::max);
        for (i, part) in pieces.parts.iter().enumerate() {
            if let Some(owner) = part.owner.filter(|&o| is_kept[o]) {
                is_kept[i] = is_kept[owner] && size(part) >= least;
                left.cavities_filled += usize::from(!is_kept[i]);
            }
        }
        let dropped: Vec<bool> = pieces.part_of.iter().map(|&p| !is_kept[p as usize]).collect();
        left.triangles_left_out = dropped.iter().filter(|d| **d).count();
        if left.triangles_left_out == 0 {
            return Ok(None);
        }
        drop_marked(mesh, &dropped);
        Ok(Some(left))
    }

    /// Cubes of the field's unit in one of the unit stated.
    fn scale(self, stated: Unit, field: Unit) -> Outcome<f64> {
        match (stated.in_mm(), field.in_mm()) {
            (None, _) => Ok(1.0),
            (Some(s), Some(f)) => Ok((s / f).powi(3)),
            (Some(_), None) => Err(Failure::usage(format!(
                "--keep {self}: the field does not name its unit; state it by --unit, or give the volume in that unit \
                 (5unit3) or in per cent of the largest piece (1%)"
            ))),
        }
    }
}

impl LeftOut {
    /// A sentence for people.
    pub fn note(&self, unit: Unit) -> String {
        let mut parts = Vec::new();
        if self.pieces_left_out > 0 {
            parts.push(format!(
                "{} of {} pieces of the surface were left out, the largest of them encloses {}",
                human_count(self.pieces_left_out),
                human_count(self.pieces_kept + self.pieces_left_out),
                volume_text(self.largest_left_out, unit)
            ));
        }
        if self.cavities_filled > 0 {
            parts.push(format!(
                "{} cavities were filled",
                human_count(self.cavities_filled)
            ));
        }
        format!(
            "{} ({} triangles)",
            parts.join("; "),
            human_count(self.triangles_left_out)
        )
    }
}

fn volume_text(volume: f64, unit: Unit) -> String {
    match unit {
        Unit::Unknown => format!("{} cubic units of the field", human_number(volume)),
        unit => format!("{} {unit}³", human_number(volume)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grammar_of_what_is_kept() {
        let parse = |s: &str| s.parse::<Keep>();
        assert_eq!(parse("largest"), Ok(Keep::Largest(1)));
        assert_eq!(parse("3"), Ok(Keep::Largest(3)));
        assert_eq!(parse("5mm3"), Ok(Keep::Volume(5.0, Unit::Millimetre)));
        assert_eq!(parse("0.2 cm3"), Ok(Keep::Volume(0.2, Unit::Centimetre)));
        assert_eq!(parse("2m3"), Ok(Keep::Volume(2.0, Unit::Metre)));
        assert_eq!(parse("7unit3"), Ok(Keep::Volume(7.0, Unit::Unknown)));
        assert_eq!(parse("1%"), Ok(Keep::Percent(1.0)));
        for bad in [
            "", "0", "-1", "2.5", "5mm", "5mm2", "mm3", "0mm3", "nan%", "101%", "all", "1e3",
        ] {
            let e = parse(bad).unwrap_err();
            assert!(e.contains("5mm3"), "{bad:?}: {e}");
        }
        for said in ["3", "5mm3", "0.2cm3", "7unit3", "1%"] {
            assert_eq!(parse(said).unwrap().to_string(), said);
        }
    }
}
