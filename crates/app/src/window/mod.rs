//! The program that people open: what is seen in the middle, panels round it, and a desk that does the work on a thread of its own.

pub mod actions;
mod adjust;
pub mod arrange;
mod bench;
mod desk;
mod docks;
mod four;
mod gesture;
mod hand;
mod handles;
mod kept;
pub mod keys;
mod lasso;
mod layout;
pub mod limits;
mod marks;
pub mod measure;
mod modeler;
pub mod orders;
mod pace;
mod pen;
mod preview;
pub mod samples;
pub mod shot;
pub mod show;
pub mod tool;
pub mod touch;

#[cfg(test)]
mod tests;

use std::cell::RefCell;
use std::panic::AssertUnwindSafe;
use std::path::PathBuf;
use std::rc::Rc;
use std::time::{Duration, Instant};

pub use bench::Bench;
use modeler::Modeler;

use crate::view::{DRIVERS, Screen};

/// What works in the window, and stays when that falls.
type Shared = Rc<RefCell<Option<Modeler>>>;

/// Windows that are opened in a row on graphics cards that are lost at once. The first after a fall does not always open.
const TRIALS: usize = 5;
/// Time after which a card was not lost at once.
const LONG: Duration = Duration::from_secs(10);

/// A window with the modeler in it.
struct Frame(Shared);

impl eframe::App for Frame {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        if let Some(modeler) = &mut *self.0.borrow_mut() {
            modeler.show(ui);
        }
    }

    fn on_exit(&mut self) {
        let mut modeler = self.0.borrow_mut();
        if let Some(modeler) = modeler.take_if(|m| !m.is_lost(false)) {
            modeler.close();
        }
    }
}

/// Opens the window, with files in it; returns when it is closed. Where the graphics card is lost, another window opens on the same
/// document.
///
/// # Errors
/// What keeps it from opening, and what helps.
pub fn run(mut files: Vec<PathBuf>) -> Result<(), String> {
    let modeler = Shared::default();
    let mut trials = 0;
    loop {
        let start = Instant::now();
        // egui falls where it finds no card any more.
        let once = AssertUnwindSafe(|| once(std::mem::take(&mut files), &modeler));
        let outcome = std::panic::catch_unwind(once);
        let left = modeler.borrow_mut().take();
        trials = if start.elapsed() < LONG { trials + 1 } else { 1 };
        match (outcome, left) {
            (_, Some(left)) if left.is_lost(true) && trials < TRIALS => {
                if trials == 1 {
                    eprintln!("isoclay: the graphics card was lost; the window opens again");
                }
                *modeler.borrow_mut() = Some(left);
            }
            (outcome, left) => {
                left.into_iter().for_each(Modeler::close);
                return outcome.unwrap_or_else(|fall| std::panic::resume_unwind(fall));
            }
        }
    }
}

/// What desktops show for the window.
fn icon() -> egui::IconData {
    let picture = include_bytes!("../../desktop/isoclay-64.png");
    eframe::icon_data::from_png_bytes(picture).expect("the picture is a PNG")
}

/// One window, with what is left of the one before.
fn once(files: Vec<PathBuf>, shared: &Shared) -> Result<(), String> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("isoclay")
            .with_app_id("isoclay")
            .with_icon(icon())
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
    let shared = shared.clone();
    let begun = eframe::run_native(
        "isoclay",
        options,
        Box::new(move |context| {
            match &mut *shared.borrow_mut() {
                Some(before) => {
                    let screen = context.wgpu_render_state.as_ref().map(Screen::new);
                    before.resume(&context.egui_ctx, screen);
                }
                none => *none = Some(Modeler::new(context, files)),
            }
            Ok(Box::new(Frame(shared)))
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
            "no window can be opened ({why}); isoclay needs a display, and a graphics driver for Vulkan or OpenGL: {DRIVERS}"
        )
    })
}
