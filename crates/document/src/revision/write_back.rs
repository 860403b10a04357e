//! A scan written with the edits of the object that was fitted to it.

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use bspline::{Aabb, HierarchicalSpline};
use fitting::volume::padding;
use formats::field::FieldMeta;
use formats::points::PointCloud;
use formats::volumes::{Revision, Volume, VolumeOptions, save_revised};
use formats::{Fault, FormatError, ReadLimits};

use super::journey::names;
use super::{CloudError, Journey, VolumeRevision, revise_cloud, revise_volume};
use crate::canvas::others;
use crate::{Command, Document, DocumentError, Object, human_count, human_number};

/// Share of a volume's voxels that are below what is taken for air.
const THINNEST: f64 = 0.01;

/// What became of an object since the document began.
pub struct Course {
    whole: Span,
    /// Where strokes said that another density is the surface: what was done between them. An edit means the surface of its time.
    spans: Vec<Span>,
    /// Names the document's state.
    identity: [u8; 32],
    /// The box that it had.
    extent: Aabb,
}

/// Edits one after the other.
struct Span {
    /// The object before them, in the box that it has now.
    before: Object,
    /// The object behind them.
    after: Object,
    /// What they moved.
    journey: Journey,
}

/// Why a scan is not written with edits.
#[derive(Debug, thiserror::Error)]
pub enum WriteBackError {
    /// The document cannot be read, or has no such object.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The object is of no scan.
    #[error("{0}")]
    NoScan(&'static str),
    /// The document does not go back to a fit, or one without a surface.
    #[error("{0}")]
    NoFit(String),
    /// Rows of the scan cannot be told from each other.
    #[error(
        "{0} of its points were left out when it was read, so that rows cannot be told; convert the scan and fit that"
    )]
    LeftOut(String),
    /// The two are no versions of one field.
    #[error("{0}; was the object replaced?")]
    Replaced(#[source] CloudError),
    /// The scan cannot be read.
    #[error(transparent)]
    Reading(FormatError),
    /// The output cannot be written.
    #[error(transparent)]
    Writing(FormatError),
}

/// The edits of a document, with a way back to what there was before each.
struct Past<'a> {
    document: &'a mut Document,
    /// Those that this version of the program knows.
    commands: Vec<Command>,
    /// How many edits were done before each of them, and after the last.
    done: Vec<usize>,
    /// The name of the object before each of them, and after the last.
    names: Vec<String>,
}

impl<'a> Past<'a> {
    fn of(document: &'a mut Document, name: &str, count: usize) -> Result<Self, DocumentError> {
        let (mut commands, mut done): (Vec<Command>, Vec<usize>) = Default::default();
        for n in 0..count {
            // What another version of the program wrote is no move that this one knows.
            if let Ok(command) = serde_json::from_value(document.command(n)?) {
                commands.push(command);
                done.push(n);
            }
        }
        done.push(count);
        let names = names(&commands, name).into_iter().chain([name]).map(String::from);
        Ok(Self {
            names: names.collect(),
            document,
            commands,
            done,
        })
    }

    /// Where strokes said that another density is the surface, the beginning, and the end; nothing where none did.
    fn turns(&self) -> Vec<usize> {
        let all = self.commands.iter().zip(&self.names).enumerate();
        let turns = all.filter(|(_, (command, name))| match command {
            Command::Stroke { object, stroke } => object == *name && stroke.surface.is_some(),
            _ => false,
        });
        let turns: Vec<usize> = turns.map(|(n, _)| n).collect();
        match turns.is_empty() {
            true => turns,
            false => [0]
                .into_iter()
                .chain(turns)
                .chain([self.commands.len()])
                .collect(),
        }
    }

    /// What some of the edits did.
    fn span(&mut self, edits: Range<usize>, now: &Object) -> Result<Span, WriteBackError> {
        let mut object = |n: usize| -> Result<Object, DocumentError> {
            let state = self.document.state_at(self.done[n])?;
            // The box may have grown since.
            Ok(state.object(&self.names[n])?.in_box_of(now))
        };
        let (before, after) = (object(edits.start)?, object(edits.end)?);
        let others = |n: usize| {
            let n = edits.start + n;
            let state = self.document.state_at(self.done[n]).ok()?;
            others(&state, &self.names[n]).ok()
        };
        let commands = &self.commands[edits.clone()];
        let journey = Journey::new(commands, &self.names[edits.end], &now.field.world_box(), others);
        Ok(Span {
            before,
            after,
            journey,
        })
    }
}

impl Span {
    /// The fields of an object that was fitted to a scan.
    fn fields(&self) -> Result<[&HierarchicalSpline<f32>; 2], WriteBackError> {
        let both = self.before.field.levels().zip(self.after.field.levels());
        both.map(|(before, after)| [before, after])
            .ok_or(WriteBackError::NoScan(
                "the object is a block on knots of its own, fitted to no scan; export its field, or mesh it",
            ))
    }
}

impl Course {
    /// Looks back to the beginning of a document.
    ///
    /// # Errors
    /// [`WriteBackError::Document`]; [`WriteBackError::NoFit`] if the object was not there, or is no longer known as it was.
    pub fn of(document: &mut Document, name: &str) -> Result<Self, WriteBackError> {
        let counts = document.counts()?;
        if counts.forgotten > 0 {
            return Err(WriteBackError::NoFit(format!(
                "the document has forgotten its first {} edits, and with them the field of the fit; export the field and \
                 sample it like the scan",
                human_count(counts.forgotten as usize)
            )));
        }
        let now = document.state().object(name)?.clone();
        let mut past = Past::of(document, name, counts.done)?;
        let begun_as = past.names[0].clone();
        let first = past.document.first_state()?;
        let fitted = first.objects().get(&begun_as).ok_or_else(|| {
            WriteBackError::NoFit(format!(
                "object {name:?} was not there when the document began; only what was fitted to a scan can be written back"
            ))
        })?;
        let turns = past.turns();
        let spans = turns.windows(2).map(|ends| past.span(ends[0]..ends[1], &now));
        let spans = spans.collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            whole: past.span(0..past.commands.len(), &now)?,
            spans,
            identity: document.state().sha256(),
            extent: fitted.field.world_box(),
        })
    }

    /// What stood beside the field of the fit.
    pub fn meta(&self) -> &FieldMeta {
        &self.whole.before.meta
    }

    /// The box of the fit.
    pub fn extent(&self) -> &Aabb {
        &self.extent
    }

    /// Writes the cloud of file `scan` with the edits; returns what is to be told.
    ///
    /// # Errors
    /// Of a cloud that cannot be written back, and of the files.
    pub fn write_cloud(
        &self,
        scan: &Path,
        cloud: &PointCloud,
        output: &Path,
        limits: &ReadLimits,
    ) -> Result<Vec<String>, WriteBackError> {
        let left_out = cloud.file_count - cloud.positions.len();
        if left_out > 0 {
            return Err(WriteBackError::LeftOut(human_count(left_out)));
        }
        let iso = self.whole.after.iso().unwrap_or(0.0);
        let [fitted, now] = self.whole.fields()?;
        let changes = revise_cloud(fitted, now, &cloud.positions, iso, &self.whole.journey)
            .map_err(WriteBackError::Replaced)?;
        formats::points::save_revised(scan, &changes, output, limits).map_err(|e| match e.fault {
            Fault::Io { .. } => WriteBackError::Writing(e),
            _ => WriteBackError::Reading(e),
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

    /// Writes the volume of file `scan` with the edits; `fill` is the density of what was carved, air if it is not given.
    /// Returns what is to be told.
    ///
    /// # Errors
    /// Of a volume that cannot be written back, and of the files.
    pub fn write_volume(
        &self,
        scan: &Path,
        options: &VolumeOptions,
        volume: &Volume,
        fill: Option<f64>,
        output: &Path,
        limits: &ReadLimits,
    ) -> Result<Vec<String>, WriteBackError> {
        let iso = surface(&self.whole.after)?;
        let fill = fill.unwrap_or_else(|| air(volume));
        let revision = self.revised(volume, fill)?;
        let told =
            save_revised(scan, options, &revision.changes, &self.identity, output, limits).map_err(|e| {
                match e.fault {
                    Fault::Io { .. } => WriteBackError::Writing(e.fault.at(output)),
                    _ => WriteBackError::Reading(e),
                }
            })?;
        let mut notes = sentences(&revision, &told, volume, [fill, iso]);
        if self.whole.after.field.world_box() != self.extent {
            notes.push("the object has grown beyond the scan; what lies there is not written".into());
        }
        Ok(notes)
    }

    /// What all edits mean for the scan.
    fn revised(&self, volume: &Volume, fill: f64) -> Result<VolumeRevision, WriteBackError> {
        let spans = match self.spans.is_empty() {
            true => std::slice::from_ref(&self.whole),
            false => &self.spans,
        };
        let mut scan = Cow::Borrowed(volume);
        let mut all = VolumeRevision::default();
        for span in spans {
            let [before, after] = span.fields()?;
            let iso = surface(&span.after)?;
            let part = revise_volume(before, after, &scan, iso, fill, &span.journey)
                .map_err(|e| WriteBackError::Replaced(e.into()))?;
            for change in part.changes.iter().filter(|_| !self.spans.is_empty()) {
                scan.to_mut().values[change.voxel] = change.density as f32;
            }
            all.follow(part);
        }
        Ok(all)
    }
}

/// Density at the surface of an object.
fn surface(object: &Object) -> Result<f64, WriteBackError> {
    let iso = object.iso();
    iso.ok_or_else(|| WriteBackError::NoFit("the object names no surface".into()))
}

/// The density of what is taken out: one that few voxels are below, those left out that were not measured.
fn air(volume: &Volume) -> f64 {
    let padding = padding(&volume.values[..]);
    let mut values = volume.values.clone();
    values.retain(|v| Some(f64::from(*v)) != padding);
    let rank = (values.len() as f64 * THINNEST) as usize;
    let (_, value, _) = values.select_nth_unstable_by(rank, f32::total_cmp);
    f64::from(*value)
}

fn sentences(
    revision: &VolumeRevision,
    told: &Revision,
    volume: &Volume,
    [fill, iso]: [f64; 2],
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
            "what was carved has density {} (fill)",
            human_number(fill)
        ));
    }
    if revision.beyond > 0 {
        notes.push(format!(
            "{} voxels would show what the scan does not reach; there they have density {} (fill)",
            human_count(revision.beyond),
            human_number(fill)
        ));
    }
    if revision.is_filled() && fill >= iso {
        notes.push(format!(
            "that is no less than {}, where the surface lies: what was carved is still solid; choose a smaller fill",
            human_number(iso)
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
