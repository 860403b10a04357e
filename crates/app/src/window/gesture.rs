//! What a button that is held down does.

use egui::{Pos2, Vec2};

/// What a button that is held down does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gesture {
    /// Works on the solid.
    Stroke(Way),
    /// Holds the button of what is in the hand.
    Hand,
    /// Turns the view.
    Orbit,
    /// Moves it along.
    Pan,
}

/// The way of a pointer, in steps of one length whatever the rate at which it was told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    last: Pos2,
    step: f32,
}

impl Way {
    /// From a place, in steps of a length.
    pub fn new(from: Pos2, step: f32) -> Self {
        Self { last: from, step }
    }

    /// The places of the steps on the way to where the pointer is told to be now.
    pub fn to(&mut self, now: Pos2) -> Vec<Pos2> {
        let mut places = Vec::new();
        let way: Vec2 = now - self.last;
        let steps = (way.length() / self.step).floor();
        if steps < 1.0 {
            return places;
        }
        let each = way.normalized() * self.step;
        for _ in 0..steps as usize {
            self.last += each;
            places.push(self.last);
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight line told in many moves and in few gives the same steps.
    #[test]
    fn the_rate_of_moves_does_not_show() {
        let told = |moves: usize| -> Vec<Pos2> {
            let mut way = Way::new(Pos2::ZERO, 3.0);
            let at = |n: usize| Pos2::new(120.0 * n as f32 / moves as f32, 0.0);
            (1..=moves).flat_map(|n| way.to(at(n))).collect()
        };
        let few = told(4);
        assert_eq!(few.len(), 40);
        for moves in [10, 60, 240] {
            let many = told(moves);
            assert_eq!(many.len(), few.len());
            for (a, b) in many.iter().zip(&few) {
                assert!((*a - *b).length() < 1e-3, "{a} {b}");
            }
        }
    }
}
