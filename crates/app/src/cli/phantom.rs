use std::path::PathBuf;

use clap::ValueEnum;
use clap::builder::PossibleValue;
use fitting::phantoms::{CloudOptions, Solid, sample_cloud};

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::input::{check_output, writing};
use super::quantity::Tolerance;
use super::summary::Summary;

/// Arguments of `isoclay phantom`.
#[derive(clap::Args)]
pub struct Args {
    /// What to make
    #[arg(value_enum)]
    name: Name,
    /// Cloud to write (.ply)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Points, before holes are cut
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    count: u64,
    /// Standard deviation of the noise on each coordinate: a length, or per cent of the solid's diagonal
    #[arg(long, value_name = "S[%]")]
    noise: Option<Tolerance>,
    /// Holes to cut, each with 6 % of the points
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=12))]
    holes: u8,
    /// Ratio of the largest to the smallest density, along the longest side
    #[arg(long, value_name = "R", default_value_t = 1.0, value_parser = ratio)]
    density_ratio: f64,
    /// Seed of all randomness
    #[arg(long, value_name = "K", default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// A phantom's name.
#[derive(Clone, Copy)]
struct Name(Solid);

impl ValueEnum for Name {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: [Name; 6] = {
            let [a, b, c, d, e, f] = Solid::ALL;
            [Name(a), Name(b), Name(c), Name(d), Name(e), Name(f)]
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name()))
    }
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
    check_output(&args.output, &["ply"])?;
    let solid = args.name.0;
    let (field, within) = (solid.field(), solid.within());
    let noise = args
        .noise
        .map(|n| n.length(within.size().length(), formats::Unit::Unknown))
        .transpose();
    let options = CloudOptions {
        count: args.count as usize,
        noise: noise
            .map_err(|_| Failure::usage("--noise: the phantoms have no unit; give a length or per cent"))?
            .unwrap_or(0.0),
        hole_count: usize::from(args.holes),
        density_ratio: args.density_ratio,
        seed: args.seed,
        ..Default::default()
    };
    let cloud = sample_cloud(&*field, &within, &options)
        .ok_or_else(|| Failure::limit(format!("{}: no surface was found", solid.name())))?;
    formats::meshes::save_points(&args.output, &cloud.positions, Some(&cloud.normals), None)
        .map_err(writing)?;
    let notes = cloud
        .holes
        .iter()
        .map(|(c, r)| format!("hole round {c} of radius {r:.4}"))
        .collect();
    Summary {
        input_count: Some(cloud.positions.len()),
        output: Some(args.output.display().to_string()),
        notes,
        ..Default::default()
    }
    .with_cost(&cost)
    .print(args.json)
}
