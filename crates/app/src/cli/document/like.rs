//! Edited scans: `isoclay export --like`.

use std::path::Path;

use bspline::HierarchicalSpline;
use document::{Command, Document, Journey, Object, revise_cloud, revise_volume};
use formats::Fault;
use formats::field::FieldMeta;
use formats::points::PointCloud;
use formats::volumes::{Revision, Volume, save_revised};

use super::failure;
use crate::cli::belongs;
use crate::cli::failure::{Failure, Outcome};
use crate::cli::input::{self, Input, limits, writing};
use crate::cli::quantity::{human_count, human_number};
use crate::cli::source::Source;
use crate::cli::volume_choice::VolumeChoice;

/// Density of air in Hounsfield units.
const AIR: f64 = -1000.0;

/// Share of a volume's voxels that are taken for air where nothing names its unit.
const THINNEST: f64 = 0.01;

/// A scan to be written with an object's edits.
pub struct Like<'a> {
    /// The scan.
    pub source: &'a Source,
    /// How to read it.
    pub choice: &'a VolumeChoice,
    /// Density of what was carved, if the user says it.
    pub fill: Option<f64>,
}

impl Like<'_> {
    /// Writes the scan with what was done to an object since the document began; returns what is to be told.
    pub fn export(&self, document: &mut Document, name: &str, output: &Path) -> Outcome<Vec<String>> {
        let (fitted, now) = versions(document, name)?;
        let input = input::read(self.source, None, self.choice, None, None)?;
        let extent = fitted.field.world_box();
        let differs = belongs::differs(
            &fitted.meta,
            &extent,
            &format!("object {name:?}"),
            &input,
            self.source.name(),
        );
        if let Some(differs) = differs {
            return Err(Failure::usage(format!(
                "{differs}; give the whole scan that it was fitted to"
            )));
        }
        let identity = document.state().sha256();
        // The box may have grown since.
        let fitted = fitted.in_box_of(&now);
        let journey = Journey::new(&done(document)?, name, &now.field.world_box());
        match input {
            Input::Volume(volume) => self.volume([&fitted, &now], &journey, &volume, &identity, output),
            Input::Cloud(cloud) => self.cloud([&fitted, &now], &journey, &cloud, output),
            Input::Mesh(_) => Err(Failure::usage(format!(
                "{}: volumes and clouds are written back, and this is a mesh; mesh the object, or export its field",
                self.source.name()
            ))),
        }
    }

    fn cloud(
        &self,
        [fitted, now]: [&Object; 2],
        journey: &Journey,
        cloud: &PointCloud,
        output: &Path,
    ) -> Outcome<Vec<String>> {
        let left_out = cloud.file_count - cloud.positions.len();
        if left_out > 0 {
            return Err(Failure::input(format!(
                "{}: {} of its points were left out when it was read, so that rows cannot be told; convert the scan and fit that",
                self.source.name(),
                human_count(left_out)
            )));
        }
        let iso = now.iso().unwrap_or(0.0);
        let changes = revise_cloud(scan_of(fitted)?, scan_of(now)?, &cloud.positions, iso, journey)
            .map_err(|e| Failure::input(format!("{e}; was the object replaced?")))?;
        formats::points::save_revised(self.source.path(), &changes, output, &limits(None)).map_err(|e| {
            match e.fault {
                Fault::Io { .. } => writing(e),
                _ => self.source.reading(e),
            }
        })?;
        let count = |n: usize| human_count(n);
        Ok(vec![format!(
            "{} of {} points moved with the surface, {} are on no surface any more, {} are new (behind those of the scan)",
            count(changes.moved.len()),
            count(cloud.positions.len()),
            count(changes.removed.len()),
            count(changes.added.len()),
        )])
    }

    fn volume(
        &self,
        [fitted, now]: [&Object; 2],
        journey: &Journey,
        volume: &Volume,
        identity: &[u8; 32],
        output: &Path,
    ) -> Outcome<Vec<String>> {
        let iso = now
            .meta
            .iso
            .ok_or_else(|| Failure::input("the object names no surface"))?;
        let fill = self.fill.unwrap_or_else(|| air(&now.meta, volume));
        let revision = revise_volume(scan_of(fitted)?, scan_of(now)?, volume, iso, fill, journey)
            .map_err(|e| Failure::input(format!("{e}; was the object replaced?")))?;
        let options = self.choice.options(None)?;
        let path = self.source.path();
        let told = save_revised(path, &options, &revision.changes, identity, output, &limits(None)).map_err(
            |e| match e.fault {
                Fault::Io { .. } => writing(e.fault.at(output)),
                _ => self.source.reading(e),
            },
        )?;
        Ok(sentences(&revision, &told, volume, fill))
    }
}

/// The field of an object that was fitted to a scan.
fn scan_of(object: &Object) -> Outcome<&HierarchicalSpline<f32>> {
    let why = "the object is a block on knots of its own, fitted to no scan; export its field, or mesh it";
    object.field.levels().ok_or_else(|| Failure::usage(why))
}

/// What was done to a document.
fn done(document: &mut Document) -> Outcome<Vec<Command>> {
    let count = document.counts().map_err(failure)?.done;
    let commands = (0..count).map(|n| {
        let value = document.command(n).map_err(failure)?;
        // What another version of the program wrote is no move that this one knows.
        Ok(serde_json::from_value(value).ok())
    });
    commands.filter_map(Outcome::transpose).collect()
}

/// An object as it was before the first edit, and as it is.
fn versions(document: &mut Document, name: &str) -> Outcome<(Object, Object)> {
    let forgotten = document.counts().map_err(failure)?.forgotten;
    if forgotten > 0 {
        return Err(Failure::input(format!(
            "the document has forgotten its first {} edits, and with them the field of the fit; export the field and \
             sample it like the scan",
            human_count(forgotten as usize)
        )));
    }
    let first = document.first_state().map_err(failure)?;
    let now = document.state().object(name).map_err(failure)?.clone();
    match first.objects().get(name) {
        Some(fitted) => Ok((fitted.clone(), now)),
        None => Err(Failure::input(format!(
            "object {name:?} was not there when the document began; only what was fitted to a scan can be written back"
        ))),
    }
}

/// The density of what is taken out.
fn air(meta: &FieldMeta, volume: &Volume) -> f64 {
    if meta.density_unit == "HU" {
        return AIR;
    }
    let mut values = volume.values.clone();
    let rank = (values.len() as f64 * THINNEST) as usize;
    let (_, value, _) = values.select_nth_unstable_by(rank, f32::total_cmp);
    f64::from(*value)
}

fn sentences(
    revision: &document::VolumeRevision,
    told: &Revision,
    volume: &Volume,
    fill: f64,
) -> Vec<String> {
    let mut notes = vec![format!(
        "{} of {} voxels changed, {} left the solid and {} joined it",
        human_count(told.changed),
        human_count(volume.values.len()),
        human_count(revision.carved),
        human_count(revision.added),
    )];
    if revision.is_filled() {
        notes.push(format!(
            "what was carved has density {} (--fill)",
            human_number(fill)
        ));
    }
    if told.rounding > 0.0 {
        notes.push(format!(
            "voxels are {}: densities are off by at most {}",
            volume.header.stored,
            human_number(told.rounding)
        ));
    }
    if told.clamped > 0 {
        notes.push(format!(
            "{} densities are beyond what {} can hold; the nearest that it can was written",
            human_count(told.clamped),
            volume.header.stored
        ));
    }
    notes
}
