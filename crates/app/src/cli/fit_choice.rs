use std::num::NonZeroUsize;

use clap::ValueEnum;
use formats::Unit;

use super::quantity::{Tolerance, between, count, positive};
use super::unoriented::Unoriented;

/// What the user may choose of a fit; the rest is chosen from the data.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Choice {
    /// Root mean square of the residuals that no leaf of the octree exceeds, unless its report says why. Clouds: a distance in the file's unit, in mm,
    /// or in per cent of the diagonal. Volumes: a density, or per cent of the range between the 1st and the 99th
    /// percentile [default: what the noise justifies; for clean data 0.01% of the diagonal, 0.5% of the range]
    #[arg(long, value_name = "T[mm|%]", allow_hyphen_values = true)]
    pub tolerance: Option<Tolerance>,
    /// Meshes: distance from the surface up to which the tolerance holds for the signed distance, written like it
    /// [default: none, it holds for the surface alone]
    #[arg(long, value_name = "L[mm|%]", allow_hyphen_values = true)]
    pub band: Option<Tolerance>,
    /// Coefficients to spend [default: as many as --tolerance asks for; without it 400 000 for meshes and, unless
    /// --max-depth is given, 270 000 or 0.7 a point for clouds]
    #[arg(long, value_name = "N", value_parser = count)]
    pub coefficients: Option<NonZeroUsize>,
    /// Finest level allowed. Clouds: 2^N cells along the box, 6 to 16. Volumes: 0 is a knot every four voxels, 2 one
    /// at every voxel
    #[arg(long, value_name = "N", value_parser = between::<u8>(0, 16))]
    pub max_depth: Option<u8>,
    /// How to fit: a volume adaptively or by interpolation, a cloud by gradients or by offset pairs [default:
    /// adaptive; gradient]
    #[arg(long, value_enum)]
    pub method: Option<Method>,
    /// Weight of the bending energy [default: chosen from the data]
    #[arg(long, value_name = "μ", value_parser = positive, allow_hyphen_values = true)]
    pub smoothing: Option<f64>,
    /// Estimate the normals of a cloud that has none (or not those of its file), and how to tell inside from outside
    #[arg(long, value_enum, value_name = "ROUTE", num_args = 0..=1, require_equals = true,
          default_missing_value = "winding")]
    pub unoriented: Option<Unoriented>,
    /// Take no notice of points that contradict the others: for clouds with outliers
    #[arg(long)]
    pub robust: bool,
    /// Unit of the coordinates, where the file does not tell: mm, cm or m
    #[arg(long, value_parser = unit)]
    pub unit: Option<Unit>,
    /// Precision of the coefficients
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    pub precision: Precision,
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Clouds: the field is 0 at each point and its gradient the normal.
    Gradient,
    /// Clouds: the field is 0 at each point and ∓d at two points at ±d along the normal.
    OffsetPairs,
    /// Volumes: least squares with as few coefficients as the tolerance needs.
    Adaptive,
    /// Volumes: exactly through all voxels, with a coefficient for each.
    Interpolate,
}

/// Precision of the coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Precision {
    /// 32-bit floats.
    F32,
    /// 64-bit floats.
    F64,
}

fn unit(s: &str) -> Result<Unit, String> {
    match s {
        "mm" | "cm" | "m" => s.parse(),
        _ => Err("write mm, cm or m".into()),
    }
}
