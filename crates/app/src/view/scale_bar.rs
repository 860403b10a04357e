//! How long things are in the picture.

use egui::{Align2, Color32, FontId, Painter, Rect, Stroke, vec2};

/// Longest bar, and its distance from the corner, points.
const LONGEST: f32 = 140.0;
const ASIDE: f32 = 18.0;

/// Room that a bar takes at most, with what is left beside it, points.
pub const WIDE: f32 = LONGEST + 2.0 * ASIDE;

/// The longest length of 1, 2 or 5 times a power of ten that is no longer than `most`, and how it is written.
fn round_length(most: f64) -> (f64, String) {
    let power = most.log10().floor();
    let digit = [5.0, 2.0, 1.0]
        .into_iter()
        .find(|d| d * libm::exp10(power) <= most);
    let length = digit.unwrap_or(1.0) * libm::exp10(power);
    (length, format!("{length:.*}", (-power).max(0.0) as usize))
}

/// Draws a bar into the lower left corner; a point of the screen is so long at the middle of the scene.
pub fn scale_bar(painter: &Painter, rect: Rect, length_of_point: f64, unit: &str) {
    if !(length_of_point.is_finite() && length_of_point > 0.0) {
        return;
    }
    let (length, number) = round_length(f64::from(LONGEST) * length_of_point);
    let width = (length / length_of_point) as f32;
    let left = rect.left_bottom() + vec2(ASIDE, -ASIDE);
    let right = left + vec2(width, 0.0);
    let up = vec2(0.0, -5.0);
    let bar = vec![left + up, left, right, right + up];
    // Dark under light, to be seen on both.
    for stroke in [
        Stroke::new(3.5, Color32::from_black_alpha(120)),
        Stroke::new(1.5, Color32::from_gray(230)),
    ] {
        painter.add(egui::Shape::line(bar.clone(), stroke));
    }
    let text = format!("{number} {unit}");
    let at = left + vec2(0.5 * width, -7.0);
    for (aside, color) in [
        (1.0, Color32::from_black_alpha(160)),
        (0.0, Color32::from_gray(230)),
    ] {
        let font = FontId::proportional(12.0);
        painter.text(
            at + vec2(aside, aside),
            Align2::CENTER_BOTTOM,
            text.trim(),
            font,
            color,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_round_and_fill_the_bar() {
        for (most, length, text) in [
            (0.0314, 0.02, "0.02"),
            (1.0, 1.0, "1"),
            (4.9, 2.0, "2"),
            (5.1, 5.0, "5"),
            (999.0, 500.0, "500"),
        ] {
            let (found, number) = round_length(most);
            assert!((found - length).abs() < 1e-9 * length, "{found} for {most}");
            assert_eq!(number, text);
        }
    }
}
