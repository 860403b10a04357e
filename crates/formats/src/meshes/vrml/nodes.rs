//! The nodes of a VRML file that faces hang on; all others are groups of what is in them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::rc::Rc;

use glam::{DAffine3, DQuat, DVec3};

use super::primitives;
use super::proto::Proto;
use super::tokens::{Instance, Token, Tokens};
use crate::error::excerpt;
use crate::limits::{Budget, Counted};
use crate::{Fault, input, neighbour};

/// Nodes inside of nodes, prototypes and inlined files included.
const MAX_DEPTH: usize = 200;
/// Files inlined in files.
const MAX_INLINED: usize = 8;
/// Bytes of an entry in the tables of names, the name aside.
const NAME: usize = 96;

/// A node, by its number in [`Scene::nodes`].
#[derive(Debug)]
pub(super) enum Node {
    Group {
        parent_from_node: DAffine3,
        children: Vec<usize>,
        /// Whether one child is chosen, and which.
        choice: Option<usize>,
    },
    /// `Coordinate`: where its points lie in [`Scene::points`].
    Points { first: usize, count: usize },
    /// `IndexedFaceSet` or a primitive: where its indices lie in [`Scene::indices`].
    Faces {
        coord: Option<usize>,
        first: usize,
        count: usize,
        ccw: bool,
        /// Whether the faces stand for something round.
        is_round: bool,
    },
}

#[derive(Debug)]
pub(super) struct Scene {
    pub nodes: Vec<Node>,
    /// Nodes at the top.
    pub roots: Vec<usize>,
    pub points: Counted<DVec3>,
    pub indices: Counted<i32>,
    /// Kinds of geometry that are not read.
    pub unread: BTreeSet<&'static str>,
}

const OTHER_GEOMETRY: [&str; 5] = ["ElevationGrid", "Extrusion", "IndexedLineSet", "PointSet", "Text"];

/// Reads all nodes. `path` is where inlined files are looked for.
pub(super) fn parse(bytes: &[u8], path: Option<&Path>, budget: &mut Budget) -> Result<Scene, Fault> {
    let mut scene = Scene {
        nodes: Vec::new(),
        roots: Vec::new(),
        points: Counted::new("points"),
        indices: Counted::new("indices"),
        unread: BTreeSet::new(),
    };
    scene.roots = File::new(&mut scene, path, 0).nodes_of(bytes, 0, budget)?;
    Ok(scene)
}

/// One file of a world.
struct File<'a, 's> {
    scene: &'s mut Scene,
    path: Option<&'s Path>,
    /// Files that this one is inlined in.
    inlined: usize,
    protos: BTreeMap<&'a [u8], Rc<Proto<'a>>>,
    /// Nodes by name, a table for the file and one for each instance of a prototype.
    names: Vec<BTreeMap<&'a [u8], usize>>,
}

impl<'a, 's> File<'a, 's> {
    fn new(scene: &'s mut Scene, path: Option<&'s Path>, inlined: usize) -> Self {
        Self {
            scene,
            path,
            inlined,
            protos: BTreeMap::new(),
            names: vec![BTreeMap::new()],
        }
    }

    /// Reads a whole file; its nodes at the top.
    fn nodes_of(&mut self, bytes: &'a [u8], depth: usize, budget: &mut Budget) -> Result<Vec<usize>, Fault> {
        let first = bytes.split(|b| matches!(b, b'\n' | b'\r')).next().unwrap_or(b"");
        if !first.starts_with(b"#VRML V2.0") {
            return Err(Fault::line(
                1,
                format!("the file starts with {}", excerpt(first)),
                "\"#VRML V2.0 utf8\" is read; export as VRML97 (2.0)",
            ));
        }
        let mut tokens = Tokens::new(bytes);
        let mut roots = Vec::new();
        while let Some(token) = tokens.next() {
            let Token::Word(word) = token else {
                return Err(tokens.bad(
                    format!("{token} stands outside of any node"),
                    "a file is a list of nodes",
                ));
            };
            roots.extend(self.statement(word, &mut tokens, depth, budget)?);
        }
        tokens.check()?;
        Ok(roots)
    }

    /// Reads what starts with `word`: a node, whose number comes back, or something without one.
    fn statement(
        &mut self,
        word: &'a [u8],
        tokens: &mut Tokens<'a>,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<Option<usize>, Fault> {
        match word {
            b"DEF" => {
                let name = tokens.word("a name")?;
                let table = tokens.scope().map_or(0, |s| s.names);
                let kind = tokens.word("a node")?;
                let node = self.node(kind, tokens, depth, budget)?;
                budget.reserve("names", 1, NAME)?;
                self.names[table].insert(name, node);
                Ok(Some(node))
            }
            b"USE" => {
                let name = tokens.word("a name")?;
                budget.reserve("nodes", 2, size_of::<usize>())?;
                let table = tokens.scope().map_or(0, |s| s.names);
                match self.names[table].get(name) {
                    Some(node) => Ok(Some(*node)),
                    None => Err(tokens.bad(
                        format!("USE of {}", excerpt(name)),
                        "a name is defined before it is used, not inside of itself",
                    )),
                }
            }
            b"PROTO" => {
                let name = tokens.word("a name")?;
                let proto = Proto::read(tokens)?;
                budget.reserve("prototypes", 1, NAME + proto.bytes())?;
                self.protos.insert(name, Rc::new(proto));
                Ok(None)
            }
            b"EXTERNPROTO" => {
                self.scene.unread.insert("EXTERNPROTO");
                tokens.word("a name")?;
                for part in ["the fields", "the address"] {
                    match tokens.scan() {
                        Some(Token::Text(_)) => {}
                        Some(Token::OpenList) => tokens.skip(Token::OpenList)?,
                        _ => {
                            return Err(tokens.bad(
                                format!("an external prototype without {part}"),
                                "the file breaks its format",
                            ));
                        }
                    }
                }
                Ok(None)
            }
            b"ROUTE" => {
                for part in ["a field", "TO", "a field"] {
                    tokens.word(part)?;
                }
                Ok(None)
            }
            kind => self.node(kind, tokens, depth, budget).map(Some),
        }
    }

    /// Reads the body of a node of a kind; its number.
    fn node(
        &mut self,
        kind: &'a [u8],
        tokens: &mut Tokens<'a>,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<usize, Fault> {
        if depth > MAX_DEPTH {
            return Err(tokens.bad(format!("nodes {depth} deep"), "at most 200 levels are read"));
        }
        match tokens.next() {
            Some(Token::OpenNode) => {}
            Some(_) => {
                return Err(tokens.bad(
                    format!("no \"{{\" after {}", excerpt(kind)),
                    "a node is a name and a body in braces",
                ));
            }
            None => return Err(tokens.cut("the body of a node")),
        }
        if let Some(proto) = self.protos.get(kind) {
            let proto = Rc::clone(proto);
            return self.instance(&proto, tokens, depth, budget);
        }
        if let Some(name) = OTHER_GEOMETRY.iter().find(|n| n.as_bytes() == kind) {
            self.scene.unread.insert(name);
        }
        let node = match kind {
            b"Coordinate" => self.coordinate(tokens, budget)?,
            b"IndexedFaceSet" => self.faces(tokens, depth, budget)?,
            b"Inline" => self.inline(tokens, depth, budget)?,
            kind if primitives::is_primitive(kind) => self.primitive(kind, tokens, budget)?,
            _ => self.group(kind, tokens, depth, budget)?,
        };
        self.add(node, budget)
    }

    fn add(&mut self, node: Node, budget: &mut Budget) -> Result<usize, Fault> {
        budget.reserve("nodes", 3, size_of::<Node>())?;
        self.scene.nodes.push(node);
        Ok(self.scene.nodes.len() - 1)
    }

    /// Reads the body of a prototype with the fields of an instance; the first node is what it stands for.
    fn instance(
        &mut self,
        proto: &Proto<'a>,
        tokens: &mut Tokens<'a>,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<usize, Fault> {
        budget.reserve("prototypes", 1, NAME + proto.bytes())?;
        let values = proto.values(tokens)?;
        self.names.push(BTreeMap::new());
        let names = self.names.len() - 1;
        let floor = tokens.enter(proto.body.clone(), Instance { values, names });
        let mut first = None;
        while let Some(token) = tokens.next() {
            let Token::Word(word) = token else {
                return Err(tokens.bad(
                    format!("{token} stands outside of any node"),
                    "the body of a prototype is a list of nodes",
                ));
            };
            let node = self.statement(word, tokens, depth + 1, budget)?;
            first = first.or(node);
        }
        tokens.check()?;
        tokens.leave(floor);
        match first {
            Some(node) => Ok(node),
            None => self.add(Node::group(Vec::new()), budget),
        }
    }

    /// Reads the file that an `Inline` names.
    fn inline(&mut self, tokens: &mut Tokens<'a>, depth: usize, budget: &mut Budget) -> Result<Node, Fault> {
        let mut addresses = Vec::new();
        loop {
            match tokens.next() {
                Some(Token::CloseNode) => break,
                Some(Token::Text(address)) => addresses.push(String::from_utf8_lossy(address).into_owned()),
                Some(_) => {}
                None => return Err(tokens.cut("the end of an Inline")),
            }
        }
        let Some(path) = self.path else {
            self.scene.unread.insert("Inline");
            return Ok(Node::group(Vec::new()));
        };
        if self.inlined == MAX_INLINED {
            return Err(tokens.bad(
                format!("files inlined {} deep", MAX_INLINED + 1),
                "at most 8 levels are read; do they inline each other?",
            ));
        }
        let refused = |value: String, remedy| Fault::Value {
            what: "an inlined file",
            value,
            remedy,
        };
        // The addresses are alternatives in the order of preference.
        let mut beside = addresses
            .iter()
            .filter(|a| !a.contains(':'))
            .filter_map(|a| neighbour::beside(Some(path), a).ok());
        let Some(path) = beside.clone().find(|p| p.is_file()).or_else(|| beside.next()) else {
            return Err(refused(
                excerpt(addresses.first().map_or("without an address", |a| a).as_bytes()),
                "only files beside the document or below it are opened; put it there",
            ));
        };
        let read = |budget: &mut Budget| input::open(&path)?.read_all(budget);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let bytes = read(budget).map_err(|f| f.inside(&name))?;
        let mut file = File::new(self.scene, Some(&path), self.inlined + 1);
        let roots = file
            .nodes_of(&bytes, depth + 1, budget)
            .map_err(|f| f.inside(&name))?;
        Ok(Node::group(roots))
    }

    fn primitive(
        &mut self,
        kind: &[u8],
        tokens: &mut Tokens<'a>,
        budget: &mut Budget,
    ) -> Result<Node, Fault> {
        let polygons = primitives::read(kind, tokens)?;
        let first = self.scene.points.items.len();
        for p in &polygons.points {
            self.scene.points.push(*p, budget)?;
        }
        let count = polygons.points.len();
        let coord = Some(self.add(Node::Points { first, count }, budget)?);
        let first = self.scene.indices.items.len();
        for i in &polygons.indices {
            self.scene.indices.push(*i, budget)?;
        }
        Ok(Node::Faces {
            coord,
            first,
            count: polygons.indices.len(),
            ccw: true,
            is_round: kind != b"Box",
        })
    }

    fn group(
        &mut self,
        kind: &[u8],
        tokens: &mut Tokens<'a>,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<Node, Fault> {
        let mut children = Vec::new();
        let (mut translation, mut center, mut scale) = (DVec3::ZERO, DVec3::ZERO, DVec3::ONE);
        let (mut rotation, mut scale_orientation) = (DQuat::IDENTITY, DQuat::IDENTITY);
        let mut choice = match kind {
            b"Switch" => Some(usize::MAX),
            b"LOD" => Some(0),
            _ => None,
        };
        let is_transform = kind == b"Transform";
        loop {
            let token = tokens.next().ok_or_else(|| tokens.cut("the end of a node"))?;
            match token {
                Token::CloseNode => break,
                Token::OpenNode => tokens.skip(token)?,
                Token::Word(b"translation") if is_transform => translation = tokens.numbers()?.into(),
                Token::Word(b"center") if is_transform => center = tokens.numbers()?.into(),
                Token::Word(b"scale") if is_transform => scale = tokens.numbers()?.into(),
                Token::Word(b"rotation") if is_transform => rotation = turn(tokens.numbers()?),
                Token::Word(b"scaleOrientation") if is_transform => {
                    scale_orientation = turn(tokens.numbers()?)
                }
                Token::Word(b"whichChoice") if kind == b"Switch" => {
                    // Negative ones choose nothing, and so does a number beyond the list.
                    let which = tokens.number()?;
                    choice = Some(if which >= 0.0 { which as usize } else { usize::MAX });
                }
                Token::Word(word) => {
                    let starts_node = matches!(word, b"DEF" | b"USE" | b"PROTO" | b"EXTERNPROTO" | b"ROUTE")
                        || tokens.peek() == Some(Token::OpenNode);
                    if starts_node && let Some(child) = self.statement(word, tokens, depth + 1, budget)? {
                        budget.reserve("nodes", 3, size_of::<usize>())?;
                        children.push(child);
                    }
                }
                Token::Text(_) | Token::OpenList | Token::CloseList => {}
            }
        }
        let parent_from_node = DAffine3::from_translation(translation + center)
            * DAffine3::from_quat(rotation)
            * DAffine3::from_quat(scale_orientation)
            * DAffine3::from_scale(scale)
            * DAffine3::from_quat(scale_orientation.conjugate())
            * DAffine3::from_translation(-center);
        Ok(Node::Group {
            parent_from_node: if is_transform {
                parent_from_node
            } else {
                DAffine3::IDENTITY
            },
            children,
            choice,
        })
    }

    fn coordinate(&mut self, tokens: &mut Tokens<'a>, budget: &mut Budget) -> Result<Node, Fault> {
        let first = self.scene.points.items.len();
        loop {
            match tokens.next() {
                Some(Token::CloseNode) => break,
                Some(Token::Word(b"point")) => {
                    let is_list = tokens.peek() == Some(Token::OpenList);
                    if is_list {
                        tokens.next();
                    }
                    while tokens.peek() != Some(Token::CloseList) {
                        self.scene.points.push(tokens.numbers()?.into(), budget)?;
                        if !is_list {
                            break;
                        }
                    }
                }
                Some(Token::CloseList) => {}
                Some(_) => {
                    return Err(tokens.bad("a field that Coordinate has not", "it has \"point\" alone"));
                }
                None => return Err(tokens.cut("the end of a Coordinate")),
            }
        }
        Ok(Node::Points {
            first,
            count: self.scene.points.items.len() - first,
        })
    }

    fn faces(&mut self, tokens: &mut Tokens<'a>, depth: usize, budget: &mut Budget) -> Result<Node, Fault> {
        let (mut coord, mut ccw) = (None, true);
        let (mut first, mut count) = (self.scene.indices.items.len(), 0);
        loop {
            let token = tokens
                .next()
                .ok_or_else(|| tokens.cut("the end of an IndexedFaceSet"))?;
            match token {
                Token::CloseNode => break,
                Token::Word(b"ccw") => ccw = tokens.word("TRUE or FALSE")? != b"FALSE",
                Token::Word(b"coord") => match tokens.word("a node")? {
                    b"NULL" => {}
                    word => coord = self.statement(word, tokens, depth + 1, budget)?,
                },
                Token::Word(b"coordIndex") => {
                    first = self.scene.indices.items.len();
                    let is_list = tokens.peek() == Some(Token::OpenList);
                    if is_list {
                        tokens.next();
                    }
                    while tokens.peek() != Some(Token::CloseList) {
                        let word = tokens.word("an index")?;
                        let index = crate::text::integer(word).and_then(|n| i32::try_from(n).ok());
                        let index = index.filter(|n| *n >= -1).ok_or_else(|| {
                            tokens.bad(
                                format!("index {}", excerpt(word)),
                                "indices count from 0, and -1 ends a face",
                            )
                        })?;
                        self.scene.indices.push(index, budget)?;
                        if !is_list {
                            break;
                        }
                    }
                    count = self.scene.indices.items.len() - first;
                }
                // Colours, normals and textures.
                Token::Word(word)
                    if tokens.peek() == Some(Token::OpenNode) || matches!(word, b"DEF" | b"USE") =>
                {
                    self.statement(word, tokens, depth + 1, budget)?;
                }
                _ => {}
            }
        }
        Ok(Node::Faces {
            coord,
            first,
            count,
            ccw,
            is_round: false,
        })
    }
}

impl Node {
    fn group(children: Vec<usize>) -> Self {
        Self::Group {
            parent_from_node: DAffine3::IDENTITY,
            children,
            choice: None,
        }
    }
}

/// Axis and angle.
fn turn(r: [f64; 4]) -> DQuat {
    let axis = DVec3::new(r[0], r[1], r[2]).normalize_or_zero();
    if axis == DVec3::ZERO {
        DQuat::IDENTITY
    } else {
        DQuat::from_axis_angle(axis, r[3])
    }
}
