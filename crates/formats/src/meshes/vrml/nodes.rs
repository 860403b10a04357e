//! The nodes of a VRML file that faces hang on; all others are groups of what is in them.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DAffine3, DQuat, DVec3};

use super::tokens::{Token, Tokens};
use crate::Fault;
use crate::error::excerpt;
use crate::limits::{Budget, Counted};

/// Nodes inside of nodes.
const MAX_DEPTH: usize = 200;
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
    /// `IndexedFaceSet`: where its indices lie in [`Scene::indices`].
    Faces {
        coord: Option<usize>,
        first: usize,
        count: usize,
        ccw: bool,
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
    names: BTreeMap<Vec<u8>, usize>,
}

const OTHER_GEOMETRY: [&str; 10] = [
    "Box",
    "Cone",
    "Cylinder",
    "ElevationGrid",
    "Extrusion",
    "IndexedLineSet",
    "Inline",
    "PointSet",
    "Sphere",
    "PROTO",
];

/// Reads all nodes.
pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<Scene, Fault> {
    let mut scene = Scene {
        nodes: Vec::new(),
        roots: Vec::new(),
        points: Counted::new("points"),
        indices: Counted::new("indices"),
        unread: BTreeSet::new(),
        names: BTreeMap::new(),
    };
    let mut tokens = Tokens::new(bytes);
    while let Some(token) = tokens.next() {
        let Token::Word(word) = token else {
            return Err(tokens.bad(
                format!("{token:?} stands outside of any node"),
                "a file is a list of nodes",
            ));
        };
        if let Some(node) = scene.statement(word, &mut tokens, 0, budget)? {
            scene.roots.push(node);
        }
    }
    Ok(scene)
}

impl Scene {
    /// Reads what starts with `word`: a node, whose number comes back, or something without one.
    fn statement(
        &mut self,
        word: &[u8],
        tokens: &mut Tokens,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<Option<usize>, Fault> {
        match word {
            b"DEF" => {
                let name = tokens.word("a name")?;
                let kind = tokens.word("a node")?;
                let node = self.node(kind, tokens, depth, budget)?;
                budget.reserve("names", 1, NAME + name.len())?;
                self.names.insert(name.to_vec(), node);
                Ok(Some(node))
            }
            b"USE" => {
                let name = tokens.word("a name")?;
                budget.reserve("nodes", 2, size_of::<usize>())?;
                match self.names.get(name) {
                    Some(node) => Ok(Some(*node)),
                    None => Err(tokens.bad(
                        format!("USE of {}", excerpt(name)),
                        "a name is defined before it is used, not inside of itself",
                    )),
                }
            }
            b"PROTO" | b"EXTERNPROTO" => {
                self.unread.insert("PROTO");
                tokens.word("a name")?;
                for open in [Token::OpenList, Token::OpenNode] {
                    match tokens.next() {
                        Some(t) if t == open => tokens.skip(open)?,
                        // An external one ends with the address, or a list of them.
                        Some(Token::Text) => {}
                        Some(Token::OpenList) => tokens.skip(Token::OpenList)?,
                        _ => {
                            return Err(
                                tokens.bad("a prototype without its parts", "the file breaks its format")
                            );
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
        kind: &[u8],
        tokens: &mut Tokens,
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
        if let Some(name) = OTHER_GEOMETRY.iter().find(|n| n.as_bytes() == kind) {
            self.unread.insert(name);
        }
        let node = match kind {
            b"Coordinate" => self.coordinate(tokens, budget)?,
            b"IndexedFaceSet" => self.faces(tokens, depth, budget)?,
            _ => self.group(kind, tokens, depth, budget)?,
        };
        budget.reserve("nodes", 3, size_of::<Node>())?;
        self.nodes.push(node);
        Ok(self.nodes.len() - 1)
    }

    fn group(
        &mut self,
        kind: &[u8],
        tokens: &mut Tokens,
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
                Token::Text | Token::OpenList | Token::CloseList => {}
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

    fn coordinate(&mut self, tokens: &mut Tokens, budget: &mut Budget) -> Result<Node, Fault> {
        let first = self.points.items.len();
        loop {
            match tokens.next() {
                Some(Token::CloseNode) => break,
                Some(Token::Word(b"point")) => {
                    let is_list = tokens.peek() == Some(Token::OpenList);
                    if is_list {
                        tokens.next();
                    }
                    while tokens.peek() != Some(Token::CloseList) {
                        self.points.push(tokens.numbers()?.into(), budget)?;
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
            count: self.points.items.len() - first,
        })
    }

    fn faces(&mut self, tokens: &mut Tokens, depth: usize, budget: &mut Budget) -> Result<Node, Fault> {
        let (mut coord, mut ccw) = (None, true);
        let (mut first, mut count) = (self.indices.items.len(), 0);
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
                    first = self.indices.items.len();
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
                        self.indices.push(index, budget)?;
                        if !is_list {
                            break;
                        }
                    }
                    count = self.indices.items.len() - first;
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
        })
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
