//! On the left: the tools and how they are set.

use crate::cli::quantity::human_number;
use crate::window::Bench;
use crate::window::tool::Kind;

/// Smallest and largest radius of a tool, in shares of the scene's.
pub const RADII: [f64; 2] = [0.005, 0.6];

/// On the left.
pub fn tools(ui: &mut egui::Ui, bench: &mut Bench) {
    ui.add_space(6.0);
    ui.heading("Tools");
    for kind in Kind::ALL {
        let is_chosen = bench.tool.kind == kind;
        let button = egui::Button::new(kind.name())
            .selected(is_chosen)
            .shortcut_text(kind.key().name())
            .min_size(egui::vec2(ui.available_width(), 26.0));
        if ui.add(button).on_hover_text(kind.hint()).clicked() {
            bench.tool.kind = kind;
        }
    }
    ui.add_space(10.0);
    let unit = bench
        .sheet
        .as_ref()
        .and_then(|s| s.objects.get(s.chosen))
        .map_or("", |t| t.unit);
    let size = bench.scene.1;
    let mut radius = bench.tool.radius * size;
    let label = ui
        .label("Radius  F")
        .on_hover_text("The keys [ and ] make it smaller and larger; F sets it by the mouse");
    let slider = egui::Slider::new(&mut radius, RADII[0] * size..=RADII[1] * size)
        .logarithmic(true)
        .suffix(format!(" {unit}"))
        .custom_formatter(|n, _| human_number(n));
    ui.spacing_mut().slider_width = 96.0;
    if ui.add(slider).labelled_by(label.id).changed() {
        bench.tool.radius = radius / size;
    }
    let label = ui.label("Strength").on_hover_text("Shift-F sets it by the mouse");
    ui.add(egui::Slider::new(&mut bench.tool.strength, 0.0..=1.0).max_decimals(2))
        .labelled_by(label.id);
    ui.add_space(10.0);
    if let Some((at, normal)) = bench.look.cut {
        let (center, radius) = bench.scene;
        let mut height = (at - center).dot(normal);
        let label = ui.label("Clipping plane");
        let slider = egui::Slider::new(&mut height, -radius..=radius)
            .custom_formatter(|n, _| human_number(n))
            .suffix(format!(" {unit}"));
        if ui.add(slider).labelled_by(label.id).changed() {
            bench.look.cut = Some((center + height * normal, normal));
        }
    }
    ui.with_layout(egui::Layout::bottom_up(egui::Align::Min), |ui| {
        ui.add_space(6.0);
        ui.weak("Ctrl: the opposite\nShift: smooth\nMiddle: turn, Shift: move\nWheel: zoom");
    });
}
