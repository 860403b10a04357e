//! VRML97 in: the `IndexedFaceSet`s of a world, with the transforms above them [ISO/IEC 14772-1:1997].
//!
//! Taken are `DEF` and `USE`, `Transform`, `Switch` (what it shows), `LOD` (its first level), `ccw`, and polygons of
//! any number of corners. Prototypes, inlined files and other geometry are left out, with a note. The standard says
//! metres, but its writers do not keep to it: the unit is unknown.

mod nodes;
mod tokens;

use glam::DAffine3;

use self::nodes::{Node, Scene};
use crate::Fault;
use crate::error::Place;
use crate::limits::{Budget, Counted};
use crate::raw::{Faces, RawShape};

/// Nodes put somewhere: what is used can use others again and again.
const MAX_INSTANCES: usize = 1_000_000;

pub(crate) fn looks_like_vrml(head: &[u8]) -> bool {
    head.starts_with(b"#VRML V")
}

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let first = bytes.split(|b| matches!(b, b'\n' | b'\r')).next().unwrap_or(b"");
    if !first.starts_with(b"#VRML V2.0") {
        return Err(Fault::line(
            1,
            format!("the file starts with {}", crate::error::excerpt(first)),
            "\"#VRML V2.0 utf8\" is read; export as VRML97 (2.0)",
        ));
    }
    let scene = nodes::parse(bytes, budget)?;
    let mut out = Out {
        positions: Counted::new("vertices"),
        faces: Faces::new(),
        corners: Vec::new(),
        instances: 0,
    };
    for root in &scene.roots {
        out.place(&scene, *root, DAffine3::IDENTITY, budget)?;
    }
    let mut raw = RawShape {
        positions: out.positions.items,
        ..Default::default()
    };
    if !scene.unread.is_empty() {
        let all: Vec<_> = scene.unread.iter().copied().collect();
        raw.notes
            .push(format!("not read and left out: {}", all.join(", ")));
    }
    out.faces.finish(&mut raw);
    Ok(raw)
}

struct Out {
    positions: Counted<glam::DVec3>,
    faces: Faces,
    corners: Vec<u32>,
    instances: usize,
}

impl Out {
    /// Nodes are at most as deep as they were written, since none can hold itself.
    fn place(
        &mut self,
        scene: &Scene,
        node: usize,
        world_from_parent: DAffine3,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        self.instances += 1;
        if self.instances > MAX_INSTANCES {
            return Err(Fault::Value {
                what: "the number of nodes",
                value: format!("above {MAX_INSTANCES}, those used again counted again"),
                remedy: "export a plain mesh",
            });
        }
        match &scene.nodes[node] {
            Node::Group {
                parent_from_node,
                children,
                choice,
            } => {
                let chosen = match choice {
                    None => &children[..],
                    Some(i) => children.get(*i).map_or(&[][..], std::slice::from_ref),
                };
                for child in chosen {
                    self.place(scene, *child, world_from_parent * *parent_from_node, budget)?;
                }
                Ok(())
            }
            Node::Points { .. } => Ok(()),
            Node::Faces {
                coord,
                first,
                count,
                ccw,
            } => {
                let indices = &scene.indices.items[*first..first + count];
                let points = match coord.map(|c| &scene.nodes[c]) {
                    Some(Node::Points { first, count }) => &scene.points.items[*first..first + count],
                    _ => &[],
                };
                // A mirror turns the faces inside out.
                let is_flipped = *ccw == (world_from_parent.matrix3.determinant() < 0.0);
                let start = self.positions.items.len();
                if start + points.len() > u32::MAX as usize {
                    return Err(Fault::Value {
                        what: "the number of vertices",
                        value: (start + points.len()).to_string(),
                        remedy: "fewer than 4294967296 can be read; split the world",
                    });
                }
                for p in points {
                    self.positions
                        .push(world_from_parent.transform_point3(*p), budget)?;
                }
                let faces = indices.strip_suffix(&[-1]).unwrap_or(indices);
                for face in faces.split(|i| *i == -1).filter(|f| !f.is_empty()) {
                    if let Some(i) = face.iter().find(|i| **i as usize >= points.len()) {
                        return Err(Fault::Syntax {
                            place: Place::Row("IndexedFaceSet", self.instances as u64),
                            what: format!("index {i} with {} points", points.len()),
                            remedy: "the file contradicts itself; export it again",
                        });
                    }
                    self.corners.clear();
                    self.corners.extend(face.iter().map(|i| start as u32 + *i as u32));
                    if is_flipped {
                        self.corners.reverse();
                    }
                    self.faces.push(self.corners.iter().copied(), budget)?;
                }
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests;
