use std::cell::OnceCell;

use glam::DAffine3;

use super::ceiling::of_bricks;
use super::failure::{Failure, Outcome};
use super::picture::{self, Asked};
use super::quantity::finite;
use crate::picture::View;
use crate::view::{Card, Histogram, Manner, Mode, Solid, still};

/// Arguments of `isoclay render`.
#[derive(clap::Args)]
// Those of `picture` are a group of the same name.
#[group(skip)]
pub struct Args {
    #[command(flatten)]
    pub picture: picture::Args,
    /// How the solid becomes a picture
    #[arg(long, value_enum, default_value_t = Mode::Mesh)]
    mode: Mode,
    /// Densities that are black and white with --mode volume [default: from that of the surface to the highest]
    #[arg(long, value_name = "BLACK,WHITE", value_parser = density, allow_hyphen_values = true)]
    density: Option<[f64; 2]>,
    /// Draw so many pictures from all sides, evenly round the upright axis, into the directory of -o: 0000.png and on
    #[arg(long, value_name = "N", value_parser = turns, conflicts_with = "errors")]
    turntable: Option<usize>,
}

/// Sides that a turntable has.
fn turns(s: &str) -> Result<usize, String> {
    let count = s.parse().ok().filter(|n| (2..=3600).contains(n));
    count.ok_or_else(|| "write a whole number from 2 to 3600".into())
}

fn density(s: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, String> = s.split(',').map(|n| finite(n.trim())).collect();
    match numbers.as_deref() {
        Ok(&[black, white]) if black < white => Ok([black, white]),
        _ => Err("write two densities with a comma between, the lower one first: -200,900".into()),
    }
}

impl Args {
    /// What is drawn without triangles, if anything is to be.
    fn solid(&self, asked: &Asked) -> Outcome<Option<Solid>> {
        if self.mode == Mode::Mesh {
            return Ok(None);
        }
        let field = asked.open.placed_levels()?.to_single();
        Ok(Some(Solid {
            field: field.map_err(|e| Failure::input(e.to_string()))?,
            iso: asked.iso,
            world_from_object: DAffine3::IDENTITY,
            second: None,
        }))
    }

    fn density(&self, asked: &Asked) -> [f64; 2] {
        self.density.unwrap_or_else(|| {
            let within = asked.open.lattice().world_box();
            Histogram::new(asked.open.field(), &within).shown(asked.iso)
        })
    }
}

/// Draws a field file on the graphics card; without one `picture` draws the surface, and nobody the density.
pub fn run(args: &Args) -> Outcome {
    if args.density.is_some() && args.mode != Mode::Volume {
        return Err(Failure::usage(
            "--density: only --mode volume shows densities; add that, or leave it out",
        ));
    }
    // The same for all pictures of a turntable.
    let card = OnceCell::new();
    let on_card = |asked: &Asked, view: &View| {
        let solid = args.solid(asked)?;
        let card = card.get_or_init(Card::open).as_ref().map_err(Clone::clone);
        let drawn = card.and_then(|card| {
            let manner = Manner {
                mode: args.mode,
                solid: solid.as_ref(),
                density: args.density(asked),
                bricks: of_bricks(),
            };
            still(card, &asked.scene, view, manner)
        });
        match drawn {
            Ok(pixels) => Ok(Some(pixels)),
            Err(why) if args.mode == Mode::Volume => Err(Failure::limit(format!("--mode volume: {why}"))),
            Err(why) => {
                eprintln!("isoclay: {why}; the processor draws instead");
                Ok(None)
            }
        }
    };
    picture::draw(&args.picture, &on_card, args.turntable)
}
