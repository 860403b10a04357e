//! What tools work on.

use bspline::HierarchicalSpline;
use glam::DAffine3;

use crate::force::Holding;
use crate::hold::Held;
use crate::limits::Limits;
use crate::malleable::Malleable;
use crate::material::Material;
use crate::others::Others;
use crate::paint::{Layer, Layers, Paint, PaintError};

/// What a tool works on. Cheap to copy.
#[derive(Clone, Debug)]
pub struct Canvas<F = HierarchicalSpline<f32>> {
    /// The field.
    pub field: F,
    /// Density of its surface.
    pub iso: f64,
    /// Level of the field that the object is shaped to.
    pub detail: usize,
    /// What its densities off the surface may be off by after a stroke that carries matter along, if they count: of a scan
    /// what its fit left.
    pub density: Option<f64>,
    /// What is painted on it.
    pub layers: Layers,
    /// Its constraints.
    pub holds: Vec<Held>,
    /// Where its world lies.
    pub placement: Placement,
    /// What it is by itself.
    pub material: Material,
    /// Objects that a tool may name.
    pub others: Others,
    /// Names under which the object as it was before is to be kept.
    pub copies: Vec<String>,
}

impl Canvas {
    /// A field with nothing on it or beside it.
    pub fn alone(field: HierarchicalSpline<f32>, iso: f64, detail: usize) -> Self {
        Self {
            field,
            iso,
            detail,
            density: None,
            layers: Layers::new(),
            holds: Vec::new(),
            placement: Placement::default(),
            material: Material::default(),
            others: Others::default(),
            copies: Vec::new(),
        }
    }

    /// The canvas elsewhere: what it is made of on a lattice that lies so, its holds brought along by `map`.
    pub(crate) fn placed(&self, world_from_lattice: DAffine3, map: &DAffine3) -> Self {
        let layers = self.layers.iter();
        Self {
            field: self.field.placed(world_from_lattice),
            layers: layers
                .map(|(substance, layer)| (*substance, layer.placed(world_from_lattice)))
                .collect(),
            holds: self
                .holds
                .iter()
                .map(|held| held.carried(|p| map.transform_point3(p)))
                .collect(),
            ..self.clone()
        }
    }
}

impl<F> Canvas<F> {
    /// The canvas with another field.
    pub fn with_field<G>(self, field: G) -> Canvas<G> {
        let Self {
            iso,
            detail,
            density,
            layers,
            holds,
            placement,
            material,
            others,
            copies,
            ..
        } = self;
        Canvas {
            field,
            iso,
            detail,
            density,
            layers,
            holds,
            placement,
            material,
            others,
            copies,
        }
    }

    /// What force tools may not move.
    pub(crate) fn holding(&self, limits: &Limits) -> Holding {
        Holding {
            iso: self.iso,
            holds: self.holds.clone(),
            limits: limits.clone(),
        }
    }
}

impl<F: Malleable> Canvas<F> {
    /// The layer of a stroke of paint with it laid on, as far as limits allow.
    ///
    /// # Errors
    /// Any [`PaintError`].
    pub(crate) fn painted(&self, paint: &Paint, limits: &Limits) -> Result<Layer, PaintError> {
        let whole = limits.cut(&self.field.whole());
        let layer = paint.apply(&self.field, &self.layers, self.detail, &whole)?;
        let before = self.layers.get(&paint.layer).cloned();
        let before = before.unwrap_or_else(|| Layer::empty(&self.field.grids(), self.detail));
        let kept = limits.kept(before.tree(), layer.tree());
        Ok(layer.with_tree(kept).expect("some of the nodes painted"))
    }
}

/// Where the world of an object lies in that of its parent, or in the world that all objects without a parent share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Placement {
    /// Map from the object's own world to that of its parent. Finite, invertible.
    pub map: DAffine3,
    /// Map from the parent's world to the shared one; the identity without a parent.
    pub shared_from_parent: DAffine3,
    /// The object that it moves with.
    pub parent: Option<String>,
}
