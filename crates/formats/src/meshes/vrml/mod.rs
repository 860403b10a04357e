//! VRML97 in and out: the faces of a world, with the transforms above them [ISO/IEC 14772-1:1997].
//!
//! Taken are `IndexedFaceSet`, `Box`, `Sphere`, `Cone` and `Cylinder`; `DEF` and `USE`, `PROTO`, `Inline` of files
//! beside this one, `Transform`, `Switch` (what it shows), `LOD` (its first level), `ccw`, and polygons of any number
//! of corners. Other geometry is left out, with a note. The standard says metres, but its writers do not keep to it:
//! the unit is unknown.

mod nodes;
mod primitives;
mod proto;
mod tokens;
mod write;

use std::path::Path;

use glam::DAffine3;

use self::nodes::{Node, Scene};
pub(super) use self::write::write;
use crate::Fault;
use crate::error::Place;
use crate::limits::{Budget, Counted};
use crate::raw::{Faces, RawShape};

/// Nodes put somewhere: what is used can use others again and again.
const MAX_INSTANCES: usize = 1_000_000;

pub(crate) fn looks_like_vrml(head: &[u8]) -> bool {
    head.starts_with(b"#VRML V")
}

/// `path` is where inlined files are looked for.
pub(super) fn parse(bytes: &[u8], path: Option<&Path>, budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let scene = nodes::parse(bytes, path, budget)?;
    let mut out = Out {
        positions: Counted::new("vertices"),
        faces: Faces::new(),
        corners: Vec::new(),
        instances: 0,
        round_count: 0,
    };
    out.place_all(&scene, budget)?;
    let mut raw = RawShape {
        positions: out.positions.items,
        ..Default::default()
    };
    let unread: Vec<_> = scene.unread.iter().copied().collect();
    if out.faces.count == 0 && !unread.is_empty() {
        return Err(Fault::Value {
            what: "the geometry of the world",
            value: unread.join(", "),
            remedy: "read are IndexedFaceSet, Box, Sphere, Cone and Cylinder; export it as one of these, in one file",
        });
    }
    if !unread.is_empty() {
        raw.notes
            .push(format!("not read and left out: {}", unread.join(", ")));
    }
    if out.round_count > 0 {
        raw.notes.push(format!(
            "spheres, cones and cylinders became polygons of 64 sides, within 0.25 % of their radius: {}",
            out.round_count
        ));
    }
    out.faces.finish(&mut raw);
    Ok(raw)
}

struct Out {
    positions: Counted<glam::DVec3>,
    faces: Faces,
    corners: Vec<u32>,
    instances: usize,
    /// Spheres, cones and cylinders that were placed.
    round_count: usize,
}

impl Out {
    /// Walks over what the roots hold. Nodes that use each other can be as deep as the file is long, so the way back is
    /// a list and not the stack; none can hold itself.
    fn place_all(&mut self, scene: &Scene, budget: &mut Budget) -> Result<(), Fault> {
        struct Open<'s> {
            children: &'s [usize],
            world_from_parent: DAffine3,
        }
        let mut open: Vec<Open> = vec![Open {
            children: &scene.roots,
            world_from_parent: DAffine3::IDENTITY,
        }];
        let mut deepest = 0;
        while let Some(Open {
            children,
            world_from_parent,
        }) = open.last_mut()
        {
            let Some((child, others)) = children.split_first() else {
                open.pop();
                continue;
            };
            *children = others;
            let world_from_parent = *world_from_parent;
            self.instances += 1;
            if self.instances > MAX_INSTANCES {
                return Err(Fault::Value {
                    what: "the number of nodes",
                    value: format!("above {MAX_INSTANCES}, those used again counted again"),
                    remedy: "export a plain mesh",
                });
            }
            match &scene.nodes[*child] {
                Node::Group {
                    parent_from_node,
                    children,
                    choice,
                } => {
                    let chosen = match choice {
                        None => &children[..],
                        Some(i) => children.get(*i).map_or(&[][..], std::slice::from_ref),
                    };
                    open.push(Open {
                        children: chosen,
                        world_from_parent: world_from_parent * *parent_from_node,
                    });
                    if open.len() > deepest {
                        deepest = open.len();
                        budget.reserve("the open nodes", 2, size_of::<Open>())?;
                    }
                }
                Node::Points { .. } => {}
                Node::Faces { .. } => self.faces(scene, *child, world_from_parent, budget)?,
            }
        }
        Ok(())
    }

    /// Puts an `IndexedFaceSet` where it belongs.
    fn faces(
        &mut self,
        scene: &Scene,
        node: usize,
        world_from_parent: DAffine3,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        let Node::Faces {
            coord,
            first,
            count,
            ccw,
            is_round,
        } = &scene.nodes[node]
        else {
            return Ok(());
        };
        self.round_count += usize::from(*is_round);
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

#[cfg(test)]
mod tests;
