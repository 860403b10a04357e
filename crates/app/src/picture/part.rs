use std::sync::Arc;

use bspline::polygonize::Mesh;
use bspline::primitives::HalfSpace;
use bspline::{Csg, Field, Frame};
use glam::{DAffine3, DVec3};

use super::View;

/// The part of space that a picture shows: a prism along the line of sight, from before the solid to behind it.
pub struct Part {
    corners: [DVec3; 8],
    /// A point on each of the four sides, and the direction outwards.
    sides: [(DVec3, DVec3); 4],
}

/// Cells round the picture that belong to it, and pixels, so that the ragged edge of the cut is never seen.
const RIM: f64 = 4.0;

impl Part {
    /// What `view` shows of `whole`, which is not empty, if it is meshed with cells of side `cell`.
    pub fn new(view: &View, whole: &Mesh, cell: f64) -> Self {
        let center = view.axes * view.center;
        let toward = view.axes.row(2);
        let depths = whole.positions.iter().map(|p| toward.dot(*p));
        let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), d| {
            (l.min(d), h.max(d))
        });
        // The whole is a coarse mesh: what sticks out of it is seen too.
        let slack = 0.1 * (far - near);
        let [x, y] = view
            .size
            .map(|n| (0.5 * n as f64 + RIM) / view.pixels_per_length + RIM * cell);
        let world_from_view = view.axes.transpose();
        let corners = std::array::from_fn(|i| {
            let side = |bit: usize, half: f64| if i >> bit & 1 == 1 { half } else { -half };
            let depth = if i & 1 == 1 { far + slack } else { near - slack };
            world_from_view * DVec3::new(center.x + side(2, x), center.y + side(1, y), depth)
        });
        let sides = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y].map(|n| {
            let outward = world_from_view * n;
            (view.center + outward * if n.x != 0.0 { x } else { y }, outward)
        });
        Self { corners, sides }
    }

    /// The cells of `frame` that may hold it; `None` if there are none.
    pub fn within(&self, frame: &Frame) -> Option<Frame> {
        let grid_from_world = frame.world_from_grid.inverse();
        let corners = self.corners.map(|p| grid_from_world.transform_point3(p));
        let end = DVec3::from_array(frame.cells.map(f64::from));
        let (low, high) = corners
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &p| {
                (l.min(p), h.max(p))
            });
        let (low, high) = (
            low.floor().clamp(DVec3::ZERO, end),
            high.ceil().clamp(DVec3::ZERO, end),
        );
        let cells = (high - low).to_array().map(|n| n as u32);
        cells.iter().all(|n| *n > 0).then(|| Frame {
            world_from_grid: frame.world_from_grid * DAffine3::from_translation(low),
            cells,
        })
    }

    /// The solid `{ field > iso }` cut at the sides.
    pub fn cut(&self, field: Arc<dyn Field>, iso: f64) -> anyhow::Result<Csg> {
        let mut solids = vec![field];
        for (point, outward) in self.sides {
            // The side of a plane is where its field is above 0; the solid is where all are above the iso-value.
            let side: Arc<dyn Field> = Arc::new(HalfSpace::new(point, outward)?);
            solids.push(Arc::new(Csg::sum(vec![(1.0, side)], iso)?));
        }
        Ok(Csg::intersection(solids)?)
    }
}

#[cfg(test)]
mod tests {
    use bspline::primitives::Sphere;
    use glam::DMat3;

    use super::*;

    #[test]
    fn the_part_holds_what_is_seen_and_little_else() {
        let view = View {
            size: [100, 50],
            axes: DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7).transpose(),
            center: DVec3::new(0.9, 0.1, 0.2),
            pixels_per_length: 400.0,
        };
        let whole = Mesh {
            positions: vec![DVec3::splat(-1.0), DVec3::splat(1.0)],
            ..Default::default()
        };
        let part = Part::new(&view, &whole, 0.0);
        let cut = part
            .cut(Arc::new(Sphere::new(DVec3::ZERO, 10.0).unwrap()), 3.0)
            .unwrap();
        let inside =
            |x: f64, y: f64| cut.value(view.center + view.axes.transpose() * DVec3::new(x, y, 0.3)) > 3.0;
        let [x, y] = [54.0 / 400.0, 29.0 / 400.0];
        for s in [-0.999, 0.999] {
            assert!(
                inside(s * x, s * y)
                    && !inside(1.01 * s * x / 0.999, 0.0)
                    && !inside(0.0, 1.01 * s * y / 0.999)
            );
        }
        let frame = Frame {
            world_from_grid: DAffine3::from_translation(DVec3::splat(-1.0))
                * DAffine3::from_scale(DVec3::splat(0.01)),
            cells: [200; 3],
        };
        let within = part.within(&frame).unwrap();
        let count: u32 = within.cells.iter().product();
        assert!(count < 8_000_000 / 3, "{:?}", within.cells);
        let away = View {
            center: DVec3::splat(50.0),
            ..view
        };
        assert!(Part::new(&away, &whole, 0.0).within(&frame).is_none());
    }
}
