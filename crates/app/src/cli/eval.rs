use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use fitting::Cancel;
use formats::points::PointCloud;
use rayon::prelude::*;

use super::failure::{Failure, OrFail, Outcome};
use super::field::FieldArgs;
use super::input::limits;
use super::quantity::threads;
use super::set_threads;
use super::source::{POINTS, Source, point_formats};

/// Arguments of `isoclay eval`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    field: FieldArgs,
    /// Points: lines of x y z, or a point cloud; - reads standard input
    #[arg(long, value_name = "F")]
    points: PathBuf,
    /// Format of the points where neither their content nor their name tells it [default for -: xyz]
    #[arg(long, value_name = "FORMAT", value_parser = point_formats())]
    format: Option<String>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
}

/// Points evaluated and printed at a time.
const BATCH: usize = 1 << 16;
/// Points printed by one thread at a time.
const PART: usize = 1 << 12;

/// Prints `x,y,z,value,gx,gy,gz`, one line a point, in order.
pub fn run(args: &Args) -> Outcome {
    set_threads(args.threads)?;
    let cancel = Cancel::new();
    let open = args.field.load_placed(&args.field.source(&cancel)?)?;
    // Lines of numbers are what people type.
    let lines = (args.points == Path::new("-")).then_some("xyz");
    let format = args.format.as_deref().or(lines);
    let cloud = read_points(&Source::open(&args.points, format, POINTS, &cancel)?.under("--points"))?;
    let mut out = io::stdout().lock();
    out.write_all(b"x,y,z,value,gx,gy,gz\n").or_limit()?;
    for batch in cloud.positions.chunks(BATCH) {
        let texts: Vec<Vec<u8>> = batch
            .par_chunks(PART)
            .map(|part| {
                let mut jets = vec![(0.0, glam::DVec3::ZERO); part.len()];
                open.field().values_gradients(part, &mut jets);
                let mut text = Vec::with_capacity(part.len() * 7 * 20);
                let mut number = zmij::Buffer::new();
                for (p, (value, g)) in part.iter().zip(&jets) {
                    for x in [p.x, p.y, p.z, *value, g.x, g.y, g.z] {
                        text.extend_from_slice(number.format(x).as_bytes());
                        text.push(b',');
                    }
                    text.pop();
                    text.push(b'\n');
                }
                text
            })
            .collect();
        for text in texts {
            out.write_all(&text).or_limit()?;
        }
    }
    out.flush().or_limit()
}

/// All points; one that cannot be used is an error, since lines are counted.
fn read_points(source: &Source) -> Outcome<PointCloud> {
    let cloud = formats::points::read(source.path(), &limits(None)).map_err(|e| source.reading(e))?;
    if cloud.positions.len() != cloud.file_count {
        return Err(Failure::input(format!(
            "{}: {} of {} points cannot be used (not finite, or corners of no face); give finite points without \
             faces, so that each line of the answer belongs to one point",
            source.name(),
            cloud.file_count - cloud.positions.len(),
            cloud.file_count
        )));
    }
    Ok(cloud)
}
