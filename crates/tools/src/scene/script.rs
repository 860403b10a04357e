//! What a scene file may say. Values that nothing can have are refused here, so that their line is told.

use std::fmt;
use std::path::PathBuf;

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use super::amount::Amount;
use super::mask::MaskTable;
use super::when::When;
use crate::number::{Finite, NonNegative, Point, Positive};

/// A scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Scene {
    /// Field file, from the directory of the scene; whoever runs it names one if missing.
    pub field: Option<PathBuf>,
    /// Density of the surface; the field's own if missing.
    pub iso: Option<Finite>,
    /// What moves.
    pub region: RegionTable,
    /// What it is made of.
    #[serde(default)]
    pub material: Material,
    /// Painted on it, in order.
    #[serde(default)]
    pub paint: Vec<Paint>,
    /// Springs.
    #[serde(default)]
    pub law: LawTable,
    /// Steps.
    pub time: Time,
    /// Gaussian pulls.
    #[serde(default)]
    pub pull: Vec<Pull>,
    /// Forces on single samples.
    #[serde(default)]
    pub force: Vec<Force>,
    /// What holds densities.
    #[serde(default)]
    pub constraint: Vec<Hold>,
    /// Whether rest follows.
    #[serde(default)]
    pub plasticity: Plasticity,
    /// When it is let go.
    pub release: Option<Release>,
    /// When it sleeps.
    #[serde(default)]
    pub sleep: Sleep,
}

/// A box in the world, or of cells of a level.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RegionTable {
    /// Lower corner in the world.
    pub min: Option<Point>,
    /// Upper corner in the world.
    pub max: Option<Point>,
    /// First cell.
    pub first: Option<[u32; 3]>,
    /// Number of cells.
    pub count: Option<[u32; 3]>,
    /// Level of the cells.
    pub level: Option<u8>,
    /// Samples per cell.
    pub samples_per_cell: Option<PerAxis>,
    /// What of the box takes part; all if missing.
    pub mask: Option<MaskTable>,
}

/// A number for all axes or one for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerAxis(pub [f64; 3]);

/// Matter per volume.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Material {
    /// Mass, 1 if missing.
    pub mass: Option<Amount>,
    /// Damping, 0 if missing.
    pub damping: Option<Amount>,
    /// Stiffness, 1 if missing.
    pub stiffness: Option<Amount>,
    /// Stiffness of springs to the first shape, 0 if missing.
    pub ground: Option<Amount>,
    /// Scale of rest lengths, 1 if missing.
    pub rest_scale: Option<Amount>,
}

/// What can be painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Substance {
    /// μ.
    Mass,
    /// γ.
    Damping,
    /// κ.
    Stiffness,
    /// Ground stiffness.
    Ground,
    /// Scale of rest lengths.
    RestScale,
}

/// A stroke or a ball of matter.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Paint {
    /// Which quantity.
    pub substance: Substance,
    /// What it becomes where the paint is full.
    pub value: NonNegative,
    /// Centre of a ball, or the polyline of a stroke.
    pub along: Vec<Point>,
    /// How far the paint reaches.
    pub radius: Positive,
    /// Part of the radius over which it fades linearly, 0 to 1.
    pub fade: Option<NonNegative>,
    /// When it is laid on; 0 if missing.
    pub at: Option<NonNegative>,
}

/// Which springs.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct LawTable {
    /// Which law.
    pub kind: LawKind,
    /// Length per density; one over the slope of the field if missing.
    pub scale: Option<Positive>,
    /// 6, 18 or 26; 6 of linear springs and 18 of 4-D ones if missing.
    pub neighbours: Option<u8>,
}

/// The laws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum LawKind {
    /// Linear springs.
    #[default]
    #[serde(rename = "linear")]
    Linear,
    /// Springs of the source paper.
    #[serde(rename = "4-d")]
    FourD,
}

/// Steps.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Time {
    /// How long it lasts.
    pub duration: Positive,
    /// Length of a step; the first of adaptive ones.
    pub step: Positive,
    /// How a step is made.
    #[serde(default)]
    pub integrator: Scheme,
    /// Adaptive: error of the densities that a step may make, root mean square.
    pub tolerance: Option<Positive>,
    /// Adaptive: shortest step.
    pub shortest: Option<Positive>,
    /// Adaptive: longest step.
    pub longest: Option<Positive>,
    /// Adaptive: acceleration of a density beyond which the step is halved.
    pub acceleration: Option<Positive>,
}

/// How a step is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// The paper's own [Hua04 eq. 12].
    Paper,
    /// Explicit, first order.
    Symplectic,
    /// Explicit, second order.
    Verlet,
    /// Second order, implicit.
    #[default]
    TrBdf2,
    /// Verlet in sub-steps where these cost less than a step of TR-BDF2.
    Auto,
    /// TR-BDF2 whose steps follow its error.
    Adaptive,
}

/// A Gaussian pull.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Pull {
    /// Where it begins.
    pub at: Point,
    /// Where it ends, if it moves; steadily over the time it acts.
    pub to: Option<Point>,
    /// Standard deviation.
    pub radius: Positive,
    /// Sum of its forces; positive ones raise the density, so the surface moves outwards.
    pub strength: Finite,
    /// When it acts.
    #[serde(default)]
    pub when: When,
}

/// Forces on samples.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Force {
    /// Which samples.
    pub samples: Vec<[usize; 3]>,
    /// The force on each.
    pub values: Vec<Finite>,
    /// When they act.
    #[serde(default)]
    pub when: When,
}

/// A density that is held.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Hold {
    /// Its name in errors.
    pub name: Option<String>,
    /// One point, or the polyline of a curve.
    pub along: Vec<Point>,
    /// Density there; that of the surface if missing.
    pub density: Option<Finite>,
    /// Stiffness of a spring, of curves per length; a hard constraint if missing.
    pub spring: Option<Positive>,
    /// Distance between the samples of a curve; half a cell if missing.
    pub spacing: Option<Positive>,
    /// When it holds; ramps mean nothing.
    #[serde(default)]
    pub when: When,
}

/// Whether rest follows.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Plasticity {
    /// Rate λ at which rest lengths follow the present ones, per second; 0 is elastic.
    pub rate: Option<NonNegative>,
    /// Only under the kernels of the pulls.
    pub under_pulls: bool,
}

/// When it is let go.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Release {
    /// Moment; the end if missing.
    pub at: Option<NonNegative>,
    /// What it does then.
    #[serde(rename = "as")]
    pub kind: ReleaseKind,
}

/// What a solid does that is let go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReleaseKind {
    /// Keeps its shape, to the bit.
    Clay,
    /// Loses all forces and swings back.
    Elastic,
}

/// When it sleeps.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Sleep {
    /// Length per second.
    pub speed: Option<NonNegative>,
    /// Length per second squared.
    pub acceleration: Option<NonNegative>,
    /// Whether parts of the region sleep while others move.
    pub parts: bool,
}

impl Paint {
    /// What is wrong with it.
    pub fn check(&self) -> Result<(), String> {
        if self.along.is_empty() {
            return Err("along has no points; give the centre of a ball, or the points of a stroke".into());
        }
        if let Some(fade) = self.fade.filter(|f| f.0 > 1.0) {
            return Err(format!(
                "fade is {}; it can be at most 1, the whole radius",
                fade.0
            ));
        }
        if self.substance == Substance::Mass && self.value.0 == 0.0 {
            return Err("a mass of 0 moves infinitely fast; write a value above 0".into());
        }
        Ok(())
    }
}

impl<'de> Deserialize<'de> for PerAxis {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;
        impl<'de> Visitor<'de> for Read {
            type Value = PerAxis;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or a list of three")
            }

            fn visit_f64<E: de::Error>(self, v: f64) -> Result<PerAxis, E> {
                let value = Positive::try_from(v).map_err(E::custom)?;
                Ok(PerAxis([value.0; 3]))
            }

            fn visit_i64<E: de::Error>(self, v: i64) -> Result<PerAxis, E> {
                self.visit_f64(v as f64)
            }

            fn visit_seq<A: de::SeqAccess<'de>>(self, seq: A) -> Result<PerAxis, A::Error> {
                let each = <[Positive; 3]>::deserialize(de::value::SeqAccessDeserializer::new(seq))?;
                Ok(PerAxis(each.map(|v| v.0)))
            }
        }
        deserializer.deserialize_any(Read)
    }
}
