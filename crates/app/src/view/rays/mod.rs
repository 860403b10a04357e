//! Splines drawn without triangles: lines from the eye through bricks of coefficients on the graphics card.
//!
//! A line leaves out cubes and blocks whose coefficients all lie on one side of the surface. In the others it looks twice a cell, and
//! where it comes to the other side it finds the crossing by the Illinois rule \[Dowell71\]; a parabola through three looks finds lines
//! that graze. See `shaders/rays.wgsl`.

mod atlas;
mod cube;
mod eye;
mod passes;
mod plan;

use std::collections::BTreeMap;

use bspline::HierarchicalSpline;
use document::Object;
use eframe::egui_wgpu::wgpu;
use glam::{DAffine3, DVec3};

use super::{Look, Mode};
use atlas::Atlas;
pub use eye::Eye;
pub use passes::{Pass, Passes};
use plan::{Made, Plan};

/// Memory on the card for bricks, at most.
pub const BUDGET: u64 = 512 << 20;

/// A solid as it is drawn.
#[derive(Clone, Debug)]
pub struct Solid {
    /// In its own world.
    pub field: HierarchicalSpline<f32>,
    /// Its surface.
    pub iso: f64,
    /// Where it stands.
    pub world_from_object: DAffine3,
    /// Density of a surface that is looked through where it is drawn as a volume.
    pub second: Option<f64>,
}

impl Solid {
    /// What is drawn of an object without triangles; nothing where its field has no levels.
    pub fn of(object: &Object, iso: f64, world_from_object: DAffine3) -> Option<Self> {
        Some(Self {
            field: object.field.levels()?.clone(),
            iso,
            world_from_object,
            second: None,
        })
    }

    /// Whether another one is drawn alike.
    fn is_like(&self, other: &Self) -> bool {
        let (own, others) = (&self.field, &other.field);
        (self.iso, self.world_from_object) == (other.iso, other.world_from_object)
            && own.lattice() == others.lattice()
            && own.coefficient_count() == others.coefficient_count()
            && own.changed_bricks(others).is_empty()
    }
}

/// Solids on the card.
pub struct Rays {
    device: wgpu::Device,
    solids: BTreeMap<String, Solid>,
    /// Of which of them a second surface is looked through, and its density.
    second: Option<(String, f64)>,
    atlas: Atlas,
    /// What the card has, and for which look.
    plan: Option<(Plan, Look)>,
    made: Made,
}

impl Rays {
    /// Without solids; bricks take so many bytes at most, or as many as the card lets a picture read.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, budget: u64) -> Self {
        Self {
            device: device.clone(),
            solids: BTreeMap::new(),
            second: None,
            atlas: Atlas::new(device, queue, budget),
            plan: None,
            made: Made::new(),
        }
    }

    /// Forgets all solids.
    pub fn clear(&mut self) {
        self.solids.clear();
        self.made.clear();
        self.plan = None;
    }

    /// Forgets one.
    pub fn forget(&mut self, name: &str) {
        self.solids.remove(name);
        self.made.retain(|(of, ..), _| of != name);
        self.plan = None;
    }

    /// Puts a solid in place of the one that there was; whether it is another.
    pub fn put(&mut self, name: &str, mut solid: Solid) -> bool {
        solid.second = self.second_of(name);
        let is_other = self.solids.get(name).is_none_or(|old| !old.is_like(&solid));
        if is_other {
            self.forget(name);
            self.solids.insert(name.into(), solid);
        }
        is_other
    }

    /// Has volumes show a second surface of one solid, or none; whether that is another.
    pub fn show_second(&mut self, second: Option<(String, f64)>) -> bool {
        if self.second == second {
            return false;
        }
        self.second = second;
        let mut solids = std::mem::take(&mut self.solids);
        for (name, solid) in &mut solids {
            solid.second = self.second_of(name);
        }
        self.solids = solids;
        self.plan.take_if(|(_, look)| look.mode == Mode::Volume);
        true
    }

    fn second_of(&self, name: &str) -> Option<f64> {
        let second = self.second.as_ref().filter(|(of, _)| of == name);
        second.map(|(_, density)| *density)
    }

    /// Takes one away.
    pub fn take(&mut self, name: &str) -> Option<Solid> {
        let solid = self.solids.remove(name);
        self.forget(name);
        solid
    }

    /// All of them, by their names.
    pub fn solids(&self) -> impl Iterator<Item = (&String, &Solid)> {
        self.solids.iter()
    }

    /// Whether it draws an object.
    pub fn holds(&self, name: &str) -> bool {
        self.solids.contains_key(name)
    }

    /// How many it draws.
    pub fn count(&self) -> usize {
        self.solids.len()
    }

    /// Whether all that is drawn is as fine as it is.
    #[cfg(test)]
    pub fn is_whole(&self) -> bool {
        self.plan.as_ref().is_some_and(|(plan, _)| plan.is_whole)
    }

    /// Has the card hold what a look shows of solids whose places are told from `origin`, as much more of it as one picture may wait for.
    /// Those parts that have no room are chosen by the eye once it is at rest.
    pub fn prepare(&mut self, look: &Look, origin: DVec3, is_at_rest: bool) -> Prepared {
        let is_fit = self.plan.as_ref().is_some_and(|(plan, of)| {
            let of_density = look.mode != Mode::Volume || of.density[0] == look.density[0];
            let of_eye = plan.is_whole || !is_at_rest || of.camera == look.camera;
            !plan.is_begun && (of.mode, of.cut) == (look.mode, look.cut) && of_density && of_eye
        });
        if is_fit {
            return Prepared::AsBefore;
        }
        let stock = (&mut self.atlas, &mut self.made);
        let plan = Plan::new(&self.solids, look, origin, stock, &self.device);
        let is_done = !plan.is_begun;
        self.plan = Some((plan, *look));
        match is_done {
            true => Prepared::Other,
            false => Prepared::Begun,
        }
    }

    /// What passes know of it; none before it is [prepared](Self::prepare).
    pub fn bindings(&self, passes: &Passes) -> Option<wgpu::BindGroup> {
        let (plan, _) = self.plan.as_ref()?;
        Some(passes.solids(plan, self.atlas.buffer()))
    }
}

/// What the card holds now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prepared {
    /// What it held.
    AsBefore,
    /// All of what is wished.
    Other,
    /// More of it, and there is more to come.
    Begun,
}
