//! 3MF in and out: the build items of a package, their components and transforms [3MF Consortium, Core Specification 1.3;
//! Production Extension 1.1, whose parts hold objects of their own].

mod model;
mod write;

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use glam::DAffine3;
use quick_xml::events::Event;
use zip::ZipArchive;

use self::model::{Instance, Model, Object};
pub(super) use self::write::write;
use crate::limits::{Budget, Counted};
use crate::raw::{Faces, RawShape};
use crate::{Fault, Unit};

/// Components inside of components.
const MAX_DEPTH: usize = 64;
/// Objects put somewhere: components of components can multiply without end.
const MAX_INSTANCES: usize = 1_000_000;
/// Bytes that the directory of a package keeps of each entry, at most, names aside.
const ENTRY: usize = 1024;

pub(crate) fn looks_like_3mf(head: &[u8]) -> bool {
    head.starts_with(b"PK\x03\x04") && memchr::memmem::find(head, b"3D/3dmodel.model").is_some()
}

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let mut package = Package::open(bytes, budget)?;
    let root = package.root_part(budget)?;
    package.load(&root, budget)?;
    let model = package.models.get_mut(&root).expect("just loaded");
    let items = std::mem::take(&mut model.build);
    let mut scene = Scene {
        mm_per_unit: model.mm_per_unit,
        package,
        positions: Counted::new("vertices"),
        faces: Faces::new(),
        instances: 0,
        supports: 0,
    };
    for item in &items {
        scene.place(&root, item, DAffine3::IDENTITY, 0, budget)?;
    }
    let mut raw = RawShape {
        positions: scene.positions.items,
        unit: Unit::Millimetre,
        ..Default::default()
    };
    if scene.supports > 0 {
        raw.notes
            .push(format!("{} supports were left out", scene.supports));
    }
    scene.faces.finish(&mut raw);
    Ok(raw)
}

fn damaged(what: impl Into<String>) -> Fault {
    Fault::Damaged { what: what.into() }
}

struct Package<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    models: BTreeMap<String, Model>,
}

impl<'a> Package<'a> {
    fn open(bytes: &'a [u8], budget: &mut Budget) -> Result<Self, Fault> {
        // Every entry of the directory starts with these four bytes.
        let entries = memchr::memmem::find_iter(bytes, b"PK\x01\x02").count();
        budget.reserve("the directory of the package", entries as u64, ENTRY)?;
        let archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|e| damaged(format!("the zip package does not hold ({e})")))?;
        Ok(Self {
            archive,
            models: BTreeMap::new(),
        })
    }

    fn content(&mut self, name: &str, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
        let name = name.trim_start_matches('/');
        let file = self
            .archive
            .by_name(name)
            .map_err(|e| damaged(format!("its part {:?} cannot be read ({e})", short(name))))?;
        let mut content = Vec::new();
        // The stored size is a claim; what comes out is counted.
        file.take(budget.left().saturating_add(1))
            .read_to_end(&mut content)
            .map_err(|e| damaged(format!("its part {:?} does not hold ({e})", short(name))))?;
        budget.reserve("the XML, inflated", content.len() as u64, 1)?;
        Ok(content)
    }

    /// Name of the part that the package starts with.
    fn root_part(&mut self, budget: &mut Budget) -> Result<String, Fault> {
        let text = self.content("_rels/.rels", budget)?;
        let mut reader = quick_xml::Reader::from_reader(&text[..]);
        loop {
            match reader.read_event() {
                Ok(Event::Start(e) | Event::Empty(e)) if e.name().local_name().as_ref() == "Relationship" => {
                    if let (Some(kind), Some(target)) =
                        (model::attribute(&e, "Type"), model::attribute(&e, "Target"))
                        && kind.ends_with("/3dmodel")
                    {
                        return Ok(target.into_owned());
                    }
                }
                Ok(Event::Eof) => return Err(damaged("the package names no 3D model")),
                Ok(_) => {}
                Err(e) => {
                    return Err(damaged(format!(
                        "the XML of its relationships does not hold: {e}"
                    )));
                }
            }
        }
    }

    fn load(&mut self, part: &str, budget: &mut Budget) -> Result<(), Fault> {
        if !self.models.contains_key(part) {
            let text = self.content(part, budget)?;
            self.models.insert(part.to_owned(), model::parse(&text, budget)?);
        }
        Ok(())
    }
}

fn short(name: &str) -> String {
    name.chars().take(60).collect()
}

struct Scene<'a> {
    /// Of the first part; all parts have the same unit.
    mm_per_unit: f64,
    package: Package<'a>,
    positions: Counted<glam::DVec3>,
    faces: Faces,
    instances: usize,
    supports: usize,
}

impl Scene<'_> {
    fn place(
        &mut self,
        part: &str,
        instance: &Instance,
        world_from_parent: DAffine3,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        self.instances += 1;
        if depth > MAX_DEPTH || self.instances > MAX_INSTANCES {
            return Err(Fault::Value {
                what: "the nesting of components",
                value: format!("{depth} deep at object number {}", self.instances),
                remedy: "at most 64 levels and 1000000 objects are read; export a plain mesh",
            });
        }
        let part = instance.part.as_deref().unwrap_or(part).to_owned();
        self.package.load(&part, budget)?;
        let model = &self.package.models[&part];
        let id = instance.object;
        let object = model.objects.get(&id);
        let object = object.ok_or_else(|| damaged(format!("it names object {id}, which is nowhere")))?;
        if object.is_open {
            return Err(damaged(format!("object {id} is a component of itself")));
        }
        let world_from_object = world_from_parent * instance.transform;
        if object.is_support {
            self.supports += 1;
            return Ok(());
        }
        let first = self.positions.items.len() as u64;
        if first + object.vertices.len() as u64 > u64::from(u32::MAX) {
            return Err(Fault::Value {
                what: "the number of vertices",
                value: (first + object.vertices.len() as u64).to_string(),
                remedy: "fewer than 4294967296 can be read; split the model",
            });
        }
        for v in &object.vertices {
            self.positions
                .push(world_from_object.transform_point3(*v) * self.mm_per_unit, budget)?;
        }
        let is_mirrored = world_from_object.matrix3.determinant() < 0.0;
        for t in &object.triangles {
            let [a, b, c] = t.map(|v| v + first as u32);
            let face = if is_mirrored { [a, c, b] } else { [a, b, c] };
            self.faces.push(face.into_iter(), budget)?;
        }
        self.components(&part, id, world_from_object, depth, budget)
    }

    fn components(
        &mut self,
        part: &str,
        id: u32,
        world_from_object: DAffine3,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        // Taken out while they are followed.
        let object = self.object(part, id);
        object.is_open = true;
        let components = std::mem::take(&mut object.components);
        for c in &components {
            self.place(part, c, world_from_object, depth + 1, budget)?;
        }
        let object = self.object(part, id);
        object.is_open = false;
        object.components = components;
        Ok(())
    }

    fn object(&mut self, part: &str, id: u32) -> &mut Object {
        let model = self.package.models.get_mut(part).expect("loaded before");
        model.objects.get_mut(&id).expect("found before")
    }
}

#[cfg(test)]
mod tests;
