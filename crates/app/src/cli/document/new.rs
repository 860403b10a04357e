use std::path::PathBuf;

use document::{Document, Object, State, with_report};
use fitting::{Cancel, FitReport};
use formats::Unit;
use formats::field::{AnyField, FieldMeta, SourceKind};
use glam::DVec3;
use tools::body::Body;
use tools::force::Solid;
use tools::geometric::block;
use tools::knots;

use super::knots::Knots;
use super::{Told, failure, options};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::field::OpenField;
use crate::cli::interrupt;
use crate::cli::progress::Bar;
use crate::cli::quantity::{finite, positive};
use crate::cli::source::{FIELDS, Source};
use crate::cli::volume_choice::{Length, OneOrThree};

/// Arguments of `isoclay new`.
#[derive(clap::Args)]
pub struct Args {
    /// Document to make (.isoclay)
    document: PathBuf,
    /// Fields (.iclay) that become its objects, under the names of their files
    #[arg(required_unless_present = "block", value_name = "FIELD")]
    fields: Vec<PathBuf>,
    /// Object to start from: a block about the origin with edges of these lengths, one number or three with commas between
    #[arg(
        long = "box",
        id = "block",
        value_name = "SIZE",
        requires = "spacing",
        allow_negative_numbers = true
    )]
    block: Option<OneOrThree<Length>>,
    /// Finest knot interval of the block: the least that can be shaped is a few of it
    #[arg(long, value_name = "LENGTH", requires = "block", value_parser = positive, allow_negative_numbers = true)]
    spacing: Option<f64>,
    /// Knots of the block, where they are not to be --spacing apart: for each axis places in ascending order, and ranges A..B/N in
    /// N equal intervals, as x=-1,-0.5,0..1/20;z=0..5/10. Beyond the list they follow --spacing apart
    #[arg(long, requires = "block", value_name = "KNOTS", allow_hyphen_values = true)]
    knots: Option<Knots>,
    /// What the objects are when a force tool lets go: clay keeps its new shape, elastic springs back
    #[arg(long, value_enum, default_value = "clay")]
    material: Material,
    /// Unit of the block's lengths: um, mm, cm or m
    #[arg(long, requires = "block")]
    unit: Option<Unit>,
    /// Density at which the fields' surfaces lie [default: the one that each names]
    #[arg(long, value_name = "DENSITY", value_parser = finite, allow_negative_numbers = true, requires = "fields")]
    iso: Option<f64>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// What an object does with its shape.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Material {
    /// It keeps the new one.
    Clay,
    /// It springs back.
    Elastic,
}

impl From<Material> for tools::material::Material {
    fn from(material: Material) -> Self {
        Self {
            solid: match material {
                Material::Clay => Solid::Clay,
                Material::Elastic => Solid::Elastic,
            },
        }
    }
}

/// The object that a field becomes, under the name of its file; by default its surface is where the field says.
pub fn of_field(source: &Source, iso: Option<f64>, notes: &mut Vec<String>) -> Outcome<(String, Object)> {
    let open = OpenField::load(source)?;
    let name = source
        .path()
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    if matches!(open.levels(), Ok(AnyField::F64(_))) {
        notes.push(format!(
            "{name}: documents hold single precision; the field was rounded to it"
        ));
    }
    if let Some(iso) = iso {
        let range = open.field().bounds(&open.lattice().world_box());
        let [low, high] = open.values_met();
        let told = format!("densities of {} run from {low:.6} to {high:.6}", source.name());
        if !(range.lo..=range.hi).contains(&iso) {
            return Err(Failure::usage(format!(
                "--iso {iso}: {told}; choose another --iso, between them"
            )));
        }
        // Between the places that were looked at there may be more.
        if !(low..=high).contains(&iso) {
            notes.push(format!(
                "--iso {iso}: {told} where they were looked at; there may be no surface"
            ));
        }
    }
    let meta = FieldMeta {
        iso: iso.or(open.iso()),
        ..open.meta().clone()
    };
    let object = match open.knots() {
        Some(knots) => Object::of(knots.clone().into(), meta),
        None => Object::new(open.levels()?, meta)
            .map_err(|e| Failure::input(format!("{}: {e}", source.name())))?,
    };
    Ok((name, object))
}

/// Finest knot interval over what a mesh of a block may be off by, as for a fit.
const TOLERANCE: f64 = 0.02;

/// Makes a document of fields, or of a block.
pub fn run(args: &Args) -> Outcome {
    let mut state = State::new();
    let mut notes = Vec::new();
    for path in &args.fields {
        let source = Source::open(path, None, FIELDS, &Cancel::new())?;
        let (name, mut object) = of_field(&source, args.iso, &mut notes)?;
        if state.objects().contains_key(&name) {
            return Err(Failure::usage(format!(
                "{}: another field has the name {name:?} already; rename one of the files",
                source.name()
            )));
        }
        object.properties.material = args.material.into();
        state = state.with(&name, object).map_err(failure)?;
    }
    if let (Some(OneOrThree(size)), Some(spacing)) = (args.block, args.spacing) {
        let cancel = interrupt::cancel();
        let bar = Bar::new();
        let mut control = bar.control(&cancel);
        let size = DVec3::from_array(size.map(|s| s.0));
        let field: Body = match &args.knots {
            None => block(size, spacing, &mut control)
                .map_err(|e| Failure::usage(format!("--box: {e}")))?
                .into(),
            Some(knots) => knots::block(size, spacing, knots.lists())
                .map_err(|e| Failure::usage(format!("--knots {}: {e}", knots.text)))?
                .into(),
        };
        bar.clear();
        let report = FitReport {
            tolerance: TOLERANCE * spacing,
            ..FitReport::default()
        };
        let meta = FieldMeta {
            source: SourceKind::Other,
            unit: args.unit.unwrap_or_default(),
            iso: Some(0.0),
            ..FieldMeta::default()
        };
        let mut object = Object::of(field, with_report(meta, &report));
        object.properties.material = args.material.into();
        state = state.with("block", object).map_err(failure)?;
    }
    let mut document = Document::create(&args.document, state, options()).map_err(failure)?;
    Told::of(&mut document, notes)?.print(args.json)
}
