//! glTF 2.0 in and out: the triangles of a scene, with the transforms of their nodes [Khronos, glTF 2.0 specification].
//!
//! Read are `.glb`, and `.gltf` with buffers embedded or beside it; triangles, strips and fans; indices of all
//! three sizes; positions of any type, normalized ones too; colours of the vertices. Lengths are metres by the
//! standard. Sparse accessors and compressed buffers are refused by name; skins and morph targets stay at rest.

mod accessor;
mod container;
mod json;
mod write;

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use glam::{DAffine3, DMat4, DQuat, DVec3};

use self::accessor::View;
use self::json::{Node, Primitive, Root};
pub(super) use self::write::{buffer_bytes, write_binary, write_text};
use super::weld::Welder;
use crate::error::Place;
use crate::limits::{Budget, Counted};
use crate::raw::{Faces, RawShape};
use crate::{Fault, Unit};

const MM_PER_METRE: f64 = 1000.0;

pub(crate) fn looks_like_gltf(head: &[u8]) -> bool {
    let text = head
        .strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(head)
        .trim_ascii_start();
    head.starts_with(b"glTF") || text.starts_with(b"{") && memchr::memmem::find(text, b"\"asset\"").is_some()
}

/// `path` is where buffers beside the document are looked for.
pub(super) fn parse(bytes: &[u8], path: Option<&Path>, budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let (document, binary) = container::split(bytes)?;
    let root = json::parse(document, budget)?;
    let buffers = container::buffers(&root, binary, path, budget)?;
    let mut builder = Builder {
        root: &root,
        buffers: &buffers,
        welder: Welder::new(),
        colors: Counted::new("colours"),
        faces: Faces::new(),
        numbers: BTreeMap::new(),
        vertex_count: 0,
        uncolored: 0,
        skipped: 0,
        at_rest: 0,
    };
    builder.scene(budget)?;
    let mut raw = RawShape {
        unit: Unit::Millimetre,
        colors: (builder.uncolored == 0).then_some(builder.colors.items),
        positions: builder.welder.positions.items,
        ..Default::default()
    };
    let joined = builder.vertex_count - raw.positions.len();
    for (count, what) in [
        (joined, "vertices stand at the place of another one; joined"),
        (builder.skipped, "primitives are points or lines; left out"),
        (
            builder.at_rest,
            "meshes have a skin or morph targets; read as they are stored",
        ),
    ] {
        if count > 0 {
            raw.notes.push(format!("{count} {what}"));
        }
    }
    builder.faces.finish(&mut raw);
    Ok(raw)
}

struct Builder<'a> {
    root: &'a Root,
    buffers: &'a [Vec<u8>],
    welder: Welder,
    colors: Counted<[u8; 3]>,
    faces: Faces,
    /// Vertices of the accessors of this node: primitives often share one and differ by their indices.
    numbers: BTreeMap<u32, Rc<[u32]>>,
    /// Vertices before joining.
    vertex_count: usize,
    /// Primitives without colours.
    uncolored: usize,
    skipped: usize,
    at_rest: usize,
}

impl Builder<'_> {
    /// Walks the default scene, or all nodes of a file without scenes.
    fn scene(&mut self, budget: &mut Budget) -> Result<(), Fault> {
        let root = self.root;
        let node_count = root.nodes.len();
        let roots: Vec<u32> = match root.scenes.get(root.scene.unwrap_or(0) as usize) {
            Some(scene) => scene.nodes.clone(),
            None if !root.scenes.is_empty() => {
                return Err(Fault::Value {
                    what: "the default scene",
                    value: format!("{} of {}", root.scene.unwrap_or(0), root.scenes.len()),
                    remedy: "the document contradicts itself; export the file again",
                });
            }
            None => {
                let mut is_child = vec![false; node_count];
                for child in root.nodes.iter().flat_map(|n| &n.children) {
                    if let Some(slot) = is_child.get_mut(*child as usize) {
                        *slot = true;
                    }
                }
                (0..node_count as u32)
                    .filter(|n| !is_child[*n as usize])
                    .collect()
            }
        };
        let mut is_visited = vec![false; node_count];
        let mut stack: Vec<(u32, DAffine3)> =
            roots.into_iter().rev().map(|n| (n, DAffine3::IDENTITY)).collect();
        while let Some((index, world_from_parent)) = stack.pop() {
            let bad = |what: String| Fault::Syntax {
                place: Place::Row("node", u64::from(index)),
                what,
                remedy: "the nodes of a scene form trees; export the file again",
            };
            let node = root
                .nodes
                .get(index as usize)
                .ok_or_else(|| bad(format!("the document has {node_count}")))?;
            if std::mem::replace(&mut is_visited[index as usize], true) {
                return Err(bad("it has two parents, or is its own".into()));
            }
            let world_from_node = world_from_parent * local(node);
            if let Some(mesh) = node.mesh {
                let mesh = root
                    .meshes
                    .get(mesh as usize)
                    .ok_or_else(|| bad(format!("mesh {mesh} of {}", root.meshes.len())))?;
                self.at_rest +=
                    usize::from(node.skin.is_some() || mesh.primitives.iter().any(|p| !p.targets.is_empty()));
                self.numbers.clear();
                for primitive in &mesh.primitives {
                    self.primitive(primitive, &world_from_node, budget)?;
                }
            }
            stack.extend(node.children.iter().rev().map(|n| (*n, world_from_node)));
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        p: &Primitive,
        world_from_node: &DAffine3,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        let mode = p.mode.unwrap_or(4);
        let (4..=6, Some(position)) = (mode, p.attributes.position) else {
            self.skipped += 1;
            return Ok(());
        };
        let wrong = |what: String| Fault::Syntax {
            place: Place::Row("accessor", u64::from(position)),
            what,
            remedy: "the document contradicts itself; export the file again",
        };
        let positions = View::new(self.root, self.buffers, position)?;
        if positions.width != 3 {
            return Err(wrong(format!("positions of {} components", positions.width)));
        }
        let colors = match p.attributes.color {
            Some(index) => Some(View::new(self.root, self.buffers, index)?),
            None => None,
        };
        if let Some(c) = colors
            .as_ref()
            .filter(|c| c.count != positions.count || c.width < 3)
        {
            return Err(wrong(format!(
                "{} colours for {} positions",
                c.count, positions.count
            )));
        }
        self.uncolored += usize::from(colors.is_none());
        let number = match self.numbers.get(&position) {
            Some(number) => Rc::clone(number),
            None => {
                let number: Rc<[u32]> = self
                    .vertices(&positions, colors.as_ref(), world_from_node, budget)?
                    .into();
                self.numbers.insert(position, Rc::clone(&number));
                number
            }
        };
        let indices = match p.indices {
            Some(index) => {
                let view = View::new(self.root, self.buffers, index)?;
                let out = (0..view.count)
                    .map(|i| view.at(i, 0))
                    .find(|v| *v >= positions.count as f64);
                if let Some(v) = out.filter(|_| view.is_whole()) {
                    return Err(wrong(format!("vertex {v} of {}", positions.count)));
                }
                if !view.is_whole() {
                    return Err(wrong(format!(
                        "its indices in accessor {index} are no whole numbers"
                    )));
                }
                Some(view)
            }
            None => None,
        };
        let count = indices.as_ref().map_or(positions.count, |v| v.count);
        let corner = |i: usize| number[indices.as_ref().map_or(i, |v| v.at(i, 0) as usize)];
        // A mirror turns the faces inside out; the standard asks to turn them back.
        let is_mirrored = world_from_node.matrix3.determinant() < 0.0;
        let triangle_count = if mode == 4 {
            count / 3
        } else {
            count.saturating_sub(2)
        };
        for t in 0..triangle_count {
            let [a, b, c] = match mode {
                4 => [3 * t, 3 * t + 1, 3 * t + 2],
                5 if t % 2 == 0 => [t, t + 1, t + 2],
                5 => [t + 1, t, t + 2],
                _ => [0, t + 1, t + 2],
            }
            .map(corner);
            // A repeated corner is how a strip turns, not a broken face.
            if mode == 5 && (a == b || b == c || c == a) {
                continue;
            }
            let face = if is_mirrored { [a, c, b] } else { [a, b, c] };
            self.faces.push(face.into_iter(), budget)?;
        }
        Ok(())
    }
}

impl Builder<'_> {
    /// Places the vertices of a primitive; the number of each.
    fn vertices(
        &mut self,
        positions: &View,
        colors: Option<&View>,
        world_from_node: &DAffine3,
        budget: &mut Budget,
    ) -> Result<Vec<u32>, Fault> {
        budget.reserve(
            "numbers of vertices",
            positions.count as u64,
            2 * size_of::<u32>(),
        )?;
        self.vertex_count += positions.count;
        let mut number = Vec::with_capacity(positions.count);
        for i in 0..positions.count {
            let at = DVec3::new(positions.at(i, 0), positions.at(i, 1), positions.at(i, 2));
            let world = world_from_node.transform_point3(at) * MM_PER_METRE;
            let vertex = self.welder.vertex(world, budget)?;
            if vertex as usize == self.colors.items.len() {
                let byte = |c| colors.map_or(0.0, |v| v.at(i, c) * 255.0).round() as u8;
                self.colors.push([byte(0), byte(1), byte(2)], budget)?;
            }
            number.push(vertex);
        }
        Ok(number)
    }
}

fn local(node: &Node) -> DAffine3 {
    if let Some(m) = &node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(m));
    }
    DAffine3::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, DVec3::from_array),
        node.rotation
            .map_or(DQuat::IDENTITY, |q| DQuat::from_array(q).normalize()),
        node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    )
}

#[cfg(test)]
mod tests;
