use std::fmt::Write;

/// What is wrong with a mesh, and what was done about it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshDefects {
    /// Triangles given.
    pub triangles: usize,
    /// Vertices merged because another lies at exactly the same place.
    pub merged_vertices: usize,
    /// Pieces that share no vertex.
    pub components: usize,
    /// Edges with a triangle on one side only, duplicates not counted: the rims of holes.
    pub boundary_edges: usize,
    /// Edges of three triangles or more.
    pub non_manifold_edges: usize,
    /// Edges across which no orientation of the sheet is consistent (as on a Möbius strip).
    pub non_orientable_edges: usize,
    /// Triangles turned over, because they stood against the most of their sheet.
    pub flipped_faces: usize,
    /// Whole sheets turned over, because their outside faced the solid.
    pub inside_out: usize,
    /// Triangles without area; left out.
    pub degenerate_faces: usize,
    /// Triangles with the corners of an earlier one; left out.
    pub duplicate_faces: usize,
    /// Triangles of open sheets that bound no solid; left out.
    pub unbounding_faces: usize,
    /// Triangles inside the solid that the others bound, wholly or in part; they are no surface of it.
    pub interior_faces: usize,
    /// Pairs of triangles that cross without sharing a vertex.
    pub self_intersections: usize,
    /// Whether crossings were counted on a share of the triangles only; [`MeshDefects::self_intersections`] is then
    /// a lower bound.
    pub intersections_sampled: bool,
}

impl MeshDefects {
    /// Whether the surface that is used has no rim: it parts inside from outside by itself.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Sentences for a report; none for a clean mesh.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let mut note = |count: usize, one: &str, many: &str| {
            if count > 0 {
                let mut text = String::new();
                write!(text, "{count} {}", if count == 1 { one } else { many }).expect("strings take all");
                notes.push(text);
            }
        };
        note(
            self.degenerate_faces,
            "triangle has no area and was left out",
            "triangles have no area and were left out",
        );
        note(
            self.duplicate_faces,
            "triangle repeats another and was left out",
            "triangles repeat others and were left out",
        );
        note(
            self.flipped_faces,
            "triangle faced the wrong way and was turned over",
            "triangles faced the wrong way and were turned over",
        );
        note(
            self.inside_out,
            "sheet was inside out and was turned over",
            "sheets were inside out and were turned over",
        );
        note(
            self.boundary_edges,
            "edge is the rim of a hole, closed where the winding number is 1/2",
            "edges are rims of holes, closed where the winding number is 1/2",
        );
        note(
            self.non_manifold_edges,
            "edge joins more than two triangles",
            "edges join more than two triangles",
        );
        note(
            self.non_orientable_edges,
            "edge lies on a sheet that has no two sides",
            "edges lie on sheets that have no two sides",
        );
        note(
            self.unbounding_faces,
            "triangle bounds no solid and was left out",
            "triangles bound no solid and were left out",
        );
        note(
            self.interior_faces,
            "triangle lies inside the solid, wholly or in part, and is no surface there",
            "triangles lie inside the solid, wholly or in part, and are no surface there",
        );
        let pairs = if self.intersections_sampled {
            "pairs of triangles cross among those looked at, which were a share of all"
        } else {
            "pairs of triangles cross"
        };
        note(self.self_intersections, "pair of triangles crosses", pairs);
        notes
    }
}
