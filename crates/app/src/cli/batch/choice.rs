use std::marker::PhantomData;
use std::num::NonZeroUsize;
use std::str::FromStr;

use clap::ValueEnum;
use formats::Kind;
use serde_json::{Map, Value};

use super::super::fit_choice::Precision;
use super::super::input::Shape;
use super::super::mesh_output::MESHES;
use super::super::quantity::{Tolerance, between, count};
use super::super::unoriented::Unoriented;

/// Options of fits. Each input takes those that are for its kind; they go to its fit as they were written.
#[derive(Clone, Debug, clap::Args)]
pub struct Choice {
    /// Root mean square of the residuals that no leaf of the octree exceeds: in the unit of each file, in mm, or in per cent
    /// of its size [default: what the noise justifies; as for fit]
    #[arg(long, value_name = "T[mm|%]", value_parser = as_written::<Tolerance>, allow_hyphen_values = true)]
    tolerance: Option<String>,
    /// The same of volumes, if it is not that of clouds and meshes: a density, or per cent of its range
    #[arg(long, value_name = "T[%]", value_parser = density, allow_hyphen_values = true)]
    volume_tolerance: Option<String>,
    /// Coefficients to spend on each input
    #[arg(long, value_name = "N", value_parser = count)]
    coefficients: Option<NonZeroUsize>,
    /// Clouds and meshes: finest level allowed, 2^N cells along the box
    #[arg(long, value_name = "N", value_parser = between::<u8>(6, 16))]
    max_depth: Option<u8>,
    /// Clouds: estimate the normals, and how to tell inside from outside
    #[arg(long, value_enum, value_name = "ROUTE", num_args = 0..=1, require_equals = true,
          default_missing_value = "winding")]
    unoriented: Option<Unoriented>,
    /// Clouds: take no notice of points that contradict the others
    #[arg(long)]
    robust: bool,
    /// What to fit of files with faces [default: cloud for PLY and OBJ, mesh for files that hold nothing else]
    #[arg(long = "as", value_enum, value_name = "KIND")]
    shape: Option<Shape>,
    /// Clouds and meshes: unit of the coordinates, where the file does not tell: mm, cm or m
    #[arg(long, value_parser = ["mm", "cm", "m"])]
    unit: Option<String>,
    /// Precision of the coefficients
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    precision: Precision,
    /// Write a mesh of each field too, in this format
    #[arg(long, value_name = "FORMAT", value_parser = MESHES)]
    pub mesh: Option<String>,
}

fn as_written<T: FromStr<Err = String>>(s: &str) -> Result<String, String> {
    let _: PhantomData<T> = s.parse::<T>().map(|_| PhantomData)?;
    Ok(s.trim().into())
}

fn density(s: &str) -> Result<String, String> {
    match s.parse()? {
        Tolerance::Mm(t) => Err(format!(
            "{t}mm is a length; write a density or per cent of its range: 3, 0.5%"
        )),
        _ => as_written::<Tolerance>(s),
    }
}

fn word(value: &impl ValueEnum) -> String {
    (value.to_possible_value()).map_or_else(String::new, |v| v.get_name().into())
}

/// What the options of an input are chosen by.
#[derive(Clone, Copy, PartialEq)]
enum Group {
    Cloud,
    Mesh,
    Volume,
    Unknown,
}

impl Choice {
    /// Arguments of `isoclay fit` for an input of this kind.
    pub fn arguments(&self, kind: Option<Kind>) -> Vec<String> {
        let group = match (kind, self.shape) {
            (Some(Kind::Volume(_)), _) => Group::Volume,
            (Some(Kind::Cloud(_) | Kind::Mesh(_)), Some(Shape::Cloud)) => Group::Cloud,
            (Some(Kind::Cloud(_) | Kind::Mesh(_)), Some(Shape::Mesh)) => Group::Mesh,
            (Some(Kind::Cloud(_)), None) => Group::Cloud,
            (Some(Kind::Mesh(_)), None) => Group::Mesh,
            // Its fit says what is wrong with it.
            (Some(Kind::Field) | None, _) => Group::Unknown,
        };
        let tolerance = match group {
            Group::Volume => self.volume_tolerance.as_ref().or(self.tolerance.as_ref()),
            Group::Cloud | Group::Mesh => self.tolerance.as_ref(),
            Group::Unknown => None,
        };
        let is_points = group == Group::Cloud;
        let is_surface = is_points || group == Group::Mesh;
        let options = [
            ("tolerance", tolerance.cloned()),
            ("coefficients", self.coefficients.map(|n| n.to_string())),
            (
                "max-depth",
                self.max_depth.filter(|_| is_surface).map(|n| n.to_string()),
            ),
            (
                "unoriented",
                self.unoriented.filter(|_| is_points).map(|u| word(&u)),
            ),
            ("as", self.shape.filter(|_| is_surface).map(|s| word(&s))),
            ("unit", self.unit.clone().filter(|_| is_surface)),
            ("precision", Some(word(&self.precision))),
        ];
        let valued = options
            .into_iter()
            .filter_map(|(o, v)| Some(format!("--{o}={}", v?)));
        valued
            .chain((self.robust && is_points).then(|| "--robust".into()))
            .collect()
    }

    /// All that was chosen, for the manifest.
    pub fn record(&self) -> Map<String, Value> {
        let options = [
            ("tolerance", self.tolerance.clone()),
            ("volume_tolerance", self.volume_tolerance.clone()),
            ("coefficients", self.coefficients.map(|n| n.to_string())),
            ("max_depth", self.max_depth.map(|n| n.to_string())),
            ("unoriented", self.unoriented.map(|u| word(&u))),
            ("robust", self.robust.then(|| "yes".into())),
            ("as", self.shape.map(|s| word(&s))),
            ("unit", self.unit.clone()),
            ("precision", Some(word(&self.precision))),
            ("mesh", self.mesh.clone()),
        ];
        (options.into_iter())
            .filter_map(|(o, v)| Some((o.to_string(), v?.into())))
            .collect()
    }
}
