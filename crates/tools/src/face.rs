use bspline::hierarchical::Lattice;
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Real};
use glam::DVec3;

/// Most points across a face at which it is looked at.
const ACROSS: u32 = 256;

/// A face of a field's box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// Axis of the lattice that it lies across.
    pub axis: usize,
    /// Whether it is the one at the far end of the axis.
    pub is_last: bool,
}

/// Points of a face.
pub struct FaceNodes {
    frame: Frame,
    count: [usize; 3],
}

impl FaceNodes {
    /// Values of a field at the points.
    pub fn values(&self, field: &dyn Field) -> Vec<f64> {
        let mut values = vec![0.0; self.count.iter().product()];
        field.frame_values(&self.frame, [0; 3], self.count, &mut values);
        values
    }

    /// Where a point is.
    pub fn place(&self, n: usize) -> DVec3 {
        let [_, y, z] = self.count;
        self.frame.node([n / z / y, n / z % y, n % z].map(|i| i as i64))
    }
}

impl Face {
    /// All six.
    pub const ALL: [Self; 6] = {
        let mut all = [Self {
            axis: 0,
            is_last: false,
        }; 6];
        let mut n = 0;
        while n < 6 {
            all[n] = Self {
                axis: n / 2,
                is_last: n % 2 == 1,
            };
            n += 1;
        }
        all
    };

    /// Points of the face in a box of lattice coordinates, about `step` cells of level 0 apart; none where the box does not reach it.
    pub fn nodes(self, lattice: &Lattice, within: &Aabb, step: f64) -> Option<FaceNodes> {
        let Self { axis, is_last } = self;
        let extent = lattice.extent();
        let (at, is_reached) = match is_last {
            false => (0.0, within.min[axis] <= 0.0),
            true => (extent[axis], within.max[axis] >= extent[axis]),
        };
        let mut part = Aabb {
            min: within.min.max(DVec3::ZERO),
            max: within.max.min(extent),
        };
        if !is_reached || part.min.cmpgt(part.max).any() {
            return None;
        }
        (part.min[axis], part.max[axis]) = (at, at);
        let steps = (part.size() / step).ceil();
        let cells = steps.to_array().map(|n| (n as u32).clamp(1, ACROSS));
        let mut frame = Frame::over(&part, cells);
        frame.world_from_grid = lattice.world_from_lattice * frame.world_from_grid;
        let count = std::array::from_fn(|a| if a == axis { 1 } else { cells[a] as usize + 1 });
        Some(FaceNodes { frame, count })
    }

    /// Whether the solid whose surface lies at `iso` reaches it.
    pub fn cuts<T: Real>(self, field: &HierarchicalSpline<T>, iso: f64) -> bool {
        let lattice = field.lattice();
        let step = 1.0 / (1u64 << (field.level_count() - 1)) as f64;
        let whole = Aabb::new(DVec3::ZERO, lattice.extent());
        let nodes = self.nodes(lattice, &whole, step);
        nodes.is_some_and(|nodes| nodes.values(field).iter().any(|value| *value > iso))
    }

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

/// Says where a tool has widened the solid at a face that had cut it off before; elsewhere it would have left its box, which is refused.
pub fn cut_off(
    before: &HierarchicalSpline<f32>,
    after: &HierarchicalSpline<f32>,
    iso: f64,
) -> Option<String> {
    let lattice = after.lattice();
    let changed = after.changed_boxes(before, &lattice.world_box());
    let changed = changed.into_iter().reduce(Aabb::hull)?;
    let within = changed.transformed(after.lattice_from_world());
    let level = after.level_count() - 1;
    let step = 1.0 / (1u64 << level) as f64;
    let rim = lattice.spacing(level).max_element() * after.slope();
    Face::ALL.into_iter().find_map(|face| {
        let nodes = face.nodes(lattice, &within, step)?;
        let [now, then] = [after, before].map(|field| nodes.values(field));
        let mut both = now.iter().zip(&then);
        let n = both.position(|(now, then)| *now > iso + rim && *then < iso - rim)?;
        Some(format!(
            "the solid goes on beyond the box of its field at {:?}, where it was cut off before; it is cut off there too",
            nodes.place(n).to_array()
        ))
    })
}
