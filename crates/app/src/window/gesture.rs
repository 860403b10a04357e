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
    /// How hard the pen is pressed there, if it is one and that counts; or whatever else changes evenly from place to place.
    press: Option<f64>,
}

impl Way {
    /// From a place, in steps of a length.
    pub fn new(from: Pos2, step: f32, press: Option<f64>) -> Self {
        Self {
            last: from,
            step,
            press,
        }
    }

    /// How hard the pen was pressed in the last step, if it is one.
    pub fn press(&self) -> Option<f64> {
        self.press
    }

    /// The places of the steps on the way to where the pointer is told to be now, and how hard the pen is pressed there: it changes evenly to
    /// what it is now.
    pub fn to(&mut self, now: Pos2, press: f64) -> Vec<(Pos2, Option<f64>)> {
        let mut places = Vec::new();
        let way: Vec2 = now - self.last;
        let steps = (way.length() / self.step).floor();
        if steps < 1.0 {
            return places;
        }
        let each = way.normalized() * self.step;
        let share = f64::from(self.step / way.length());
        let more = self.press.map_or(0.0, |before| share * (press - before));
        for _ in 0..steps as usize {
            self.last += each;
            self.press = self.press.map(|before| before + more);
            places.push((self.last, self.press));
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
            let mut way = Way::new(Pos2::ZERO, 3.0, None);
            let at = |n: usize| Pos2::new(120.0 * n as f32 / moves as f32, 0.0);
            let steps = (1..=moves).flat_map(|n| way.to(at(n), 1.0));
            steps.map(|(at, _)| at).collect()
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

    /// A pen that is pressed evenly harder is pressed so in each step, however few moves tell of it; a mouse is not.
    #[test]
    fn presses_grow_with_the_way() {
        for moves in [1, 4, 60] {
            let mut way = Way::new(Pos2::ZERO, 3.0, Some(0.2));
            let steps = (1..=moves).flat_map(|n| {
                let share = n as f64 / moves as f64;
                way.to(Pos2::new(120.0 * share as f32, 0.0), 0.2 + 0.8 * share)
            });
            for (at, press) in steps {
                let due = 0.2 + 0.8 * f64::from(at.x) / 120.0;
                assert!((press.unwrap() - due).abs() < 1e-3, "{moves}: {press:?} of {due}");
            }
        }
        let mut mouse = Way::new(Pos2::ZERO, 3.0, None);
        assert!(
            mouse
                .to(Pos2::new(9.0, 0.0), 0.5)
                .iter()
                .all(|(_, press)| press.is_none())
        );
    }
}
