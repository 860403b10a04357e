//! How many triangles a scene may have.

use std::collections::BTreeMap;

use document::Object;

/// Most triangles, of a scene or of what an object has of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Of whole pictures.
    pub still: usize,
    /// While something moves.
    pub moving: usize,
}

impl Budget {
    /// Of a processor in the place of a graphics card: two cores shade so many in a tenth of a second, and draw the others 20 times a second.
    pub const PROCESSOR: Self = Self {
        still: 500_000,
        moving: 150_000,
    };

    /// Of a graphics card.
    pub const CARD: Self = Self {
        still: 2_000_000,
        ..Self::PROCESSOR
    };

    /// What each object may have of it: as many as all others, and what those leave that need less. An object needs about as many triangles as it
    /// has coefficients.
    pub fn shared(self, objects: &BTreeMap<String, Object>) -> BTreeMap<String, Self> {
        let needs = |(name, object): (&String, &Object)| (object.field.coefficient_count(), name.clone());
        let mut needs: Vec<_> = objects.iter().map(needs).collect();
        needs.sort_unstable();
        let (mut left, mut sharers) = (self, needs.len());
        let share = |(need, name)| {
            let share = left.map(|n| n / sharers);
            left.still -= share.still.min(need);
            left.moving -= share.moving.min(need);
            sharers -= 1;
            (name, share)
        };
        needs.into_iter().map(share).collect()
    }

    fn map(self, of: impl Fn(usize) -> usize) -> Self {
        Self {
            still: of(self.still),
            moving: of(self.moving),
        }
    }
}

#[cfg(test)]
mod tests {
    use bspline::HierarchicalSpline;
    use bspline::hierarchical::Lattice;
    use formats::field::FieldMeta;
    use glam::DAffine3;

    use super::*;

    /// A ball among so many cells along each axis, and its coefficients.
    fn ball(cells: u32) -> (Object, usize) {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [cells; 3],
        };
        let half = 0.5 * f64::from(cells);
        let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, |p| 0.8 * half - (p - half).length());
        let field = field.unwrap();
        let count = field.coefficient_count();
        (Object::of(field.into(), FieldMeta::default()), count)
    }

    #[test]
    fn small_objects_leave_the_triangles_that_they_do_not_need() {
        let (small, needed) = ball(8);
        let (large, many) = ball(40);
        let all = Budget {
            still: 20_000,
            moving: 2 * needed,
        };
        assert!(needed < 10_000 && many > 20_000, "{needed} {many}");
        let objects = [("a", &large), ("b", &small), ("c", &large)];
        let objects = objects.map(|(name, object)| (name.to_string(), object.clone()));
        let shares = all.shared(&objects.into());
        let still = ["a", "b", "c"].map(|name| shares[name].still);
        let rest = 20_000 - needed;
        assert_eq!(still, [rest / 2, 20_000 / 3, rest - rest / 2]);
        // There nobody leaves any.
        let moving = ["a", "b", "c"].map(|name| shares[name].moving);
        assert_eq!(moving.iter().sum::<usize>(), all.moving);
        assert!(
            moving.iter().all(|n| n.abs_diff(all.moving / 3) <= 1),
            "{moving:?}"
        );
        assert!(all.shared(&BTreeMap::new()).is_empty());
    }
}
