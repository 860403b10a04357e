//! How hard pens are pressed, which neither winit nor egui tell.
//!
//! Pointer events of a picture have no time. Pens tell their moves in the same order, one each, so the moves of a picture are matched by
//! their order, and where there are more or fewer of them, by their share of the time of the picture.

mod xinput;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use eframe::egui_wgpu::wgpu::rwh::{HasWindowHandle, RawWindowHandle};

/// Most that is remembered: more than a pen tells within the slowest picture. While nothing is drawn, what is older is forgotten.
const MOST: usize = 4096;

/// What a pen does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Told {
    /// It goes elsewhere, pressed so hard, 0 to 1.
    Moved(f64),
    /// It comes down, pressed so hard.
    Down(f64),
    /// It goes up.
    Up,
}

/// What was told since it was asked last.
#[derive(Debug, Default)]
struct Lately {
    is_there: bool,
    told: VecDeque<Told>,
    /// How hard the pen was pressed that came down in the picture before, if one did: the window may hear of it later than this.
    down: Option<f64>,
}

impl Lately {
    fn tell(&mut self, told: Told) {
        if self.told.len() == MOST {
            self.told.pop_front();
        }
        self.told.push_back(told);
    }
}

/// All pens.
#[derive(Debug, Default)]
pub struct Pens(Arc<Mutex<Lately>>);

impl Pens {
    /// Listens to those of the display that a window is on, if that is one of X11.
    pub fn listen(window: &impl HasWindowHandle) -> Self {
        let pens = Self::default();
        if is_on_x11(window) {
            xinput::listen(Arc::downgrade(&pens.0));
        }
        pens
    }

    fn lately<T>(&self, ask: impl FnOnce(&mut Lately) -> T) -> T {
        ask(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Whether there is one.
    pub fn are_there(&self) -> bool {
        self.lately(|lately| lately.is_there)
    }

    /// What they did since this was asked last: once a picture.
    pub fn since_last(&self) -> Moves {
        self.lately(|lately| {
            let told: Vec<Told> = lately.told.drain(..).collect();
            let now = down(&told);
            let before = std::mem::replace(&mut lately.down, now);
            Moves {
                told,
                down: now.or(before),
            }
        })
    }

    /// As if a pen had come down, gone along and up.
    #[cfg(test)]
    pub fn pretend(&self, down: Option<f64>, moves: &[f64], is_up: bool) {
        self.lately(|lately| {
            lately.is_there = true;
            down.into_iter().for_each(|press| lately.tell(Told::Down(press)));
            moves.iter().for_each(|press| lately.tell(Told::Moved(*press)));
            if is_up {
                lately.tell(Told::Up);
            }
        });
    }
}

/// What pens did in the time of a picture.
#[derive(Debug, Default)]
pub struct Moves {
    told: Vec<Told>,
    /// How hard the pen is pressed that came down last; nothing if none did: then it was a mouse.
    pub down: Option<f64>,
}

impl Moves {
    /// Of each of so many moves of the pointer how hard the pen was pressed: from where it came down, if it did, until it went up. As `before`
    /// where nothing is known.
    pub fn presses(&self, count: usize, before: f64) -> Vec<f64> {
        let is_down = |told: &Told| matches!(told, Told::Down(_));
        let from = self.told.iter().rposition(is_down).map_or(0, |n| n + 1);
        let way = self.told[from..].iter().take_while(|told| **told != Told::Up);
        let known: Vec<f64> = way
            .filter_map(|told| match told {
                Told::Moved(press) => Some(*press),
                _ => None,
            })
            .collect();
        let of = |n: usize| ((n + 1) * known.len()).div_ceil(count).saturating_sub(1);
        (0..count)
            .map(|n| known.get(of(n)).copied().unwrap_or(before))
            .collect()
    }
}

fn down(told: &[Told]) -> Option<f64> {
    told.iter().rev().find_map(|told| match told {
        Told::Down(press) => Some(*press),
        _ => None,
    })
}

fn is_on_x11(window: &impl HasWindowHandle) -> bool {
    let handle = window.window_handle().map(|handle| handle.as_raw());
    matches!(handle, Ok(RawWindowHandle::Xlib(_) | RawWindowHandle::Xcb(_)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moves_of_the_pointer_get_the_presses_of_the_pen_in_their_order() {
        let pens = Pens::default();
        assert!(!pens.are_there());
        assert_eq!(pens.since_last().down, None);
        pens.pretend(None, &[0.9, 0.9], false);
        pens.pretend(Some(0.1), &[0.2, 0.4, 0.6, 0.8], true);
        pens.pretend(None, &[0.0], false);
        let moves = pens.since_last();
        assert!(pens.are_there());
        assert_eq!(moves.down, Some(0.1));
        assert_eq!(moves.presses(4, 0.5), [0.2, 0.4, 0.6, 0.8]);
        assert_eq!(moves.presses(2, 0.5), [0.4, 0.8]);
        assert_eq!(moves.presses(8, 0.5), [0.2, 0.2, 0.4, 0.4, 0.6, 0.6, 0.8, 0.8]);
        assert!(moves.presses(0, 0.5).is_empty());
        // It was asked for, though the press may be heard of in the next picture.
        let moves = pens.since_last();
        assert_eq!((moves.presses(2, 0.5), moves.down), (vec![0.5, 0.5], Some(0.1)));
        assert_eq!(pens.since_last().down, None);
    }

    #[test]
    fn what_nobody_asks_for_is_forgotten() {
        let pens = Pens::default();
        pens.pretend(None, &vec![0.3; 2 * MOST], false);
        pens.pretend(None, &[0.7], false);
        let moves = pens.since_last();
        assert_eq!(moves.told.len(), MOST);
        assert_eq!(moves.presses(MOST, 0.0)[MOST - 1], 0.7);
    }
}
