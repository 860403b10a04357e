//! The program that people open: what is seen in the middle, panels round it, and a desk that does the work on a thread of its own.

mod adjust;
mod desk;
mod gesture;
mod hand;
mod marks;
mod modeler;
pub mod orders;
pub mod samples;
pub mod tool;
pub mod touch;

#[cfg(test)]
mod tests;

use std::path::PathBuf;

pub use modeler::Bench;
use modeler::Modeler;

/// Opens the window, with files in it; returns when it is closed.
///
/// # Errors
/// What keeps it from opening, and what helps.
pub fn run(files: Vec<PathBuf>) -> Result<(), String> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("isoclay")
            .with_app_id("isoclay")
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([640.0, 400.0]),
        renderer: eframe::Renderer::Wgpu,
        ..eframe::NativeOptions::default()
    };
    let begun = eframe::run_native(
        "isoclay",
        options,
        Box::new(move |context| Ok(Box::new(Modeler::new(context, files)))),
    );
    begun.map_err(|why| {
        let why = match why {
            eframe::Error::Winit(_) | eframe::Error::WinitEventLoop(_) => {
                "neither DISPLAY nor WAYLAND_DISPLAY leads to one".to_string()
            }
            why => why.to_string(),
        };
        format!(
            "no window can be opened ({why}); isoclay needs a display, and a graphics driver for Vulkan or OpenGL: on Debian without a \
             graphics card install mesa-vulkan-drivers, or set WGPU_BACKEND=gl"
        )
    })
}
