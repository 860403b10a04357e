//! Tools as many points: what shape they have, and where on it they touch.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::super::Obstacle;
use super::carved::Carved;
use super::shape::{Outline, Shape};

/// Points of a tool at most: a tick looks at each of them.
const MOST: usize = 4096;
/// Parts of the longest edge of the box from which points are carved.
const LATTICE: i32 = 48;

/// How many points stand for a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Points that each tick looks at, at most; evenly spread. The second source's tools have some 80 \[Sensable99\].
    pub points: usize,
    /// Parts of the spacing of these at which finer points look for features between them; 1 for none.
    pub refinement: usize,
    /// Radius of the ball that each point is, mm. The balls' centres lie that deep under the surface: faces stay what they are, edges and
    /// corners are rounded by it. It makes the direction from a sharp edge of the solid well defined.
    pub nose: f64,
}

impl Default for Sampling {
    /// 80 points, four times finer between them, edges rounded by 0.05 mm.
    fn default() -> Self {
        Self {
            points: 80,
            refinement: 4,
            nose: 0.05,
        }
    }
}

impl Sampling {
    /// Some points, finer ones between them, and the spacing of these.
    fn of(&self, points: &[DVec3]) -> (Vec<DVec3>, Vec<DVec3>, f64) {
        let (coarse, _) = spread(points, self.points);
        let finer = self.points.saturating_mul(self.refinement * self.refinement);
        let (fine, spacing) = match self.refinement > 1 {
            true => spread(points, finer),
            false => (Vec::new(), 0.0),
        };
        (coarse, fine, spacing)
    }
}

/// Why there is no such tool.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ToolError {
    /// A length that is not finite, or too short.
    #[error("{what} is {value} mm; it must be finite and above {least} mm")]
    Length {
        /// Which.
        what: &'static str,
        /// How long.
        value: f64,
        /// What it must be above.
        least: f64,
    },
    /// No points, or too many for a tick.
    #[error("{count} points; a tool has 1 to {MOST}")]
    Count {
        /// How many.
        count: usize,
    },
    /// A point that is not finite.
    #[error("point {index} of the tool is not finite")]
    Point {
        /// Which.
        index: usize,
    },
    /// No surface where the tool was to be carved.
    #[error("there is no surface within {half} mm of {centre}; move the box onto one")]
    NoSurface {
        /// Middle of the box.
        centre: DVec3,
        /// Half its edges.
        half: DVec3,
    },
}

/// A tool that touches with many points and turns.
///
/// Its own axes: blades of plates, spatulas and knives lie in y and z. The handle point is the origin until it is
/// [moved](Self::with_handle).
#[derive(Clone, Debug, PartialEq)]
pub struct PointTool {
    /// Surface on which the points lie, `nose` deep under the tool's; missing for tools that are points alone.
    pub(super) shape: Option<Shape>,
    pub(super) nose: f64,
    pub(super) points: Vec<DVec3>,
    /// Points between these, sorted by the nearest one.
    pub(super) fine: Vec<DVec3>,
    /// Where those of a point begin in `fine`, with the end.
    pub(super) first: Vec<usize>,
    /// Way from each point to the farthest place of the surface that it stands for, mm.
    pub(super) cover: Vec<f64>,
    /// Way between finer points, mm.
    pub(super) spacing: f64,
    pub(super) handle: DVec3,
    /// Of the points.
    pub(super) middle: DVec3,
}

/// A length, checked.
fn above(what: &'static str, value: f64, least: f64) -> Result<f64, ToolError> {
    let is_good = value.is_finite() && value > least;
    is_good
        .then_some(value)
        .ok_or(ToolError::Length { what, value, least })
}

impl PointTool {
    /// A ball about the origin.
    ///
    /// # Errors
    /// [`ToolError`] if the radius is below the nose's, or no point is asked for.
    pub fn sphere(radius: f64, sampling: Sampling) -> Result<Self, ToolError> {
        let radius = above("the radius", radius, sampling.nose)? - sampling.nose;
        Self::shaped(Shape::Ball(radius), sampling)
    }

    /// A cylinder along z.
    ///
    /// # Errors
    /// As [`Self::sphere`].
    pub fn cylinder(radius: f64, length: f64, sampling: Sampling) -> Result<Self, ToolError> {
        let nose = sampling.nose;
        let radius = above("the radius", radius, nose)? - nose;
        let half = above("the length", length, 2.0 * nose)? / 2.0 - nose;
        Self::shaped(Shape::Drawn(Outline::new(&[DVec2::ZERO], radius), half), sampling)
    }

    /// A block with edges along the axes.
    ///
    /// # Errors
    /// As [`Self::sphere`].
    pub fn block(edges: DVec3, sampling: Sampling) -> Result<Self, ToolError> {
        let nose = sampling.nose;
        let half = |edge| Ok::<_, ToolError>(above("an edge", edge, 2.0 * nose)? / 2.0 - nose);
        let (x, y, z) = (half(edges.x)?, half(edges.y)?, half(edges.z)?);
        Self::shaped(
            Shape::Drawn(Outline::rectangle(DVec2::new(x, y), 0.0), z),
            sampling,
        )
    }

    /// A thin block, `thickness` along x.
    ///
    /// # Errors
    /// As [`Self::sphere`].
    pub fn plate(width: f64, length: f64, thickness: f64, sampling: Sampling) -> Result<Self, ToolError> {
        Self::block(DVec3::new(thickness, width, length), sampling)
    }

    /// A thin plate, `thickness` along x, with an outline whose ends are half circles: `width` along y, `length` along z.
    ///
    /// # Errors
    /// As [`Self::sphere`], or if it is wider than long.
    pub fn spatula(width: f64, length: f64, thickness: f64, sampling: Sampling) -> Result<Self, ToolError> {
        let nose = sampling.nose;
        let radius = above("the width", width, 2.0 * nose)? / 2.0;
        let reach = above("the length", length, width)? / 2.0 - radius;
        let half = above("the thickness", thickness, 2.0 * nose)? / 2.0 - nose;
        let ends = [DVec2::new(0.0, -reach), DVec2::new(0.0, reach)];
        Self::shaped(Shape::Flat(Outline::new(&ends, radius - nose), half), sampling)
    }

    /// A blade with its edge along z at −`height`/2 of y, and a back that is `back` wide; the edge is as round as the nose.
    ///
    /// # Errors
    /// As [`Self::sphere`].
    pub fn knife(height: f64, length: f64, back: f64, sampling: Sampling) -> Result<Self, ToolError> {
        let nose = sampling.nose;
        let height = above("the height", height, 2.0 * nose)? / 2.0 - nose;
        let half = above("the length", length, 2.0 * nose)? / 2.0 - nose;
        let back = above("the back", back, 2.0 * nose)? / 2.0 - nose;
        let corners = [
            DVec2::new(0.0, -height),
            DVec2::new(back, height),
            DVec2::new(-back, height),
        ];
        Self::shaped(Shape::Drawn(Outline::new(&corners, 0.0), half), sampling)
    }

    /// Any points, as balls of a radius, mm, that may be 0. Nothing is known between them.
    ///
    /// # Errors
    /// [`ToolError`] if there is none, or one is not finite.
    pub fn from_points(points: Vec<DVec3>, radius: f64) -> Result<Self, ToolError> {
        above("the radius of the points", radius, -1e-300)?;
        Self::new(None, radius, points, Vec::new(), 0.0)
    }

    /// Some of any points, the farthest from all others first, so that corners are among them; more of them between these.
    ///
    /// # Errors
    /// As [`Self::from_points`].
    pub fn scattered(points: &[DVec3], sampling: Sampling) -> Result<Self, ToolError> {
        above("the nose", sampling.nose, -1e-300)?;
        if let Some(index) = points.iter().position(|p| !p.is_finite()) {
            return Err(ToolError::Point { index });
        }
        let (coarse, fine, spacing) = sampling.of(points);
        Self::new(None, sampling.nose, coarse, fine, spacing)
    }

    /// The part of an object's surface in a box, with the object's distance there: its points become the tool, the middle of the box its origin. The solid side is the
    /// tool's inside. `sampling.points` of them, the farthest from all others first, so that corners are among them.
    ///
    /// # Errors
    /// [`ToolError::NoSurface`].
    pub fn carved(
        object: &dyn Obstacle,
        centre: DVec3,
        half: DVec3,
        sampling: Sampling,
    ) -> Result<Self, ToolError> {
        for edge in half.to_array() {
            above("half an edge of the box", edge, 0.0)?;
        }
        let step = 2.0 * half.max_element() / f64::from(LATTICE);
        let parts = (half / step).ceil().as_ivec3();
        let mut found = Vec::new();
        for i in -parts.x..=parts.x {
            for j in -parts.y..=parts.y {
                for k in -parts.z..=parts.z {
                    let mut p = centre + step * DVec3::new(f64::from(i), f64::from(j), f64::from(k));
                    let (mut d, mut g) = object.distance(p);
                    if d.abs() > 2.0 * step || !d.is_finite() {
                        continue;
                    }
                    // To where the points' balls are in the surface. Beyond a corner that takes a step for each of its sides.
                    for _ in 0..12 {
                        p -= (d + sampling.nose) * g / g.length_squared().max(0.1);
                        (d, g) = object.distance(p);
                    }
                    if (d + sampling.nose).abs() < 1e-6 * step && (p - centre).abs().cmple(half).all() {
                        found.push(p - centre);
                    }
                }
            }
        }
        let (coarse, fine, spacing) = sampling.of(&found);
        if coarse.is_empty() {
            return Err(ToolError::NoSurface { centre, half });
        }
        let carved = Carved::new(object, centre, half, sampling.nose, step);
        let shape = Shape::Carved(Arc::new(carved));
        Self::new(Some(shape), sampling.nose, coarse, fine, spacing)
    }

    /// Moves the handle point: where the hand holds the tool, and about which torques are told.
    #[must_use]
    pub fn with_handle(mut self, handle: DVec3) -> Self {
        self.handle = handle;
        self
    }

    /// The points, in the tool's own axes, mm.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Radius of the ball that each point is, mm.
    pub fn nose(&self) -> f64 {
        self.nose
    }

    /// From the handle point to the farthest place of the tool, mm.
    pub fn extent(&self) -> f64 {
        let far = |most: f64, p: &DVec3| most.max(p.distance(self.handle));
        // Of the finer points, since those of a ball alone leave some of it out.
        self.points.iter().chain(&self.fine).fold(0.0, far) + self.nose
    }

    /// From a place of the tool's surface to the nearest of its points, mm, at most.
    pub fn gap(&self) -> f64 {
        self.cover.iter().copied().fold(0.0, f64::max)
    }

    /// Signed distance to the tool's surface, mm, positive outside it; nothing for tools that are points alone.
    pub fn distance(&self, p: DVec3) -> Option<f64> {
        self.shape.as_ref().map(|shape| shape.distance(p).0 - self.nose)
    }

    fn shaped(shape: Shape, sampling: Sampling) -> Result<Self, ToolError> {
        above("the nose", sampling.nose, -1e-300)?;
        let size = shape
            .points(1e6)
            .iter()
            .fold(0.0f64, |most, p| most.max(p.length()));
        // The largest number of points that is allowed, or the fewest that show the shape.
        let (mut least, mut most) = (size * 1e-3, 4.0 * size);
        for _ in 0..30 {
            let middle = (least * most).sqrt();
            match shape.points(middle).len() <= sampling.points {
                true => most = middle,
                false => least = middle,
            }
        }
        let refinement = sampling.refinement.max(1) as f64;
        let spacing = most / refinement;
        let fine = if refinement > 1.0 {
            shape.points(spacing)
        } else {
            Vec::new()
        };
        let points = shape.points(most);
        Self::new(Some(shape), sampling.nose, points, fine, spacing)
    }

    fn new(
        shape: Option<Shape>,
        nose: f64,
        points: Vec<DVec3>,
        fine: Vec<DVec3>,
        spacing: f64,
    ) -> Result<Self, ToolError> {
        if points.is_empty() || points.len() > MOST {
            return Err(ToolError::Count { count: points.len() });
        }
        if let Some(index) = points.iter().position(|p| !p.is_finite()) {
            return Err(ToolError::Point { index });
        }
        let nearest = |p: &DVec3| {
            let all = points
                .iter()
                .enumerate()
                .map(|(i, q)| (q.distance_squared(*p), i));
            all.fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a })
        };
        let mut owned: Vec<_> = fine.iter().map(|p| (nearest(p), *p)).collect();
        owned.sort_by_key(|((_, owner), _)| *owner);
        let mut cover = vec![0.0f64; points.len()];
        let mut first = vec![0; points.len() + 1];
        for ((d, owner), _) in &owned {
            cover[*owner] = cover[*owner].max(d.sqrt());
            first[owner + 1] += 1;
        }
        for i in 0..points.len() {
            first[i + 1] += first[i];
        }
        Ok(Self {
            shape,
            nose,
            middle: points.iter().sum::<DVec3>() / points.len() as f64,
            points,
            fine: owned.into_iter().map(|(_, p)| p).collect(),
            first,
            cover,
            spacing,
            handle: DVec3::ZERO,
        })
    }
}

/// Some of the points, each the farthest from all before it, and how far the last was from them.
fn spread(points: &[DVec3], count: usize) -> (Vec<DVec3>, f64) {
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let mut far: Vec<f64> = points.iter().map(|p| p.distance_squared(middle)).collect();
    let (mut chosen, mut gap) = (Vec::new(), 0.0f64);
    while chosen.len() < count {
        let farthest =
            far.iter().enumerate().fold(
                (0.0, None),
                |most, (i, d)| if *d > most.0 { (*d, Some(i)) } else { most },
            );
        let (d, Some(next)) = farthest else { break };
        if chosen.is_empty() {
            far.fill(f64::INFINITY);
        }
        gap = d.sqrt();
        chosen.push(points[next]);
        for (far, p) in far.iter_mut().zip(points) {
            *far = far.min(p.distance_squared(points[next]));
        }
    }
    (chosen, gap)
}
