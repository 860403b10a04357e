use std::path::PathBuf;

use clap::ValueEnum;
use clap::builder::PossibleValue;
use fitting::phantoms::{CloudOptions, Solid, head, sample_cloud};
use formats::Unit;
use formats::volumes::StoreAs;
use glam::{DAffine3, DMat3, DVec3};

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::output::Output;
use super::quantity::{Tolerance, between};
use super::summary::Summary;

/// Arguments of `isoclay phantom`.
#[derive(clap::Args)]
pub struct Args {
    /// What to make
    #[arg(value_enum)]
    name: Name,
    /// Cloud to write (.ply); for the head, volume (.nii, .nii.gz); - writes to standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Points of a cloud, before holes are cut [default: 20000]
    #[arg(long, value_name = "N", value_parser = between::<u64>(1, 100_000_000))]
    count: Option<u64>,
    /// Voxels along each side of the head [default: 96]
    #[arg(long, value_name = "N", value_parser = between::<u16>(4, 1024))]
    size: Option<u16>,
    /// Standard deviation of the noise: on each coordinate, a length or per cent of the solid's diagonal; of the
    /// head, a density or per cent of the skull's
    #[arg(long, value_name = "S[%]", allow_hyphen_values = true)]
    noise: Option<Tolerance>,
    /// Holes to cut, each with 6 % of the points
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = between::<u8>(0, 12))]
    holes: u8,
    /// Ratio of the largest to the smallest density, along the longest side
    #[arg(long, value_name = "R", default_value_t = 1.0, value_parser = ratio)]
    density_ratio: f64,
    /// Seed of all randomness
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = seed, allow_negative_numbers = true)]
    seed: u64,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// A phantom's name.
#[derive(Clone, Copy)]
pub enum Name {
    /// A solid, as points on its surface.
    Solid(Solid),
    /// A head of ellipsoids, as a volume.
    Head,
}

impl ValueEnum for Name {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: [Name; 7] = {
            let [a, b, c, d, e, f] = Solid::ALL;
            use Name::Solid as S;
            [S(a), S(b), S(c), S(d), S(e), S(f), Name::Head]
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(match self {
            Self::Solid(solid) => solid.name(),
            Self::Head => "head",
        }))
    }
}

fn seed(s: &str) -> Result<u64, String> {
    s.parse()
        .map_err(|_| "write a whole number in digits, 0 or more".into())
}

fn ratio(s: &str) -> Result<f64, String> {
    match s.parse::<f64>() {
        Ok(r) if (1.0..=1000.0).contains(&r) => Ok(r),
        _ => Err("write a number from 1 to 1000".into()),
    }
}

/// Writes a phantom.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let formats: &[&str] = match args.name {
        Name::Solid(_) => &["ply"],
        Name::Head => &["nii", "nii.gz"],
    };
    let output = Output::check("-o", &args.output, formats, None, &[])?;
    match args.name {
        Name::Solid(solid) => write_cloud(args, solid, &output)?,
        Name::Head => write_head(args, &output)?,
    }
    .with_cost(&cost)
    .print_after(&output, args.json)
}

fn noise_of(args: &Args, whole: f64) -> Outcome<f64> {
    match args.noise {
        None => Ok(0.0),
        Some(Tolerance::Mm(n)) => Err(Failure::usage(format!(
            "--noise {n}mm: phantoms have no unit; give a number ({n}) or per cent of the size (0.5%)"
        ))),
        Some(noise) => noise.length(whole, Unit::Unknown).map_err(Failure::usage),
    }
}

fn write_cloud(args: &Args, solid: Solid, output: &Output) -> Outcome<Summary> {
    if let Some(size) = args.size {
        return Err(Failure::usage(format!(
            "--size {size}: is the number of voxels of the head; a cloud takes --count"
        )));
    }
    let (field, within) = (solid.field(), solid.within());
    let options = CloudOptions {
        count: args.count.unwrap_or(20_000) as usize,
        noise: noise_of(args, within.size().length())?,
        hole_count: usize::from(args.holes),
        density_ratio: args.density_ratio,
        seed: args.seed,
        ..Default::default()
    };
    let cloud = sample_cloud(&*field, &within, &options)
        .ok_or_else(|| Failure::limit(format!("{}: no surface was found", solid.name())))?;
    formats::meshes::save_points(output.path(), &cloud.positions, Some(&cloud.normals), None)
        .map_err(|e| output.writing(e))?;
    Ok(Summary {
        input_count: Some(cloud.positions.len()),
        notes: cloud
            .holes
            .iter()
            .map(|(c, r)| format!("hole round {c} of radius {r:.4}"))
            .collect(),
        ..Default::default()
    })
}

fn write_head(args: &Args, output: &Output) -> Outcome<Summary> {
    let is_for_clouds = [
        ("--count", args.count.map(|n| n.to_string())),
        ("--holes", (args.holes > 0).then(|| args.holes.to_string())),
        (
            "--density-ratio",
            (args.density_ratio != 1.0).then(|| args.density_ratio.to_string()),
        ),
    ];
    for (option, given) in is_for_clouds {
        if let Some(given) = given {
            return Err(Failure::usage(format!(
                "{option} {given}: is for clouds, and the head is a volume; leave it out"
            )));
        }
    }
    let n = usize::from(args.size.unwrap_or(96));
    let values = head([n; 3], noise_of(args, 1.0)?, args.seed);
    // The middle of the volume is the origin, its sides are 200 mm long.
    let step = 200.0 / n as f64;
    let corner = DVec3::splat(-0.5 * step * (n - 1) as f64);
    let map = DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::splat(step)),
        translation: corner,
    };
    formats::volumes::save(
        output.path(),
        [n; 3],
        &values,
        &map,
        Unit::Millimetre,
        StoreAs::Float32,
    )
    .map_err(|e| output.writing(e))?;
    Ok(Summary {
        input_count: Some(values.len()),
        ..Default::default()
    })
}
