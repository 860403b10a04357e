use std::sync::Arc;

use bspline::hierarchical::EditError;
use bspline::{AnyField, HierarchicalSpline};
use fitting::Control;
use formats::field::{FieldMeta, SourceKind};
use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tools::body::Body;
use tools::geometric::TOLERANCE;
use tools::hold::Held;
use tools::knots;
use tools::material::Material;
use tools::paint::Layers;
use tools::tool::ToolError;

use crate::CommandError;

/// Errors that a fit leaves at many places, over their root mean square.
const OFTEN: f64 = 2.0;

/// A solid of a document. Cheap to copy.
#[derive(Clone, Debug)]
pub struct Object {
    /// The field whose surface it has.
    pub field: Body,
    /// What came with the field: unit, iso value, report of the fit.
    pub meta: Arc<FieldMeta>,
    /// What is painted on it; layers on which nothing is painted are missing.
    pub layers: Layers,
    /// What a user may set without a change of the field.
    pub properties: Properties,
}

/// What a user may set of an object without a change of its field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Properties {
    /// Map from the object's own world to that of its parent: three columns, then the translation. Finite, invertible.
    pub placement: [[f64; 3]; 4],
    /// The object that it moves with.
    pub parent: Option<String>,
    /// Level of its field that shows what it is shaped to: tools ask for little more than that by themselves, however fine single
    /// places have become. That of the field when it became an object; the finest that it has if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<usize>,
    /// Constraints that force tools keep.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holds: Vec<Held>,
    /// What it is by itself.
    #[serde(default, skip_serializing_if = "is_usual")]
    pub material: Material,
    /// Density of its surface, in place of the one that came with its field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iso: Option<f64>,
}

fn is_usual(material: &Material) -> bool {
    *material == Material::default()
}

impl Default for Properties {
    /// Where the field is, with no parent.
    fn default() -> Self {
        Self::placed(DAffine3::IDENTITY)
    }
}

impl Properties {
    /// Placed by a map, with no parent.
    pub fn placed(map: DAffine3) -> Self {
        let mut placed = Self {
            placement: [[0.0; 3]; 4],
            parent: None,
            detail: None,
            holds: Vec::new(),
            material: Material::default(),
            iso: None,
        };
        placed.set_placement(map);
        placed
    }

    /// Sets the map from the object's own world to that of its parent.
    pub fn set_placement(&mut self, map: DAffine3) {
        let [x, y, z] = [0, 1, 2].map(|axis| map.matrix3.col(axis));
        self.placement = [x, y, z, map.translation].map(|c| c.to_array());
    }

    /// Map from the object's own world to that of its parent.
    pub fn parent_from_object(&self) -> DAffine3 {
        let [x, y, z, t] = self.placement.map(DVec3::from_array);
        DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), t)
    }
}

impl Object {
    /// An object where its field is. Documents hold single precision: coefficients of double precision are rounded to the
    /// nearest.
    ///
    /// # Errors
    /// [`EditError::NotFinite`] for a coefficient beyond single precision.
    pub fn new(field: &AnyField, meta: FieldMeta) -> Result<Self, EditError> {
        Ok(Self::of(Body::Levels(field.to_single()?), meta))
    }

    /// An object where its field is, whatever that is made of.
    pub fn of(field: Body, meta: FieldMeta) -> Self {
        let detail = Some(field.level_count() - 1);
        Self {
            field,
            meta: Arc::new(meta),
            layers: Layers::new(),
            properties: Properties {
                detail,
                ..Properties::default()
            },
        }
    }

    /// The object with another version of its field, perhaps in a box that has grown, and with what is painted on that.
    pub(crate) fn with_shape(mut self, field: Body, layers: Layers) -> Self {
        let growth = self.field.lattice().growth_to(&field.lattice());
        if let Some([before, _]) = growth.filter(|[before, _]| *before != [0; 3]) {
            // Leaves are counted from the corner of the box.
            let meta = Arc::make_mut(&mut self.meta);
            for leaf in &mut meta.leaves {
                leaf.cell = std::array::from_fn(|a| leaf.cell[a] + (before[a] << leaf.level));
            }
        }
        Self {
            field,
            layers,
            ..self
        }
    }

    /// The object in the larger box of a later version of it; as it is where that has no such box.
    pub fn in_box_of(&self, later: &Self) -> Self {
        let growth = self.field.lattice().growth_to(&later.field.lattice());
        let levels = growth.zip(self.field.levels());
        let grown = levels.and_then(|([before, behind], field)| field.grown(before, behind).ok());
        match grown {
            Some(field) if *field.lattice() != self.field.lattice() => {
                self.clone().with_shape(Body::Levels(field), self.layers.clone())
            }
            _ => self.clone(),
        }
    }

    /// Its field in levels, and a sentence where it was not; `name` is for the message.
    ///
    /// # Errors
    /// [`CommandError::NoSurface`], and what keeps it from being written so.
    pub fn in_levels(
        &self,
        name: &str,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<f32>, Option<String>), CommandError> {
        match &self.field {
            Body::Levels(field) => Ok((field.clone(), None)),
            Body::Knots(field) => {
                let iso = self.iso().ok_or_else(|| CommandError::NoSurface(name.into()))?;
                let (field, told) = knots::in_levels(field, iso, control).map_err(ToolError::from)?;
                Ok((field, Some(told)))
            }
        }
    }

    /// Density of its surface, if it has one.
    pub fn iso(&self) -> Option<f64> {
        self.properties.iso.or(self.meta.iso)
    }

    /// Level of the field that tools work at.
    pub fn detail(&self) -> usize {
        let finest = self.field.level_count() - 1;
        self.properties.detail.unwrap_or(finest)
    }

    /// What tools may leave of its densities anywhere, if they are those of a volume: what its fit left at many places.
    pub fn density(&self) -> Option<f64> {
        if self.meta.source != SourceKind::Volume {
            return None;
        }
        let report: serde_json::Value = serde_json::from_str(&self.meta.report).unwrap_or_default();
        let tolerance = report["tolerance"].as_f64();
        // A fit that interpolates names none: then what is asked for at the surface, in densities.
        let spacing = self.field.lattice().spacing(self.detail()).min_element();
        let least = TOLERANCE * spacing * self.field.slope();
        let left = tolerance.map(|tolerance| OFTEN * tolerance);
        Some(left.filter(|left| *left > 0.0).unwrap_or(least))
    }

    /// Names field, properties and layers; what came with the field does not enter.
    pub(crate) fn hash_into(&self, hash: &mut Sha256) {
        hash.update(self.field.sha256());
        for value in self.properties.placement.as_flattened() {
            hash.update(value.to_le_bytes());
        }
        let parent = self.properties.parent.as_deref().unwrap_or_default();
        hash.update((parent.len() as u64).to_le_bytes());
        hash.update(parent);
        hash.update((self.detail() as u64).to_le_bytes());
        if !is_usual(&self.properties.material) {
            let text = serde_json::to_vec(&self.properties.material).expect("names have a JSON form");
            hash.update(text);
        }
        if let Some(iso) = self.properties.iso {
            hash.update("surface");
            hash.update(iso.to_le_bytes());
        }
        for held in &self.properties.holds {
            let text = serde_json::to_vec(held).expect("names and numbers have a JSON form");
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text);
        }
        for (substance, layer) in self.layers.iter().filter(|(_, layer)| !layer.is_empty()) {
            hash.update(substance.name());
            hash.update(layer.tree().sha256());
        }
    }
}
