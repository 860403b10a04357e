//! Windows over the scene.

use egui::{Context, Pos2, Window, pos2};

/// Height of the menu, which they leave free in a low window too, points.
const MENU: f32 = 25.0;

/// A window over the scene, where it is at first.
pub fn over(context: &Context, title: &'static str, x: f32) -> Window<'static> {
    let mut room = context.content_rect();
    room.min.y += MENU;
    let at: Pos2 = pos2(x, MENU + 11.0);
    Window::new(title).default_pos(at).constrain_to(room)
}
