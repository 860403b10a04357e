use thiserror::Error;

/// How a vertex is put on the edge of the grid that the surface crosses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Where the straight line through the values at the edge's ends crosses the iso-value.
    Linear,
    /// At the root of the field along the edge.
    RootFinding {
        /// Error allowed along the edge, in lengths of the edge, in `(0, 0.1]`.
        tolerance: f64,
    },
}

/// What to mesh and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolygonizeOptions {
    /// The surface is `{ f = iso }`, the solid `{ f > iso }`. Finite; in the field's own unit.
    pub iso: f64,
    /// Leaves the surface open where it meets the frame's box, instead of closing it with a cap.
    pub open: bool,
    /// How vertices are placed.
    pub placement: Placement,
    /// Whether the mesh gets normals (one evaluation more per vertex).
    pub normals: bool,
    /// Most blocks of 8³ cells that may hold surface before the work is refused; a block takes about
    /// 4 kB of mesh.
    pub max_blocks: usize,
}

impl Default for PolygonizeOptions {
    /// The closed surface `f = 0` by root finding to 1e-4 of an edge, no normals.
    fn default() -> Self {
        Self {
            iso: 0.0,
            open: false,
            placement: Placement::RootFinding { tolerance: 1e-4 },
            normals: false,
            max_blocks: 1 << 22,
        }
    }
}

/// What the mesher did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Boxes that were tested, by their corners and then by the bounds.
    pub bounds_queries: u64,
    /// Cells of the frame.
    pub cells: u64,
    /// Cells of the frame in blocks that the bounds could not exclude.
    pub cells_sampled: u64,
    /// Cells that the surface crosses, caps included.
    pub cells_crossed: u64,
    /// Blocks of 8³ cells that hold surface.
    pub blocks: u64,
    /// Values of the field at nodes.
    pub node_evaluations: u64,
    /// Values with gradient that root finding asked for.
    pub root_evaluations: u64,
    /// Vertices on the cap, next to the frame's box.
    pub cap_vertices: u64,
    /// Vertices where root finding stopped at its limit of evaluations: the field jumps there.
    pub unconverged_vertices: u64,
    /// Nodes next to the surface's blocks where the field is not a number; they count as outside.
    pub nan_nodes: u64,
    /// Blocks that the bounds excluded although the surface runs into them from a neighbour. They are meshed all
    /// the same. Not 0 only for a field whose bounds are unsound.
    pub unsound_blocks: u64,
}

impl MeshReport {
    /// Share of the cells without surface that the bounds excluded, `0..=1`; 1 if there is none.
    pub fn culled_share(&self) -> f64 {
        let empty = self.cells.saturating_sub(self.cells_crossed);
        if empty == 0 {
            1.0
        } else {
            (self.cells - self.cells_sampled).min(empty) as f64 / empty as f64
        }
    }
}

/// Why there is no mesh.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PolygonizeError {
    /// An axis has no cells, or more than the mesher can number.
    #[error("a frame needs 1 to {max} cells on each axis, not {cells:?}")]
    Cells {
        /// Cells asked for.
        cells: [u32; 3],
        /// Most cells on an axis.
        max: u32,
    },
    /// The frame's map is not finite or flattens space.
    #[error("the frame's map from grid to world is not invertible (determinant {determinant})")]
    Frame {
        /// Determinant of the linear part.
        determinant: f64,
    },
    /// The iso-value is not finite.
    #[error("the iso-value must be a finite number, not {iso}")]
    Iso {
        /// Iso-value asked for.
        iso: f64,
    },
    /// The tolerance of root finding is out of range.
    #[error("the tolerance of root finding must lie in (0, 0.1] edge lengths, not {tolerance}")]
    Tolerance {
        /// Tolerance asked for.
        tolerance: f64,
    },
    /// The chord error of an adaptive mesh is no length.
    #[error("the chord error must be a finite length above 0, not {error}")]
    Error {
        /// Error asked for.
        error: f64,
    },
    /// More blocks than allowed may hold surface.
    #[error("more than {limit} blocks of 8x8x8 cells may hold surface; use fewer cells")]
    TooManyBlocks {
        /// The limit.
        limit: usize,
    },
    /// More vertices than 32-bit indices can name.
    #[error("the mesh would have {vertices} vertices, more than 32-bit indices can name; use fewer cells")]
    TooManyVertices {
        /// Vertices found.
        vertices: u64,
    },
    /// The field gave one node two values.
    #[error("the field answers differently for the same node in block {block:?}")]
    InconsistentField {
        /// Block of 8³ cells where neighbours disagree.
        block: [i32; 3],
    },
    /// The caller asked to stop.
    #[error("meshing was cancelled")]
    Cancelled,
}
