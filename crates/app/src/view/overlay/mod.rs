//! What is drawn besides the surfaces: lines and dots, a surface that is looked through, and the density on the cut.

mod brushes;
mod cap;
pub mod cells;
pub mod floor;
pub mod legend;
mod lines;

use std::cell::OnceCell;
use std::collections::BTreeMap;

use eframe::egui_wgpu::wgpu;

pub use self::brushes::Brushes;
pub use self::cap::Caps;
pub use self::legend::Legend;
pub use self::lines::{Lines, Stretch, edges};
use super::held::{Held, draw};
use super::{Cells, Look, Mode};

/// What lines and dots show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ink {
    /// Cells of a fit.
    Cells,
    /// Points that were fitted.
    Points,
    /// A grid below, and the axes.
    Floor,
}

impl Ink {
    fn is_shown(self, look: &Look) -> bool {
        match self {
            Self::Cells => look.show.cells != Cells::Off,
            Self::Points => look.show.points,
            Self::Floor => look.show.floor,
        }
    }
}

/// All that is drawn besides the surfaces.
pub struct Overlay {
    device: wgpu::Device,
    /// Of the scene, and of lights.
    layouts: [wgpu::BindGroupLayout; 2],
    /// For one sample a pixel, and for several; made when they are needed first.
    brushes: [OnceCell<Brushes>; 2],
    inks: BTreeMap<Ink, Lines>,
    /// What is looked through.
    pub veil: Vec<Held>,
    /// Within which object it lies, if it does: then that one's surface is what is looked through.
    pub within: Option<String>,
    /// The density on the cut.
    pub caps: Caps,
}

impl Overlay {
    /// With nothing in it, for scenes and lights that are bound so.
    pub fn new(device: &wgpu::Device, layouts: [wgpu::BindGroupLayout; 2]) -> Self {
        Self {
            device: device.clone(),
            layouts,
            brushes: Default::default(),
            inks: BTreeMap::new(),
            veil: Vec::new(),
            within: None,
            caps: Caps::new(device),
        }
    }

    /// Forgets all that lies in a scene.
    pub fn clear(&mut self) {
        self.inks.clear();
        self.veil.clear();
        self.caps.clear();
    }

    /// Puts lines in place of those that there were.
    pub fn put(&mut self, ink: Ink, stretches: &[Stretch]) {
        match stretches.is_empty() {
            true => self.inks.remove(&ink),
            false => self.inks.insert(ink, Lines::new(&self.device, stretches)),
        };
    }

    /// What draws pictures of so many samples a pixel, by its number.
    pub fn brushes(&self, which: usize, samples: u32) -> &Brushes {
        self.brushes[which].get_or_init(|| {
            let [scene, lights] = &self.layouts;
            Brushes::new(&self.device, [scene, self.caps.layout(), lights], samples)
        })
    }

    /// Whether a look shows anything of it.
    pub fn is_shown(&self, look: &Look) -> bool {
        let has_ink = self.inks.keys().any(|ink| ink.is_shown(look));
        let has_cap = look.mode == Mode::Mesh && look.cut.is_some();
        has_ink || has_cap || self.has_veil(look) || look.show.wireframe && look.mode == Mode::Mesh
    }

    /// Whether a look shows what is looked through.
    pub fn has_veil(&self, look: &Look) -> bool {
        look.show.second && !self.veil.is_empty()
    }

    /// Draws the density on the cut, and lines; `wired` are the surfaces whose triangles may be shown.
    pub fn draw<'a>(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        brushes: &Brushes,
        look: &Look,
        wired: impl Iterator<Item = &'a Held>,
    ) {
        if look.mode == Mode::Mesh && look.cut.is_some() {
            pass.set_pipeline(&brushes.cap);
            self.caps.draw(pass);
        }
        pass.set_pipeline(&brushes.ink);
        if look.show.wireframe && look.mode == Mode::Mesh {
            wired.for_each(|held| held.wires(&self.device).draw(pass));
        }
        let shown = self.inks.iter().filter(|(ink, _)| ink.is_shown(look));
        shown.for_each(|(_, lines)| lines.draw(pass));
    }

    /// The object whose second surface a look shows within the first, by triangles.
    pub fn around(&self, look: &Look) -> Option<&str> {
        let is_shown = look.mode == Mode::Mesh && self.has_veil(look);
        self.within.as_deref().filter(|_| is_shown)
    }

    /// Draws what is looked through: what of it is farther away first.
    pub fn draw_veil<'a>(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        brushes: &Brushes,
        veil: impl Iterator<Item = &'a Held> + Clone,
    ) {
        for side in &brushes.veil {
            pass.set_pipeline(side);
            draw(veil.clone(), |held| held.seen(1), pass, 0);
        }
    }
}
