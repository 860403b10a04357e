//! The tools, by their groups, and how the one in hand is set.

use egui::{CollapsingHeader, DragValue, Slider, Ui};

use crate::cli::quantity::human_number;
use crate::window::Bench;
use crate::window::actions::Action;
use crate::window::tool::{Filter, Group, Kind, Solid, Tool};

/// Smallest and largest radius of a tool, in shares of the scene's.
pub const RADII: [f64; 2] = [0.005, 0.6];

/// Groups that are open as long as nobody closes them.
const OPEN: [Group; 3] = [Group::Clay, Group::Force, Group::Warp];

/// Room below the palette for the settings, points.
const SETTINGS: f32 = 250.0;

/// Beside the scene.
pub fn tools(ui: &mut Ui, bench: &mut Bench) {
    ui.add_space(6.0);
    let palette = egui::ScrollArea::vertical()
        .id_salt("palette")
        .max_height((ui.available_height() - SETTINGS).max(120.0));
    let is_new = bench.tool_changed();
    palette.show(ui, |ui| {
        for group in Group::ALL {
            let is_in_hand = bench.tool.kind.group() == group;
            CollapsingHeader::new(group.name())
                .default_open(OPEN.contains(&group))
                // A tool that a key took shows.
                .open((is_in_hand && is_new).then_some(true))
                .show_unindented(ui, |ui| buttons(ui, bench, group));
        }
    });
    ui.separator();
    egui::ScrollArea::vertical()
        .id_salt("settings")
        .show(ui, |ui| settings(ui, bench));
}

fn buttons(ui: &mut Ui, bench: &mut Bench, group: Group) {
    ui.spacing_mut().item_spacing = egui::vec2(3.0, 2.0);
    let size = egui::vec2((ui.available_width() - 3.0) / 2.0, 20.0);
    let kinds: Vec<Kind> = Kind::ALL
        .iter()
        .copied()
        .filter(|kind| kind.group() == group)
        .collect();
    for row in kinds.chunks(2) {
        ui.horizontal(|ui| {
            for kind in row {
                let keys = bench.keys.text(Action::Take(*kind));
                let button = egui::Button::new(kind.name())
                    .selected(bench.tool.kind == *kind && !bench.arranging)
                    .shortcut_text(keys)
                    .min_size(size);
                if ui.add(button).on_hover_text(kind.hint()).clicked() {
                    bench.take(*kind);
                }
            }
        });
    }
}

/// How the tool in hand is set: what it has.
fn settings(ui: &mut Ui, bench: &mut Bench) {
    let unit = bench.chosen().map_or("", |thing| thing.unit);
    let size = bench.scene.1;
    let tool = &mut bench.tool;
    ui.strong(tool.kind.name());
    ui.spacing_mut().slider_width = 96.0;
    let mut radius = tool.radius * size;
    let label = ui
        .label("Radius  F")
        .on_hover_text("The keys [ and ] make it smaller and larger; F sets it by the mouse");
    let slider = Slider::new(&mut radius, RADII[0] * size..=RADII[1] * size)
        .logarithmic(true)
        .suffix(format!(" {unit}"))
        .custom_formatter(|n, _| human_number(n));
    if ui.add(slider).labelled_by(label.id).changed() {
        tool.radius = radius / size;
    }
    if tool.kind.has_strength() {
        let text = match value(tool) {
            Some(value) => format!("Strength: {value}"),
            None => "Strength".into(),
        };
        let label = ui.label(text).on_hover_text("Shift-F sets it by the mouse");
        ui.add(Slider::new(&mut tool.strength, 0.0..=1.0).max_decimals(2))
            .labelled_by(label.id);
    }
    if bench.has_pen && tool.kind.has_press() {
        let mut counts = !bench.ignores_pens;
        let switch = ui.checkbox(&mut counts, "Pen pressure");
        switch.on_hover_text("The harder the pen is pressed the nearer it comes to the strength above");
        bench.ignores_pens = !counts;
    }
    if tool.kind.has_press() {
        let switch = ui.checkbox(&mut bench.by_speed, "Slower is stronger");
        switch.on_hover_text(
            "Without a pen: the slower the mouse goes the nearer a stroke comes to the strength above",
        );
    }
    more(ui, tool);
    super::limits(ui, bench);
    clipping(ui, bench);
    ui.add_space(6.0);
    ui.weak("Ctrl: the opposite\nShift: smooth\nMiddle: turn, Shift: move\nWheel: zoom");
}

/// What a tool of paint paints, as people read it.
fn value(tool: &Tool) -> Option<String> {
    let (_, value) = tool.painted()?;
    Some(match tool.kind {
        Kind::SurfaceStiffness => format!("{} N/m", human_number(value)),
        Kind::Friction => human_number(value),
        _ => format!("× {}", human_number(value)),
    })
}

fn more(ui: &mut Ui, tool: &mut Tool) {
    let kind = tool.kind;
    let set = &mut tool.settings;
    if kind.has_solid() {
        choice(ui, "Solid", &mut set.solid, &Solid::ALL);
        number(
            ui,
            "Height",
            &mut set.height,
            0.1..=8.0,
            " radii",
            "Of the solid, in radii",
        );
    }
    if kind == Kind::Sweep {
        ui.checkbox(&mut set.follows, "Turns with its way");
    }
    if kind.has_angle() {
        number(
            ui,
            "Angle",
            &mut set.angle,
            -360.0..=360.0,
            "°",
            "How far it turns; Ctrl turns the other way",
        );
    }
    if kind.has_blend() {
        number(
            ui,
            "Round edge",
            &mut set.blend,
            0.0..=1.0,
            " radii",
            "Width over which the crease is rounded",
        );
    }
    if let Some(hint) = kind.falloff() {
        number(ui, "Falloff", &mut set.falloff, 0.0..=1.0, "", hint);
    }
    if kind == Kind::Smooth {
        ui.checkbox(&mut set.keeps_volume, "Keeps volume")
            .on_hover_text("Shapes wider than the brush hardly shrink");
    }
    if kind.is_force() {
        choice(ui, "Filter", &mut set.filter, &Filter::ALL);
        ui.checkbox(&mut set.gives_way, "Stiff parts stay behind")
            .on_hover_text(
                "The force is what unpainted matter needs; else it is as large as it takes to arrive",
            );
        let solids = [
            (None, "As the object"),
            (Some(false), "Clay: stays"),
            (Some(true), "Elastic: springs back"),
        ];
        choice(ui, "Matter", &mut set.elastic, &solids);
    }
    if matches!(kind, Kind::PinLine | Kind::PinOutline) {
        let mut is_spring = set.spring.is_some();
        if ui
            .checkbox(&mut is_spring, "By springs")
            .on_hover_text("Else the line does not move at all")
            .changed()
        {
            set.spring = is_spring.then_some(200.0);
        }
        if let Some(spring) = &mut set.spring {
            number(
                ui,
                "Stiffness",
                spring,
                1.0..=1e4,
                "",
                "Over that of the solid; 200 leaves a hundredth of a drag",
            );
        }
    }
    if !tool.acts_at_once() {
        number(
            ui,
            "Spacing",
            &mut tool.settings.spacing,
            0.05..=1.0,
            " radii",
            "Way of the mouse from step to step",
        );
    }
}

fn number(
    ui: &mut Ui,
    name: &str,
    value: &mut f64,
    range: std::ops::RangeInclusive<f64>,
    suffix: &str,
    hint: &str,
) {
    ui.horizontal(|ui| {
        let label = ui.label(name).on_hover_text(hint);
        let speed = (range.end() - range.start()).min(100.0) / 200.0;
        let field = DragValue::new(value)
            .range(range)
            .speed(speed)
            .max_decimals(3)
            .suffix(suffix);
        ui.add(field).on_hover_text(hint).labelled_by(label.id);
    });
}

fn choice<T: Copy + PartialEq>(ui: &mut Ui, name: &str, value: &mut T, all: &[(T, &str)]) {
    let shown = all
        .iter()
        .find(|(is, _)| is == value)
        .map_or("", |(_, text)| text);
    egui::ComboBox::from_label(name)
        .width(104.0)
        .selected_text(shown)
        .show_ui(ui, |ui| {
            for (is, text) in all {
                ui.selectable_value(value, *is, *text);
            }
        });
}

fn clipping(ui: &mut Ui, bench: &mut Bench) {
    let Some(mut height) = bench.plane_height() else {
        return;
    };
    let unit = bench.chosen().map_or("", |thing| thing.unit);
    let radius = bench.scene.1;
    let label = ui.label("Clipping plane");
    let slider = Slider::new(&mut height, -radius..=radius)
        .custom_formatter(|n, _| human_number(n))
        .suffix(format!(" {unit}"));
    if ui.add(slider).labelled_by(label.id).changed() {
        bench.set_plane_height(height);
    }
}
