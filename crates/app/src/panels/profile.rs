//! Densities along a line that was drawn in a plane.

use bspline::Field;
use egui::{Align2, Color32, FontId, Stroke, pos2, vec2};
use glam::DVec3;

use crate::cli::quantity::human_number;
use crate::window::orders::Thing;

/// Places along the line.
const PLACES: usize = 240;
/// Size of the chart, and room beside it for numbers, points.
const SIZE: [f32; 2] = [420.0, 120.0];
const BESIDE: f32 = 56.0;

/// A line in an object's own world, and the densities along it.
pub struct Profile {
    /// Across which axis the plane is that it lies in.
    pub axis: usize,
    /// Where it begins and ends.
    pub ends: [DVec3; 2],
    /// At even distances.
    pub values: Vec<f64>,
}

impl Profile {
    /// One that begins at a place.
    pub fn new(axis: usize, at: DVec3, field: &dyn Field) -> Self {
        let mut profile = Self {
            axis,
            ends: [at; 2],
            values: Vec::new(),
        };
        profile.read(field);
        profile
    }

    /// Reads the densities anew.
    pub fn read(&mut self, field: &dyn Field) {
        let [from, to] = self.ends;
        let place = |n: usize| from.lerp(to, n as f64 / (PLACES - 1) as f64);
        self.values = (0..PLACES).map(|n| field.value(place(n))).collect();
    }

    /// Where along the line, as shares of it, the density goes through the surface's.
    fn crossings(&self, iso: f64) -> impl Iterator<Item = f64> {
        self.values.windows(2).enumerate().filter_map(move |(n, pair)| {
            let [a, b] = [pair[0] - iso, pair[1] - iso];
            let share = (n as f64 + a / (a - b)) / (PLACES - 1) as f64;
            ((a > 0.0) != (b > 0.0)).then_some(share)
        })
    }
}

/// A chart of the densities along a line, with the surface.
pub fn profile(ui: &mut egui::Ui, line: &Profile, thing: &Thing) {
    let length = line.ends[0].distance(line.ends[1]);
    let finite = || line.values.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(thing.iso, f64::min);
    let high = finite().fold(thing.iso, f64::max);
    if length == 0.0 || low == high {
        ui.weak("Drag in a plane: the densities along that line are shown");
        return;
    }
    let (rect, response) = ui.allocate_exact_size(SIZE.into(), egui::Sense::hover());
    let chart = egui::Rect::from_min_max(rect.min + vec2(BESIDE, 4.0), rect.max - vec2(8.0, 18.0));
    let painter = ui.painter();
    painter.rect_filled(chart, 2.0, ui.visuals().extreme_bg_color);
    let place = |share: f64, value: f64| {
        let high = ((value - low) / (high - low)) as f32;
        pos2(
            chart.left() + share as f32 * chart.width(),
            chart.bottom() - high * chart.height(),
        )
    };
    let surface = Stroke::new(1.0, Color32::from_rgb(255, 170, 60));
    painter.hline(chart.x_range(), place(0.0, thing.iso).y, surface);
    let all = line.values.iter().enumerate().filter(|(_, v)| v.is_finite());
    let all = all.map(|(n, v)| place(n as f64 / (PLACES - 1) as f64, *v));
    painter.line(all.collect(), Stroke::new(1.5, ui.visuals().text_color()));
    let text = |at, align, text: String| {
        painter.text(
            at,
            align,
            text,
            FontId::proportional(11.0),
            ui.visuals().weak_text_color(),
        );
    };
    text(
        chart.left_top() - vec2(4.0, 0.0),
        Align2::RIGHT_TOP,
        human_number(high),
    );
    text(
        chart.left_bottom() - vec2(4.0, 0.0),
        Align2::RIGHT_BOTTOM,
        human_number(low),
    );
    text(chart.left_bottom() + vec2(0.0, 3.0), Align2::LEFT_TOP, "0".into());
    let end = format!("{} {}", human_number(length), thing.unit);
    text(
        chart.right_bottom() + vec2(0.0, 3.0),
        Align2::RIGHT_TOP,
        end.trim_end().into(),
    );
    let crossings: Vec<f64> = line.crossings(thing.iso).collect();
    let widths = crossings
        .windows(2)
        .map(|pair| human_number((pair[1] - pair[0]) * length));
    let widths: Vec<String> = widths.take(4).collect();
    if !widths.is_empty() {
        let told = format!("between surfaces: {}", widths.join(", "));
        text(chart.center_bottom() + vec2(0.0, 3.0), Align2::CENTER_TOP, told);
    }
    if let Some(at) = response.hover_pos().filter(|at| chart.contains(*at)) {
        let share = f64::from((at.x - chart.left()) / chart.width());
        let value = line.values[((share * (PLACES - 1) as f64).round() as usize).min(PLACES - 1)];
        painter.vline(
            at.x,
            chart.y_range(),
            Stroke::new(1.0, ui.visuals().weak_text_color()),
        );
        let told = format!(
            "{} at {} {}",
            human_number(value),
            human_number(share * length),
            thing.unit
        );
        text(
            chart.center_top() + vec2(0.0, 2.0),
            Align2::CENTER_TOP,
            told.trim_end().into(),
        );
    }
}

#[cfg(test)]
mod tests {
    use bspline::primitives::Sphere;

    use super::*;

    #[test]
    fn a_line_through_a_ball_crosses_it_a_diameter_apart() {
        let ball = Sphere::new(DVec3::new(1.0, 0.0, 0.0), 3.0).unwrap();
        let mut line = Profile::new(2, DVec3::new(-9.0, 0.0, 0.0), &ball);
        assert_eq!(line.crossings(0.0).count(), 0);
        line.ends[1] = DVec3::new(11.0, 0.0, 0.0);
        line.read(&ball);
        let crossings: Vec<f64> = line.crossings(0.0).collect();
        assert_eq!(crossings.len(), 2);
        assert!(
            ((crossings[1] - crossings[0]) * 20.0 - 6.0).abs() < 1e-9,
            "{crossings:?}"
        );
        // At another density it is thinner.
        let inner: Vec<f64> = line.crossings(1.0).collect();
        assert!(((inner[1] - inner[0]) * 20.0 - 4.0).abs() < 1e-9, "{inner:?}");
    }
}
