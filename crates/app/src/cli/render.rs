use super::failure::Outcome;
use super::picture::{self, Args};
use crate::picture::{Scene, View};
use crate::view::{Card, still};

/// Draws a field file on the graphics card, and as `picture` does where there is none.
pub fn run(args: &Args) -> Outcome {
    let on_card = |scene: &Scene, view: &View| {
        let drawn = Card::open().and_then(|card| still(&card, scene, view));
        drawn
            .inspect_err(|why| eprintln!("isoclay: {why}; the processor draws instead"))
            .ok()
    };
    picture::draw(args, &on_card)
}
