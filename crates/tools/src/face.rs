use bspline::HierarchicalSpline;
use glam::DVec3;

/// A face of a field's box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// Axis of the lattice that it lies across.
    pub axis: usize,
    /// Whether it is the one at the far end of the axis.
    pub is_last: bool,
}

impl Face {
    /// The face beyond which a place lies, by the most cells; none for a place in the box.
    pub fn beyond(field: &HierarchicalSpline<f32>, place: DVec3) -> Option<Self> {
        let at = field.lattice_from_world().transform_point3(place);
        let ends = [-at, at - field.lattice().extent()];
        let faces = (0..6).map(|n| (ends[n / 3][n % 3], n));
        let (off, n) = faces.fold((0.0, 0), |most, face| if face.0 > most.0 { face } else { most });
        (off > 0.0).then_some(Self {
            axis: n % 3,
            is_last: n / 3 == 1,
        })
    }
}
