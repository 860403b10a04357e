//! Prototypes: the fields of their interface, and what an instance puts into them [ISO/IEC 14772-1:1997, 4.8].

use std::collections::BTreeMap;
use std::ops::Range;

use super::tokens::{Token, Tokens, Value};
use crate::Fault;
use crate::error::excerpt;

/// A node that a file defines itself.
#[derive(Debug)]
pub(super) struct Proto<'a> {
    fields: Vec<Field<'a>>,
    pub body: Range<usize>,
}

#[derive(Debug)]
struct Field<'a> {
    name: &'a [u8],
    element: Element,
    is_list: bool,
    /// The text of its value; events have none.
    default: Option<Range<usize>>,
}

/// What a value is made of.
#[derive(Clone, Copy, Debug)]
enum Element {
    Words(usize),
    Text,
    Image,
    Node,
}

const BROKEN: &str = "a prototype is a name, its fields in brackets and its nodes in braces";

impl<'a> Proto<'a> {
    /// Reads what follows the name: the interface and the body.
    pub fn read(tokens: &mut Tokens<'a>) -> Result<Self, Fault> {
        if tokens.scan() != Some(Token::OpenList) {
            return Err(tokens.bad("a prototype without its fields", BROKEN));
        }
        let mut fields = Vec::new();
        loop {
            let has_value = match tokens.scan() {
                Some(Token::CloseList) => break,
                Some(Token::Word(b"field" | b"exposedField")) => true,
                Some(Token::Word(b"eventIn" | b"eventOut")) => false,
                Some(other) => {
                    return Err(tokens.bad(format!("{other} among the fields of a prototype"), BROKEN));
                }
                None => return Err(tokens.cut("the fields of a prototype")),
            };
            let (element, is_list) = kind(tokens)?;
            let name = tokens.scan_word("the name of a field")?;
            let default = has_value.then(|| value(tokens, element, is_list)).transpose()?;
            fields.push(Field {
                name,
                element,
                is_list,
                default,
            });
        }
        if tokens.scan() != Some(Token::OpenNode) {
            return Err(tokens.bad("a prototype without a body", BROKEN));
        }
        let start = tokens.place();
        tokens.skip(Token::OpenNode)?;
        let body = start..tokens.place() - 1;
        Ok(Self { fields, body })
    }

    /// Bytes that it takes, and an instance of it.
    pub fn bytes(&self) -> usize {
        3 * self.fields.len() * (size_of::<Field>() + size_of::<Value>())
    }

    /// Reads the fields of an instance after its brace, up to the other one.
    pub fn values(&self, tokens: &mut Tokens<'a>) -> Result<BTreeMap<&'a [u8], Value<'a>>, Fault> {
        let defaults = self.fields.iter().filter_map(|f| {
            let text = f.default.clone()?;
            Some((f.name, Value { text, scope: None }))
        });
        let mut values: BTreeMap<_, _> = defaults.collect();
        loop {
            let name = match tokens.scan() {
                Some(Token::CloseNode) => return Ok(values),
                Some(Token::Word(b"ROUTE")) => {
                    for part in ["a field", "TO", "a field"] {
                        tokens.scan_word(part)?;
                    }
                    continue;
                }
                Some(Token::Word(name)) => name,
                Some(other) => {
                    return Err(tokens.bad(
                        format!("{other} where the name of a field has to stand"),
                        "the file breaks its format",
                    ));
                }
                None => return Err(tokens.cut("the fields of a prototype's instance")),
            };
            let field = self.fields.iter().find(|f| f.name == name).ok_or_else(|| {
                tokens.bad(
                    format!("the prototype has no field {}", excerpt(name)),
                    "its interface names all of them",
                )
            })?;
            let text = value(tokens, field.element, field.is_list)?;
            let scope = tokens.scope().cloned();
            values.insert(field.name, Value { text, scope });
        }
    }
}

/// The type of a field: single (`SF…`) or a list (`MF…`).
fn kind(tokens: &mut Tokens) -> Result<(Element, bool), Fault> {
    let word = tokens.scan_word("the type of a field")?;
    let is_list = word.starts_with(b"MF");
    let element = match word.get(2..) {
        Some(b"Bool" | b"Int32" | b"Float" | b"Time") => Element::Words(1),
        Some(b"Vec2f") => Element::Words(2),
        Some(b"Vec3f" | b"Color") => Element::Words(3),
        Some(b"Rotation") => Element::Words(4),
        Some(b"String") => Element::Text,
        Some(b"Image") => Element::Image,
        Some(b"Node") => Element::Node,
        _ => {
            return Err(tokens.bad(
                format!("type {} of a field", excerpt(word)),
                "VRML97 has SFBool to MFVec3f",
            ));
        }
    };
    Ok((element, is_list))
}

/// Passes over a value; where it stands.
fn value(tokens: &mut Tokens, element: Element, is_list: bool) -> Result<Range<usize>, Fault> {
    let start = tokens.skip_blanks();
    match tokens.scan() {
        Some(Token::Word(b"IS")) => _ = tokens.scan_word("the name of a field")?,
        Some(Token::OpenList) if is_list => tokens.skip(Token::OpenList)?,
        Some(first) => match (element, first) {
            (Element::Words(n), Token::Word(_)) => words(tokens, n - 1)?,
            (Element::Text, Token::Text(_)) => {}
            (Element::Image, Token::Word(width)) => {
                let height = tokens.scan_word("the height of an image")?;
                tokens.scan_word("the components of an image")?;
                let pixels = [width, height].map(|w| crate::text::integer(w).unwrap_or(0).max(0) as usize);
                words(tokens, pixels[0].saturating_mul(pixels[1]))?;
            }
            (Element::Node, Token::Word(b"NULL")) => {}
            (Element::Node, Token::Word(b"USE")) => words(tokens, 1)?,
            (Element::Node, Token::Word(word)) => {
                if word == b"DEF" {
                    words(tokens, 2)?;
                }
                if tokens.scan() != Some(Token::OpenNode) {
                    return Err(tokens.bad(
                        format!("no \"{{\" after {}", excerpt(word)),
                        "a node is a name and a body in braces",
                    ));
                }
                tokens.skip(Token::OpenNode)?;
            }
            _ => {
                return Err(tokens.bad(
                    format!("{first} as the value of a field"),
                    "it is not of the type that the interface names",
                ));
            }
        },
        None => return Err(tokens.cut("the value of a field")),
    }
    Ok(start..tokens.place())
}

fn words(tokens: &mut Tokens, count: usize) -> Result<(), Fault> {
    for _ in 0..count {
        tokens.scan_word("the value of a field")?;
    }
    Ok(())
}
