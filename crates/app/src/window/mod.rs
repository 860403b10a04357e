//! The program that people open: what is seen in the middle, panels round it, and a desk that does the work on a thread of its own.

mod adjust;
mod desk;
mod gesture;
mod hand;
mod marks;
mod modeler;
pub mod orders;
mod preview;
pub mod samples;
pub mod tool;
pub mod touch;

#[cfg(test)]
mod tests;

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

pub use modeler::Bench;
use modeler::Modeler;

use crate::view::Screen;

/// A window with the modeler in it.
struct Frame {
    modeler: Option<Modeler>,
    /// Where the modeler goes when the window closes because the graphics card is lost.
    left: Rc<RefCell<Option<Modeler>>>,
}

impl eframe::App for Frame {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        if let Some(modeler) = &mut self.modeler {
            modeler.show(ui);
        }
    }

    fn on_exit(&mut self) {
        match self.modeler.take() {
            Some(modeler) if modeler.is_lost() => *self.left.borrow_mut() = Some(modeler),
            Some(modeler) => modeler.close(),
            None => {}
        }
    }
}

/// Opens the window, with files in it; returns when it is closed. Where the graphics card is lost, another window opens on the same
/// document.
///
/// # Errors
/// What keeps it from opening, and what helps.
pub fn run(mut files: Vec<PathBuf>) -> Result<(), String> {
    let left = Rc::new(RefCell::new(None));
    loop {
        let outcome = once(std::mem::take(&mut files), &left);
        if left.borrow().is_none() {
            return outcome;
        }
    }
}

/// One window, with what is left of the one before.
fn once(files: Vec<PathBuf>, left: &Rc<RefCell<Option<Modeler>>>) -> Result<(), String> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("isoclay")
            .with_app_id("isoclay")
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([640.0, 400.0]),
        renderer: eframe::Renderer::Wgpu,
        // Without a graphics card every pixel of the panels counts.
        dithering: false,
        wgpu_options: eframe::egui_wgpu::WgpuConfiguration {
            surface: eframe::egui_wgpu::SurfaceConfig::LOW_LATENCY,
            ..eframe::egui_wgpu::WgpuConfiguration::default()
        },
        ..eframe::NativeOptions::default()
    };
    let before = left.borrow_mut().take();
    let left = left.clone();
    let begun = eframe::run_native(
        "isoclay",
        options,
        Box::new(move |context| {
            let modeler = match before {
                None => Modeler::new(context, files),
                Some(mut modeler) => {
                    let screen = context.wgpu_render_state.clone().map(Screen::new);
                    modeler.resume(&context.egui_ctx, screen);
                    modeler
                }
            };
            Ok(Box::new(Frame {
                modeler: Some(modeler),
                left,
            }))
        }),
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
