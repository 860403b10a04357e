//! What colours mean: a band of them with numbers.

use egui::{Align2, Color32, CornerRadius, FontId, Painter, Rect, Stroke, pos2, vec2};

/// Size of the band, and its distance from the corner, points.
const BAND: [f32; 2] = [200.0, 10.0];
const ASIDE: f32 = 16.0;
/// Height of a legend with its text, points.
const HIGH: f32 = 52.0;

/// What colours mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// What the numbers are, with their unit.
    pub title: String,
    /// Colours from left to right, of one width.
    pub colors: Vec<[u8; 3]>,
    /// Shares of the band and the numbers there.
    pub marks: Vec<(f32, String)>,
}

impl Legend {
    /// Draws several into the lower right corner, one over the other; the lowest first.
    pub fn draw(all: &[Self], painter: &Painter, rect: Rect) {
        for (n, legend) in all.iter().enumerate() {
            let corner = rect.right_bottom() - vec2(ASIDE + BAND[0], ASIDE + (n as f32 + 1.0) * HIGH);
            legend.draw_at(painter, corner);
        }
    }

    /// What a picture has left beside so many legends for what is so wide, or above them where it is too narrow for both.
    pub fn beside(count: usize, rect: Rect, wide: f32) -> Rect {
        let has_room = rect.width() >= wide + 2.0 * ASIDE + BAND[0];
        let taken = match count {
            1.. if !has_room => ASIDE + count as f32 * HIGH,
            _ => 0.0,
        };
        Rect::from_min_max(rect.min, rect.max - vec2(0.0, taken))
    }

    fn draw_at(&self, painter: &Painter, corner: egui::Pos2) {
        let font = || FontId::proportional(12.0);
        let ink = Color32::from_gray(230);
        let paper = Rect::from_min_size(corner, vec2(BAND[0], HIGH - 6.0)).expand2(vec2(10.0, 3.0));
        painter.rect_filled(paper, CornerRadius::same(4), Color32::from_black_alpha(150));
        painter.text(corner, Align2::LEFT_TOP, &self.title, font(), ink);
        let top = corner.y + 16.0;
        let width = BAND[0] / self.colors.len() as f32;
        for (n, [r, g, b]) in self.colors.iter().enumerate() {
            let left = corner.x + n as f32 * width;
            // Without seams.
            let one = Rect::from_min_max(pos2(left, top), pos2(left + width + 0.3, top + BAND[1]));
            painter.rect_filled(one, 0.0, Color32::from_rgb(*r, *g, *b));
        }
        for (share, text) in &self.marks {
            let x = corner.x + share * BAND[0];
            painter.vline(x, top + BAND[1]..=top + BAND[1] + 3.0, Stroke::new(1.0, ink));
            let align = match share {
                s if *s < 0.1 => Align2::LEFT_TOP,
                s if *s > 0.9 => Align2::RIGHT_TOP,
                _ => Align2::CENTER_TOP,
            };
            painter.text(pos2(x, top + BAND[1] + 3.0), align, text, font(), ink);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_beside_legends_is_above_them_in_narrow_pictures() {
        let picture = |wide: f32| Rect::from_min_size(pos2(10.0, 20.0), vec2(wide, 300.0));
        assert_eq!(Legend::beside(2, picture(800.0), 180.0), picture(800.0));
        let narrow = Legend::beside(2, picture(234.0), 180.0);
        assert_eq!(narrow.bottom(), 320.0 - ASIDE - 2.0 * HIGH);
        assert_eq!(Legend::beside(0, picture(234.0), 180.0), picture(234.0));
    }
}
