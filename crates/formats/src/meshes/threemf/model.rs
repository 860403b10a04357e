//! One model part of a 3MF package: XML into objects and build items.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::Fault;
use crate::error::{Place, excerpt, excerpt_of};
use crate::limits::{Budget, Counted};

/// A model part.
#[derive(Debug)]
pub(super) struct Model {
    pub mm_per_unit: f64,
    pub objects: BTreeMap<u32, Object>,
    pub build: Vec<Instance>,
}

#[derive(Debug)]
pub(super) struct Object {
    /// Of another kind than a part of the thing itself.
    pub is_support: bool,
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    pub components: Vec<Instance>,
    /// Whether it is being placed right now.
    pub is_open: bool,
}

/// An object, somewhere.
#[derive(Debug)]
pub(super) struct Instance {
    pub object: u32,
    /// Part that the object stands in, if it is another one.
    pub part: Option<String>,
    pub transform: DAffine3,
}

/// Required extensions that are read (production) or change no geometry (materials).
const KNOWN_EXTENSIONS: [&str; 2] = [
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
];

struct Parser<'a> {
    reader: Reader<&'a [u8]>,
    model: Model,
    /// Prefix of the elements of the core specification.
    prefix: String,
    object: Option<(u32, bool)>,
    is_in_mesh: bool,
    vertices: Counted<DVec3>,
    triangles: Counted<[u32; 3]>,
    components: Vec<Instance>,
}

/// Reads the text of a model part.
pub(super) fn parse(text: &[u8], budget: &mut Budget) -> Result<Model, Fault> {
    let mut parser = Parser {
        reader: Reader::from_reader(text),
        model: Model {
            mm_per_unit: 1.0,
            objects: BTreeMap::new(),
            build: Vec::new(),
        },
        prefix: String::new(),
        object: None,
        is_in_mesh: false,
        vertices: Counted::new("vertices"),
        triangles: Counted::new("triangles"),
        components: Vec::new(),
    };
    let mut is_model = false;
    loop {
        let event = match parser.reader.read_event() {
            Ok(event) => event,
            Err(e) => {
                return Err(Fault::Damaged {
                    what: format!(
                        "the XML does not hold at byte {}: {e}",
                        parser.reader.error_position()
                    ),
                });
            }
        };
        match event {
            Event::Start(e) | Event::Empty(e) if !is_model => {
                is_model = true;
                parser.root(&e)?;
            }
            Event::Start(e) => parser.open(&e, budget)?,
            Event::Empty(e) => {
                parser.open(&e, budget)?;
                parser.close(e.name().as_ref(), budget)?;
            }
            Event::End(e) => parser.close(e.name().as_ref(), budget)?,
            Event::DocType(_) => {
                return Err(parser.bad("a document type", "3MF allows none; export the file again"));
            }
            Event::Eof => return Ok(parser.model),
            _ => {}
        }
    }
}

impl Parser<'_> {
    fn bad(&self, what: impl Into<String>, remedy: &'static str) -> Fault {
        Fault::Syntax {
            place: Place::Byte(self.reader.buffer_position()),
            what: what.into(),
            remedy,
        }
    }

    fn root(&mut self, e: &BytesStart) -> Result<(), Fault> {
        let name = e.name();
        if name.local_name().as_ref() != "model" {
            let what = format!("the first element is {}", excerpt(name.as_ref().as_bytes()));
            return Err(self.bad(what, "a model part starts with \"model\""));
        }
        self.prefix = name.prefix().map(|p| p.as_ref().to_owned()).unwrap_or_default();
        let mut required = String::new();
        for a in e.attributes().with_checks(false).flatten() {
            match a.key.as_ref() {
                "unit" => {
                    self.model.mm_per_unit = match a.value.as_ref() {
                        "micron" => 1e-3,
                        "millimeter" => 1.0,
                        "centimeter" => 10.0,
                        "inch" => 25.4,
                        "foot" => 304.8,
                        "meter" => 1000.0,
                        other => {
                            let what = format!("unit {}", excerpt(other.as_bytes()));
                            return Err(self.bad(
                                what,
                                "known are micron, millimeter, centimeter, inch, foot and meter",
                            ));
                        }
                    };
                }
                "requiredextensions" => required = a.value.clone().into_owned(),
                _ => {}
            }
        }
        for prefix in required.split_ascii_whitespace() {
            let declared = ["xmlns:", prefix].concat();
            let space = e
                .attributes()
                .with_checks(false)
                .flatten()
                .find(|a| a.key.as_ref() == declared);
            let space = space.map(|a| a.value.into_owned());
            if !space.as_deref().is_some_and(|s| KNOWN_EXTENSIONS.contains(&s)) {
                return Err(Fault::Value {
                    what: "a required extension",
                    value: excerpt_of(space.as_deref().unwrap_or("undeclared").as_bytes(), 200),
                    remedy: "it is not read; export a plain mesh",
                });
            }
        }
        Ok(())
    }

    /// The local name, if the element is one of the core specification.
    fn core<'n>(&self, name: &'n str) -> Option<&'n str> {
        match name.split_once(':') {
            None => self.prefix.is_empty().then_some(name),
            Some((prefix, local)) => (prefix == self.prefix).then_some(local),
        }
    }

    fn open(&mut self, e: &BytesStart, budget: &mut Budget) -> Result<(), Fault> {
        let name = e.name();
        match self.core(name.as_ref()) {
            Some("object") => {
                let id = self.whole(e, "id")?;
                let kind = attribute(e, "type");
                self.object = Some((
                    id,
                    kind.is_some_and(|k| matches!(&*k, "support" | "solidsupport")),
                ));
            }
            Some("mesh") if self.object.is_some() => self.is_in_mesh = true,
            Some("vertex") if self.is_in_mesh => {
                let mut at = [0.0; 3];
                for (slot, key) in at.iter_mut().zip(["x", "y", "z"]) {
                    let text = attribute(e, key).ok_or_else(|| self.lacks(e, key))?;
                    *slot = fast_float2::parse(text.trim()).map_err(|_| {
                        self.bad(
                            format!("{} is not a number", excerpt(text.as_bytes())),
                            "numbers are written like 1.5",
                        )
                    })?;
                }
                self.vertices.push(at.into(), budget)?;
            }
            Some("triangle") if self.is_in_mesh => {
                let corners = [self.whole(e, "v1")?, self.whole(e, "v2")?, self.whole(e, "v3")?];
                self.triangles.push(corners, budget)?;
            }
            Some("component") if self.object.is_some() => {
                let instance = self.instance(e, budget)?;
                self.components.push(instance);
            }
            Some("item") if self.object.is_none() => {
                let instance = self.instance(e, budget)?;
                self.model.build.push(instance);
            }
            _ => {}
        }
        Ok(())
    }

    fn close(&mut self, name: &str, budget: &mut Budget) -> Result<(), Fault> {
        match self.core(name) {
            Some("mesh") => self.is_in_mesh = false,
            Some("object") => {
                let Some((id, is_support)) = self.object.take() else {
                    return Ok(());
                };
                self.is_in_mesh = false;
                let vertices = std::mem::replace(&mut self.vertices, Counted::new("vertices")).items;
                let triangles = std::mem::replace(&mut self.triangles, Counted::new("triangles")).items;
                let count = vertices.len();
                if let Some(v) = triangles.iter().flatten().find(|v| **v as usize >= count) {
                    let what = format!("object {id} names vertex {v} of {count}");
                    return Err(self.bad(what, "the mesh contradicts itself; export it again"));
                }
                budget.reserve("objects", 4, size_of::<Object>())?;
                let object = Object {
                    is_support,
                    vertices,
                    triangles,
                    components: std::mem::take(&mut self.components),
                    is_open: false,
                };
                if self.model.objects.insert(id, object).is_some() {
                    return Err(self.bad(
                        format!("object {id} again"),
                        "an object is defined once; export it again",
                    ));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn instance(&self, e: &BytesStart, budget: &mut Budget) -> Result<Instance, Fault> {
        budget.reserve("components", 3, size_of::<Instance>())?;
        let mut transform = DAffine3::IDENTITY;
        if let Some(text) = attribute(e, "transform") {
            let mut m = [0.0; 12];
            let mut words = text.split_ascii_whitespace();
            for slot in &mut m {
                let number = words.next().and_then(|w| fast_float2::parse(w).ok());
                *slot = number.ok_or_else(|| {
                    self.bad(
                        format!("the transform {}", excerpt(text.as_bytes())),
                        "a transform is twelve numbers",
                    )
                })?;
            }
            // Rows of the file are what x, y, z and the origin become.
            transform = DAffine3::from_cols_array(&m);
        }
        let part = e
            .attributes()
            .with_checks(false)
            .flatten()
            .find(|a| a.key.local_name().as_ref() == "path")
            .map(|a| a.value.into_owned());
        budget.reserve("components", part.as_ref().map_or(0, |p| p.len() as u64), 1)?;
        Ok(Instance {
            object: self.whole(e, "objectid")?,
            part,
            transform,
        })
    }

    fn lacks(&self, e: &BytesStart, key: &str) -> Fault {
        let what = format!(
            "{} lacks {}",
            excerpt(e.name().as_ref().as_bytes()),
            excerpt(key.as_bytes())
        );
        self.bad(what, "the model contradicts its standard; export it again")
    }

    fn whole(&self, e: &BytesStart, key: &str) -> Result<u32, Fault> {
        let text = attribute(e, key).ok_or_else(|| self.lacks(e, key))?;
        crate::text::integer(text.trim().as_bytes())
            .and_then(|n| u32::try_from(n).ok())
            .ok_or_else(|| {
                self.bad(
                    format!("{} is not a whole number", excerpt(text.as_bytes())),
                    "indices count from 0",
                )
            })
    }
}

pub(super) fn attribute<'e>(e: &'e BytesStart, key: &str) -> Option<std::borrow::Cow<'e, str>> {
    e.attributes()
        .with_checks(false)
        .flatten()
        .find(|a| a.key.as_ref() == key)
        .map(|a| a.value)
}
