//! How solids become pixels.

use crate::view::Mode;
use crate::window::Bench;

/// All ways, by their names, and what each shows.
const MODES: [(Mode, &str, &str); 3] = [
    (Mode::Mesh, "Mesh", "Triangles of the surface: the fastest"),
    (
        Mode::Rays,
        "Rays",
        "The spline itself, line by line: no triangle leaves it, however near the eye comes",
    ),
    (
        Mode::Volume,
        "Volume",
        "Mist that is denser where the density is higher, from black to white",
    ),
];

/// The way after one.
pub fn next_mode(mode: Mode) -> Mode {
    let at = MODES.iter().position(|(of, ..)| *of == mode).unwrap_or(0);
    MODES[(at + 1) % MODES.len()].0
}

/// One of the ways is chosen, from the right end of a row on.
pub fn modes(ui: &mut egui::Ui, bench: &mut Bench) {
    ui.spacing_mut().item_spacing.x = 2.0;
    for (mode, name, hint) in MODES.into_iter().rev() {
        let is_possible = bench.can_cast || mode == Mode::Mesh;
        let button = egui::Button::selectable(bench.look.mode == mode, name);
        let button = ui
            .add_enabled(is_possible, button)
            .on_hover_text(format!("{hint} (V shows the next)"))
            .on_disabled_hover_text("This graphics driver lets pictures read too little memory for that");
        if button.clicked() {
            bench.look.mode = mode;
        }
    }
}
