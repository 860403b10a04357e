use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::blocks::{BlockGrid, BlockKey, Dirty, find_blocks};
use super::piece::piece;
use super::sampling::sample_blocks;
use super::stitch::stitch;
use super::surface::BlockSurface;
use super::{Mesh, MeshReport, PolygonizeError, PolygonizeOptions, validate};
use crate::{Aabb, Field, Frame};

/// A mesh kept in blocks of 8³ cells, so that it can follow a field that changes in places.
///
/// After any number of updates [`Self::mesh`] is the mesh that [`super::polygonize`] makes of the last field, to the
/// bit. Takes about 0.6 kB a block and 8 bytes a vertex (32 with normals) besides the mesh; a clone shares the blocks.
///
/// ```
/// use bspline::polygonize::{BlockMesh, PolygonizeOptions, polygonize};
/// use bspline::primitives::Sphere;
/// use bspline::{Aabb, Csg, Field, Frame};
/// use glam::DVec3;
/// use std::sync::Arc;
///
/// let ball: Arc<dyn Field> = Arc::new(Sphere::new(DVec3::ZERO, 1.0)?);
/// let frame = Frame::over(&Aabb::new(DVec3::splat(-1.5), DVec3::splat(1.5)), [60; 3]);
/// let options = PolygonizeOptions::default();
/// let (mut blocks, _) = BlockMesh::new(ball.as_ref(), &frame, &options)?;
///
/// // A dent: the field changes where the difference may differ from the ball.
/// let bite = Arc::new(Sphere::new(DVec3::X, 0.25)?);
/// let dented = Csg::difference(ball, vec![bite], 0.0)?;
/// let touched = Aabb::new(DVec3::new(0.4, -0.6, -0.6), DVec3::new(1.6, 0.6, 0.6));
/// let update = blocks.update(&dented, &[touched])?;
/// assert!(update.report.cells_sampled < 20_000);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct BlockMesh {
    frame: Frame,
    options: PolygonizeOptions,
    /// Blocks with surface.
    surfaces: BTreeMap<BlockKey, Arc<BlockSurface>>,
}

/// What an update did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockUpdate {
    /// Cost and finds among the blocks that were looked at again.
    pub report: MeshReport,
    /// Blocks whose part of the mesh is new or gone, in order; see [`BlockMesh::piece`].
    pub changed: Vec<[i32; 3]>,
}

impl BlockMesh {
    /// The surface `{ f = iso }` over the cells of `frame`.
    ///
    /// # Errors
    /// As [`super::polygonize`].
    pub fn new(
        field: &dyn Field,
        frame: &Frame,
        options: &PolygonizeOptions,
    ) -> Result<(Self, MeshReport), PolygonizeError> {
        Self::new_with(field, frame, options, &mut |_| ControlFlow::Continue(()))
    }

    /// [`Self::new`] with a caller who looks on, as in [`super::polygonize_with`].
    ///
    /// # Errors
    /// Any [`PolygonizeError`].
    pub fn new_with(
        field: &dyn Field,
        frame: &Frame,
        options: &PolygonizeOptions,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(Self, MeshReport), PolygonizeError> {
        validate(frame, options)?;
        let mut mesh = Self {
            frame: *frame,
            options: *options,
            surfaces: BTreeMap::new(),
        };
        let (surfaces, report) = mesh.sample(field, None, progress)?;
        mesh.surfaces = surfaces.into_iter().map(|s| (s.key, s)).collect();
        Ok((mesh, report))
    }

    /// Follows a change: `field` is what was meshed before, but for the inside of the boxes `changed` (world
    /// coordinates, ends included), which may overlap.
    ///
    /// The cost is that of the blocks that the boxes meet. For two versions of a hierarchical spline
    /// [`Field::changed_boxes`] gives the boxes.
    ///
    /// # Errors
    /// [`PolygonizeError::TooManyBlocks`]; the mesh is then as before.
    pub fn update(&mut self, field: &dyn Field, changed: &[Aabb]) -> Result<BlockUpdate, PolygonizeError> {
        self.update_with(field, changed, &mut |_| ControlFlow::Continue(()))
    }

    /// [`Self::update`] with a caller who looks on; broken off, the mesh is as before.
    ///
    /// # Errors
    /// As [`Self::update`], and [`PolygonizeError::Cancelled`].
    pub fn update_with(
        &mut self,
        field: &dyn Field,
        changed: &[Aabb],
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<BlockUpdate, PolygonizeError> {
        if changed.is_empty() {
            return Ok(BlockUpdate::default());
        }
        let dirty = Dirty::new(&self.grid(), changed);
        let (new, report) = self.sample(field, dirty.as_ref(), progress)?;
        let mut keys: Vec<BlockKey> = match &dirty {
            Some(dirty) => {
                let gone = dirty
                    .blocks()
                    .iter()
                    .filter(|key| self.surfaces.remove(*key).is_some());
                gone.copied().collect()
            }
            None => std::mem::take(&mut self.surfaces).into_keys().collect(),
        };
        keys.extend(new.iter().map(|s| s.key));
        keys.sort_unstable();
        keys.dedup();
        self.surfaces.extend(new.into_iter().map(|s| (s.key, s)));
        Ok(BlockUpdate {
            report,
            changed: keys,
        })
    }

    /// Surfaces of the dirty blocks, or of all.
    fn sample(
        &self,
        field: &dyn Field,
        dirty: Option<&Dirty>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(Vec<Arc<BlockSurface>>, MeshReport), PolygonizeError> {
        let (grid, options) = (self.grid(), &self.options);
        let search = &mut |done| progress(0.125 * done);
        let (blocks, bounds_queries) = find_blocks(field, &grid, options, dirty, search)?;
        if dirty.is_some() && self.surfaces.len() + blocks.len() > options.max_blocks {
            return Err(PolygonizeError::TooManyBlocks {
                limit: options.max_blocks,
            });
        }
        let mut report = MeshReport {
            bounds_queries,
            cells: self.frame.cells.iter().map(|&n| n as u64).product(),
            ..MeshReport::default()
        };
        let surfaces = sample_blocks(field, &grid, options, blocks, dirty, &mut report, |done| {
            progress(0.125 + 0.875 * done)
        })?;
        Ok((surfaces, report))
    }

    /// The whole mesh; its vertices and triangles are numbered in the order of the blocks. Asks the field nothing: time
    /// in proportion to the mesh, 40 ns a triangle.
    ///
    /// # Errors
    /// [`PolygonizeError::TooManyVertices`], [`PolygonizeError::InconsistentField`].
    pub fn mesh(&self) -> Result<Mesh, PolygonizeError> {
        self.mesh_with(&mut |_| ControlFlow::Continue(()))
    }

    /// [`Self::mesh`] with a caller who looks on.
    ///
    /// # Errors
    /// As [`Self::mesh`], and [`PolygonizeError::Cancelled`].
    pub fn mesh_with(
        &self,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Mesh, PolygonizeError> {
        let surfaces: Vec<_> = self.surfaces.values().cloned().collect();
        stitch(&self.grid(), &self.options, &surfaces, progress)
    }

    /// The triangles of one block as a mesh of its own, with copies of the vertices that it shares with its neighbours,
    /// to the bit: what is drawn of it. `None` if the block has no surface. Together the pieces are [`Self::mesh`].
    ///
    /// # Errors
    /// [`PolygonizeError::InconsistentField`].
    pub fn piece(&self, block: [i32; 3]) -> Result<Option<Mesh>, PolygonizeError> {
        piece(&self.grid(), &self.surfaces, block)
    }

    /// Blocks with surface, in order.
    pub fn blocks(&self) -> impl Iterator<Item = [i32; 3]> {
        self.surfaces.keys().copied()
    }

    /// What is meshed.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    fn grid(&self) -> BlockGrid<'_> {
        BlockGrid {
            frame: &self.frame,
            open: self.options.open,
        }
    }
}
