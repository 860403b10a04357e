//! What the coordinate system of a LAS file says about lengths.

use super::header::{Header, u16_at};
use crate::Unit;

/// Keys of GeoTIFF: the kind of the system, and its unit of length.
const MODEL: u16 = 1024;
const LINEAR_UNIT: u16 = 3076;
const GEOGRAPHIC: u16 = 2;
const METRE: u16 = 9001;

/// The unit, and a doubt about it.
pub(in crate::points) fn of(header: &Header) -> (Unit, Option<String>) {
    if let Some(text) = header.record("LASF_Projection", 2112) {
        return of_text(&String::from_utf8_lossy(text));
    }
    let Some(keys) = header.record("LASF_Projection", 34735).filter(|k| k.len() >= 8) else {
        return (Unit::Unknown, None);
    };
    let entry = |wanted: u16| {
        let mut all = keys[8..].chunks_exact(8);
        // A value in place has no location.
        all.find(|e| u16_at(e, 0) == wanted && u16_at(e, 2) == 0)
            .map(|e| u16_at(e, 6))
    };
    match (entry(MODEL), entry(LINEAR_UNIT)) {
        (Some(GEOGRAPHIC), _) => (Unit::Unknown, Some(DEGREES.into())),
        (_, Some(METRE)) => (Unit::Metre, None),
        (_, Some(code)) => (
            Unit::Unknown,
            Some(format!("its unit of length has the EPSG code {code}{OTHER}")),
        ),
        (_, None) => (Unit::Unknown, None),
    }
}

const DEGREES: &str =
    "its coordinates are degrees of longitude and latitude, not lengths: project the file first";
const OTHER: &str = "; lengths were left as they are";

/// From well-known text: `UNIT["metre",1]` of the system's own lengths, whose angles have units, too.
fn of_text(text: &str) -> (Unit, Option<String>) {
    let upper = text.trim_start().to_ascii_uppercase();
    if upper.starts_with("GEOGCS") || upper.starts_with("GEOGCRS") || upper.starts_with("GEODCRS") {
        return (Unit::Unknown, Some(DEGREES.into()));
    }
    let mut lengths = Vec::new();
    for (at, _) in upper.match_indices("UNIT[\"") {
        let before = &upper[..at];
        let name = upper[at + 6..].split('"').next().unwrap_or("");
        let is_angle = before.ends_with("ANGLE")
            || name.starts_with("DEGREE")
            || name.starts_with("GRAD")
            || name.starts_with("RADIAN");
        let is_scale = before.ends_with("SCALE") || before.ends_with("TIME") || name == "UNITY";
        if !is_angle && !is_scale {
            lengths.push(name);
        }
    }
    match lengths
        .iter()
        .find(|n| !matches!(**n, "METRE" | "METER" | "METERS" | "METRES" | "M"))
    {
        Some(other) => {
            let short: String = other.chars().take(40).collect();
            (
                Unit::Unknown,
                Some(format!("its unit of length is {short:?}{OTHER}")),
            )
        }
        None if lengths.is_empty() => (Unit::Unknown, None),
        None => (Unit::Metre, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn well_known_text_gives_its_length_and_not_its_angle() {
        let geographic = "GEOGCS[\"WGS 84\",DATUM[\"x\"],UNIT[\"degree\",0.0174532925199433]]";
        let projected =
            |unit: &str| format!("PROJCS[\"UTM\",{geographic},PROJECTION[\"tm\"],UNIT[\"{unit}\",1]]");
        assert_eq!(of_text(&projected("metre")), (Unit::Metre, None));
        let compound = format!(
            "COMPD_CS[\"x\",{},VERT_CS[\"h\",UNIT[\"US survey foot\",0.3]]]",
            projected("metre")
        );
        for (text, part) in [
            (projected("US survey foot"), "SURVEY FOOT"),
            (compound, "SURVEY FOOT"),
            (geographic.into(), "degrees"),
        ] {
            let (unit, doubt) = of_text(&text);
            assert_eq!(unit, Unit::Unknown);
            assert!(doubt.unwrap().contains(part), "{text}");
        }
        let newer = "PROJCRS[\"x\",BASEGEOGCRS[\"y\",ANGLEUNIT[\"degree\",0.01]],SCALEUNIT[\"unity\",1],LENGTHUNIT[\"metre\",1]]";
        assert_eq!(of_text(newer), (Unit::Metre, None));
        assert_eq!(of_text("LOCAL_CS[\"nothing said\"]"), (Unit::Unknown, None));
    }
}
