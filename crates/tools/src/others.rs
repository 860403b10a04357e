//! Objects that a tool may name.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use bspline::{Aabb, Csg, CsgError, Field, HierarchicalSpline};
use glam::DAffine3;

use crate::body::Body;

/// Objects by name, each about as the distance from its surface, positive inside, in the world of the canvas.
#[derive(Clone, Default)]
pub struct Others(BTreeMap<String, Other>);

#[derive(Clone)]
struct Other {
    distance: Arc<dyn Field>,
    reach: Aabb,
    canvas_from_object: DAffine3,
    /// Density over distance, and that of the surface, if its densities count.
    densities: Option<(f64, f64)>,
    /// The field itself and its iso-value, where it lies as the canvas does and has levels.
    own: Option<(HierarchicalSpline<f32>, f64)>,
}

impl fmt::Debug for Others {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.0.keys()).finish()
    }
}

impl Others {
    /// Puts an object in; `canvas_from_object` maps its world to that of the canvas. `has_densities` tells whether its values are those of a
    /// scan, or only distances to its surface.
    ///
    /// # Errors
    /// [`CsgError`] for an iso-value that is not finite, or a map that flattens.
    pub fn put(
        &mut self,
        name: &str,
        body: &Body,
        iso: f64,
        canvas_from_object: DAffine3,
        has_densities: bool,
    ) -> Result<(), CsgError> {
        let steep = 1.0 / body.slope();
        let distance = Csg::sum(vec![(steep, body.shared())], -iso * steep)?;
        let is_beside = canvas_from_object == DAffine3::IDENTITY;
        let mut stretch = 1.0;
        let distance: Arc<dyn Field> = match is_beside {
            true => Arc::new(distance),
            false => {
                // A distance of the object, in lengths of the canvas.
                stretch = canvas_from_object.matrix3.determinant().abs().cbrt();
                let placed = Arc::new(Csg::affine(Arc::new(distance), canvas_from_object)?);
                Arc::new(Csg::sum(vec![(stretch, placed)], 0.0)?)
            }
        };
        let other = Other {
            distance,
            reach: body.world_box().transformed(&canvas_from_object),
            canvas_from_object,
            densities: has_densities.then(|| (body.slope() / stretch, iso)),
            own: body
                .levels()
                .filter(|_| is_beside)
                .map(|field| (field.clone(), iso)),
        };
        self.0.insert(name.into(), other);
        Ok(())
    }

    /// The field of an object and its iso-value, if it lies as the canvas does and has levels.
    pub(crate) fn own(&self, name: &str) -> Option<&(HierarchicalSpline<f32>, f64)> {
        self.0.get(name)?.own.as_ref()
    }

    /// The object of a name, and the box of its field.
    ///
    /// # Errors
    /// A sentence.
    pub fn get(&self, name: &str) -> Result<(Arc<dyn Field>, Aabb), String> {
        let other = self.known(name)?;
        Ok((other.distance.clone(), other.reach))
    }

    /// Densities of an object over the distances of [`Self::get`], and that of its surface, if they count.
    pub(crate) fn densities(&self, name: &str) -> Option<(f64, f64)> {
        self.0.get(name)?.densities
    }

    /// Map from the world of an object to that of the canvas.
    ///
    /// # Errors
    /// A sentence.
    pub(crate) fn map(&self, name: &str) -> Result<DAffine3, String> {
        Ok(self.known(name)?.canvas_from_object)
    }

    fn known(&self, name: &str) -> Result<&Other, String> {
        self.0.get(name).ok_or_else(|| {
            let known: Vec<_> = self.0.keys().map(String::as_str).collect();
            match known.is_empty() {
                true => format!("there is no object {name:?}, nor any other"),
                false => format!("there is no object {name:?}; there are {}", known.join(", ")),
            }
        })
    }
}
