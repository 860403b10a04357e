//! A scene that is played on the chosen object: what it is made of, by which law it moves, and how exactly.

use document::Command;
use egui::{ComboBox, DragValue, Ui};

use crate::window::Bench;
use crate::window::orders::{Order, Thing};

/// Laws of springs, as scenes have them.
const LAWS: [&str; 2] = ["linear", "4-d"];
const INTEGRATORS: [&str; 4] = ["tr-bdf2", "paper", "auto", "adaptive"];

/// Matters to begin with: stiffness, damping, scale of rest lengths, plasticity a second, and whether the shape stays.
const PRESETS: [(&str, &str, [f64; 4], bool); 4] = [
    (
        "Swelling clay",
        "What is inside swells, and keeps its shape",
        [1.0, 1.0, 1.1, 2.0],
        true,
    ),
    (
        "Shrinking clay",
        "The same the other way round",
        [1.0, 1.0, 0.9, 2.0],
        true,
    ),
    (
        "Soft clay",
        "Lets painted rest lengths show, and keeps them",
        [0.5, 2.0, 1.0, 4.0],
        true,
    ),
    ("Rubber", "Swings, and springs back", [4.0, 0.1, 1.0, 0.0], false),
];

/// The scene as it is set.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// Whether its panel is shown.
    pub is_open: bool,
    mass: f64,
    stiffness: f64,
    damping: f64,
    ground: f64,
    rest_scale: f64,
    law: usize,
    plasticity: f64,
    keeps: bool,
    duration: f64,
    step: f64,
    integrator: usize,
    tolerance: f64,
    /// Part of the object's box about its middle that moves.
    share: f64,
    /// Level of the field that moves.
    level: u8,
}

impl Default for Simulation {
    fn default() -> Self {
        Self {
            is_open: false,
            mass: 1.0,
            stiffness: 1.0,
            damping: 1.0,
            ground: 0.0,
            rest_scale: 1.0,
            law: 0,
            plasticity: 2.0,
            keeps: true,
            duration: 1.0,
            step: 0.05,
            integrator: 0,
            tolerance: 0.01,
            share: 0.8,
            level: 0,
        }
    }
}

impl Simulation {
    /// The scene on an object, as `isoclay simulate` and `sculpt` take it.
    pub fn script(&self, thing: &Thing) -> String {
        let (center, half) = (thing.own_box.center(), 0.5 * self.share * thing.own_box.size());
        let [min, max] = [center - half, center + half].map(|p| p.to_array());
        let error = match INTEGRATORS[self.integrator] {
            "adaptive" => format!("tolerance = {:?}\n", self.tolerance),
            _ => String::new(),
        };
        let end = if self.keeps { "clay" } else { "elastic" };
        format!(
            "field = \"object.iclay\"\n\n[region]\nmin = {min:?}\nmax = {max:?}\nlevel = {}\n\n[material]\nmass = {:?}\nstiffness = {:?}\ndamping = {:?}\nground = {:?}\n\
             rest-scale = {:?}\n\n[law]\nkind = \"{}\"\n\n[time]\nduration = {:?}\nstep = {:?}\nintegrator = \"{}\"\n{error}\n\
             [plasticity]\nrate = {:?}\n\n[release]\nas = \"{end}\"\n",
            self.level,
            self.mass,
            self.stiffness,
            self.damping,
            self.ground,
            self.rest_scale,
            LAWS[self.law],
            self.duration,
            self.step,
            INTEGRATORS[self.integrator],
            self.plasticity,
        )
    }
}

/// In a panel of its own.
pub fn simulation(ui: &mut Ui, bench: &mut Bench) {
    let set = &mut bench.simulation;
    ui.horizontal_wrapped(|ui| {
        for (name, hint, [stiffness, damping, rest_scale, plasticity], keeps) in PRESETS {
            if ui.small_button(name).on_hover_text(hint).clicked() {
                (set.stiffness, set.damping, set.rest_scale) = (stiffness, damping, rest_scale);
                (set.plasticity, set.keeps) = (plasticity, keeps);
            }
        }
    });
    ui.separator();
    egui::Grid::new("simulation").num_columns(2).show(ui, |ui| {
        row(
            ui,
            "Moves",
            &mut set.share,
            0.1..=1.0,
            "",
            "Part of the object's box about its middle; beside it nothing moves",
        );
        row(
            ui,
            "Mass",
            &mut set.mass,
            1e-3..=1e3,
            "",
            "Per volume; paint multiplies it",
        );
        row(
            ui,
            "Stiffness",
            &mut set.stiffness,
            1e-3..=1e3,
            "",
            "Per volume; paint multiplies it",
        );
        row(
            ui,
            "Damping",
            &mut set.damping,
            0.0..=1e3,
            "",
            "Per volume; paint multiplies it",
        );
        row(
            ui,
            "Ground",
            &mut set.ground,
            0.0..=1e3,
            "",
            "Springs that tie every density to its first value, per volume",
        );
        row(
            ui,
            "Rest length",
            &mut set.rest_scale,
            0.2..=5.0,
            "×",
            "Above 1 the solid swells, below 1 it shrinks",
        );
        let hint = "Of the field that moves: 0 is the coarsest, each one more takes eight times as long";
        let label = ui.label("Level").on_hover_text(hint);
        ui.add(DragValue::new(&mut set.level).range(0..=8))
            .labelled_by(label.id);
        ui.end_row();
        pick(ui, "Law", &mut set.law, &LAWS, "Of the springs between densities");
        row(
            ui,
            "Plasticity",
            &mut set.plasticity,
            0.0..=100.0,
            "/s",
            "How fast rest lengths follow the present ones; 0 is elastic",
        );
        row(
            ui,
            "Time",
            &mut set.duration,
            1e-3..=60.0,
            "s",
            "How long it moves",
        );
        row(
            ui,
            "Step",
            &mut set.step,
            1e-4..=1.0,
            "s",
            "Of the integrator; the first one if it adapts",
        );
        pick(
            ui,
            "Integrator",
            &mut set.integrator,
            &INTEGRATORS,
            "auto takes the cheaper way, adaptive follows its error",
        );
        if INTEGRATORS[set.integrator] == "adaptive" {
            row(
                ui,
                "Error allowed",
                &mut set.tolerance,
                1e-6..=10.0,
                "",
                "Of the densities in a step, root mean square",
            );
        }
    });
    ui.checkbox(&mut set.keeps, "Keeps the shape at the end")
        .on_hover_text("Else forces go and it swings back");
    let (set, chosen) = (bench.simulation.clone(), bench.chosen().cloned());
    let is_free = bench.busy.is_none() && chosen.is_some();
    let button = ui.add_enabled(is_free, egui::Button::new("Play"));
    let button = button.on_hover_text("Moves the chosen object, as one edit; undo takes it back");
    if let Some(thing) = chosen.filter(|_| button.clicked()) {
        bench.order(Order::Command(Box::new(Command::Scene {
            script: set.script(&thing),
            object: thing.name,
        })));
    }
}

fn row(
    ui: &mut Ui,
    name: &str,
    value: &mut f64,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
    hint: &str,
) {
    let label = ui.label(name).on_hover_text(hint);
    let speed = (0.01 * value.abs()).max(1e-3 * range.end().min(1.0));
    let suffix = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    let field = DragValue::new(value)
        .range(range)
        .speed(speed)
        .max_decimals(4)
        .suffix(suffix);
    ui.add(field).on_hover_text(hint).labelled_by(label.id);
    ui.end_row();
}

fn pick(ui: &mut Ui, name: &str, value: &mut usize, all: &[&str], hint: &str) {
    ui.label(name).on_hover_text(hint);
    ComboBox::from_id_salt(name)
        .selected_text(all[*value])
        .show_ui(ui, |ui| {
            for (n, text) in all.iter().enumerate() {
                ui.selectable_value(value, n, *text);
            }
        });
    ui.end_row();
}
