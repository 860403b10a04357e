//! The points that an object was fitted to, from the scan, if that is at hand.

use std::path::{Path, PathBuf};

use document::Samples;
use formats::Kind;
use glam::DVec3;
use serde_json::Value;

use super::make::{Answer, Made};
use crate::cli::input::limits;
use crate::cli::quantity::human_count;
use crate::view::Stretch;
use crate::window::orders::Thing;

/// Most points that are drawn.
const MOST: usize = 60_000;
/// Blue: told from clay by all eyes.
const COLOR: [u8; 4] = [90, 190, 255, 255];

/// Dots for the points of the scan that an object was fitted to; `scans` are files that may be it, and directories that may have it.
pub fn points(thing: &Thing, scans: &[PathBuf], origin: DVec3) -> Result<Answer, String> {
    let meta = &thing.object.meta;
    let from: Value = serde_json::from_str(&meta.provenance).unwrap_or_default();
    let name = from["input"]
        .as_str()
        .ok_or_else(|| format!("{} was fitted to no file that it knows of", thing.name))?;
    if from["input_kind"] == "volume" {
        return Err(format!("{name} is a volume, which has no points"));
    }
    let found = scans.iter().rev().map(|at| match at.is_dir() {
        true => at.join(name),
        false => at.clone(),
    });
    let mut found = found.filter(|path| path.file_name().is_some_and(|n| n == name) && path.is_file());
    let path = found
        .next()
        .ok_or_else(|| format!("{name} is not at hand; open it, or put it beside the document"))?;
    let places = read(&path, thing)?;
    let step = places.len().div_ceil(MOST).max(1);
    let dots = places.iter().step_by(step).map(|p| {
        let p = (thing.world_from_object.transform_point3(*p) - origin)
            .as_vec3()
            .to_array();
        Stretch {
            start: p,
            end: p,
            color: COLOR,
        }
    });
    let dots: Vec<Stretch> = dots.collect();
    let told = match step {
        1 => format!("{} points", human_count(places.len())),
        _ => format!(
            "{} of {} points, one in {step}",
            human_count(dots.len()),
            human_count(places.len())
        ),
    };
    Ok((Made::Lines(dots), None, told))
}

/// The points of a file, which has to be the one that an object was fitted to.
fn read(path: &Path, thing: &Thing) -> Result<Vec<DVec3>, String> {
    let meta = &thing.object.meta;
    let told = |e: formats::FormatError| e.to_string();
    let name = path.display().to_string();
    let check = |samples: Samples| match samples.differ_from(meta, &thing.own_box, &thing.name, &name) {
        Some(_) => Err(format!(
            "{name} is another scan than the one that {} was fitted to",
            thing.name
        )),
        None => Ok(()),
    };
    let kind = formats::detect(path).map_err(told)?;
    let is_mesh = serde_json::from_str::<Value>(&meta.provenance).is_ok_and(|v| v["input_kind"] == "mesh");
    match (kind, is_mesh) {
        (Kind::Cloud(_) | Kind::Mesh(_), false) => {
            let cloud = formats::points::read(path, &limits(None)).map_err(told)?;
            check(Samples::Cloud(&cloud.positions))?;
            Ok(cloud.positions)
        }
        (Kind::Cloud(_) | Kind::Mesh(_), true) => {
            let mesh = formats::meshes::read(path, &limits(None)).map_err(told)?;
            check(Samples::Mesh(&mesh.vertices, &mesh.triangles))?;
            Ok(mesh.vertices)
        }
        (kind, _) => Err(format!("{name} is a {kind}, which has no points")),
    }
}

#[cfg(test)]
mod tests {
    use document::{Object, State};
    use formats::field::{FieldMeta, SourceKind};
    use serde_json::json;

    use super::*;
    use crate::cli::desk_files;

    fn cloud(path: &Path, shift: f64) -> Vec<DVec3> {
        let points: Vec<DVec3> = (0..50)
            .map(|n| DVec3::new(f64::from(n) * 0.25 + shift, 1.0, -2.0))
            .collect();
        let lines: Vec<String> = points
            .iter()
            .map(|p| format!("{} {} {}", p.x, p.y, p.z))
            .collect();
        std::fs::write(path, lines.join("\n")).unwrap();
        points
    }

    fn fitted(name: &str, points: &[DVec3]) -> Thing {
        let samples = Samples::Cloud(points);
        let provenance = json!({
            "input": name,
            "input_kind": samples.kind(),
            "input_digest": samples.digest(),
        });
        let meta = FieldMeta {
            iso: Some(0.0),
            source: SourceKind::Cloud,
            provenance: provenance.to_string(),
            ..FieldMeta::default()
        };
        let (_, Object { field, .. }) = desk_files::clay_block().unwrap();
        let state = State::new().with("clay", Object::of(field, meta)).unwrap();
        Thing::of(&state, "clay").unwrap()
    }

    #[test]
    fn points_come_from_the_scan_that_was_fitted_and_no_other() {
        let scratch = tempfile::tempdir().unwrap();
        let scan = scratch.path().join("scan.xyz");
        let thing = fitted("scan.xyz", &cloud(&scan, 0.0));
        // By itself, or beside the document.
        for at in [scan.clone(), scratch.path().to_path_buf()] {
            let (made, _, told) = points(&thing, &[at], DVec3::ONE).unwrap();
            let Made::Lines(dots) = made else {
                panic!("no dots")
            };
            assert_eq!((dots.len(), told.as_str()), (50, "50 points"));
            assert_eq!(
                (dots[3].start, dots[3].end),
                ([-0.25, 0.0, -3.0], [-0.25, 0.0, -3.0])
            );
        }
        let why = |scans: &[PathBuf]| points(&thing, scans, DVec3::ZERO).err().unwrap();
        assert!(why(&[]).contains("open it"), "{}", why(&[]));
        cloud(&scan, 1.0);
        assert!(why(&[scan]).contains("another scan"));
    }
}
