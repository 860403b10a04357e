//! Words of a VRML file, without comments and commas; inside of a prototype, `IS` is what was handed to it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use crate::Fault;
use crate::error::excerpt;

/// Bytes of prototypes and their values that are read again in one file: prototypes in prototypes multiply.
const MOST_REPEATED: usize = 1 << 26;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token<'a> {
    /// A name, keyword or number.
    Word(&'a [u8]),
    /// The content of a string, its escapes as they are written.
    Text(&'a [u8]),
    OpenNode,
    CloseNode,
    OpenList,
    CloseList,
}

/// A prototype put somewhere: what its fields hold, and where the names of its body are kept.
#[derive(Debug)]
pub(super) struct Instance<'a> {
    pub values: BTreeMap<&'a [u8], Value<'a>>,
    pub names: usize,
}

/// The text of a field's value, and the instance in whose body it stands.
#[derive(Clone, Debug)]
pub(super) struct Value<'a> {
    pub text: Range<usize>,
    pub scope: Option<Rc<Instance<'a>>>,
}

/// Where reading stands in a part of the file.
#[derive(Debug)]
struct Source<'a> {
    at: usize,
    end: usize,
    scope: Option<Rc<Instance<'a>>>,
}

#[derive(Debug)]
pub(super) struct Tokens<'a> {
    bytes: &'a [u8],
    /// What is read, the innermost part last.
    sources: Vec<Source<'a>>,
    /// The part at whose end the tokens end.
    floor: usize,
    /// What [`Self::peek`] saw.
    ahead: Option<Option<Token<'a>>>,
    repeated: usize,
}

impl<'a> Tokens<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            sources: vec![Source {
                at: 0,
                end: bytes.len(),
                scope: None,
            }],
            floor: 0,
            ahead: None,
            repeated: 0,
        }
    }

    /// Reads the body of a prototype from here on, up to its end.
    ///
    /// Gives what [`Self::leave`] needs.
    pub fn enter(&mut self, body: Range<usize>, instance: Instance<'a>) -> usize {
        debug_assert!(self.ahead.is_none(), "a body follows a brace that was read");
        self.push(Value {
            text: body,
            scope: Some(Rc::new(instance)),
        });
        std::mem::replace(&mut self.floor, self.sources.len() - 1)
    }

    /// Goes on after the instance whose body was read.
    pub fn leave(&mut self, floor: usize) {
        self.sources.truncate(self.floor);
        self.floor = floor;
        self.ahead = None;
    }

    fn push(&mut self, value: Value<'a>) {
        self.repeated = self.repeated.saturating_add(value.text.len());
        self.sources.push(Source {
            at: value.text.start,
            end: value.text.end,
            scope: value.scope,
        });
    }

    fn top(&self) -> &Source<'a> {
        self.sources.last().expect("the file is the first source")
    }

    /// The instance in whose body the last token stands.
    pub fn scope(&self) -> Option<&Rc<Instance<'a>>> {
        self.top().scope.as_ref()
    }

    /// A fault at the line of the last token.
    #[cold]
    pub fn bad(&self, what: impl Into<String>, remedy: &'static str) -> Fault {
        let read = &self.bytes[..self.top().at];
        let line = 1 + memchr::memchr_iter(b'\n', read).count() as u64;
        Fault::line(line, what, remedy)
    }

    #[cold]
    pub fn cut(&self, what: &str) -> Fault {
        self.check().err().unwrap_or_else(|| Fault::Truncated {
            what: what.into(),
            needed: self.bytes.len() as u64 + 1,
            found: self.bytes.len() as u64,
        })
    }

    /// Refuses a file whose prototypes are read without end; its tokens ended early.
    pub fn check(&self) -> Result<(), Fault> {
        if self.repeated <= MOST_REPEATED {
            return Ok(());
        }
        Err(Fault::Value {
            what: "the text of the prototypes, each use counted",
            value: format!("above {MOST_REPEATED} bytes"),
            remedy: "export a plain mesh",
        })
    }

    pub fn next(&mut self) -> Option<Token<'a>> {
        if let Some(token) = self.ahead.take() {
            return token;
        }
        loop {
            if self.repeated > MOST_REPEATED {
                return None;
            }
            match self.scan() {
                None if self.sources.len() - 1 == self.floor => return None,
                None => _ = self.sources.pop(),
                Some(Token::Word(b"IS")) if self.scope().is_some() => {
                    let name = self.scan();
                    let values = self.scope().map(|s| &s.values);
                    // An event has no value.
                    if let (Some(Token::Word(name)), Some(values)) = (name, values)
                        && let Some(value) = values.get(name)
                    {
                        self.push(value.clone());
                    }
                }
                token => return token,
            }
        }
    }

    /// The next token of the innermost part as it is written.
    pub fn scan(&mut self) -> Option<Token<'a>> {
        let start = self.skip_blanks();
        let source = self.sources.last_mut().expect("the file is the first source");
        let bytes = &self.bytes[..source.end];
        let first = *bytes.get(start)?;
        let mut at = start + 1;
        let token = match first {
            b'{' => Token::OpenNode,
            b'}' => Token::CloseNode,
            b'[' => Token::OpenList,
            b']' => Token::CloseList,
            b'"' => {
                let mut end = bytes.len();
                while let Some(b) = bytes.get(at) {
                    at += 1;
                    match b {
                        b'"' => {
                            end = at - 1;
                            break;
                        }
                        b'\\' => at += 1,
                        _ => {}
                    }
                }
                at = at.min(bytes.len());
                Token::Text(&bytes[start + 1..end.max(start + 1)])
            }
            _ => {
                let ends = |b: &u8| is_blank(*b) || matches!(b, b'{' | b'}' | b'[' | b']' | b'"' | b'#');
                let length = bytes[at..].iter().position(ends);
                at += length.unwrap_or(bytes.len() - at);
                Token::Word(&bytes[start..at])
            }
        };
        source.at = at;
        Some(token)
    }

    /// Passes over blanks and comments; the place of what follows.
    pub fn skip_blanks(&mut self) -> usize {
        let source = self.sources.last_mut().expect("the file is the first source");
        let bytes = &self.bytes[..source.end];
        while let Some(b) = bytes.get(source.at) {
            match *b {
                b'#' => {
                    let rest = &bytes[source.at..];
                    source.at += memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
                }
                b if is_blank(b) => source.at += 1,
                _ => break,
            }
        }
        source.at
    }

    /// The place after the last token.
    pub fn place(&self) -> usize {
        self.top().at
    }

    /// The next token, which is left to be read again.
    pub fn peek(&mut self) -> Option<Token<'a>> {
        if self.ahead.is_none() {
            self.ahead = Some(self.next());
        }
        self.ahead.flatten()
    }

    /// A word that has to come next.
    pub fn word(&mut self, what: &str) -> Result<&'a [u8], Fault> {
        let token = self.next();
        self.as_word(token, what)
    }

    /// [`Self::word`] as it is written.
    pub fn scan_word(&mut self, what: &str) -> Result<&'a [u8], Fault> {
        let token = self.scan();
        self.as_word(token, what)
    }

    fn as_word(&self, token: Option<Token<'a>>, what: &str) -> Result<&'a [u8], Fault> {
        match token {
            Some(Token::Word(w)) => Ok(w),
            Some(other) => Err(self.bad(
                format!("{other} where {what} has to stand"),
                "the file breaks its format",
            )),
            None => Err(self.cut(what)),
        }
    }

    pub fn number(&mut self) -> Result<f64, Fault> {
        let word = self.word("a number")?;
        fast_float2::parse(word).map_err(|_| {
            self.bad(
                format!("{} is not a number", excerpt(word)),
                "numbers are written like 1.5",
            )
        })
    }

    /// `N` numbers.
    pub fn numbers<const N: usize>(&mut self) -> Result<[f64; N], Fault> {
        let mut all = [0.0; N];
        for slot in &mut all {
            *slot = self.number()?;
        }
        Ok(all)
    }

    /// Skips what was just opened by `open`, up to its end, as it is written.
    pub fn skip(&mut self, open: Token<'a>) -> Result<(), Fault> {
        self.ahead = None;
        let close = if open == Token::OpenNode {
            Token::CloseNode
        } else {
            Token::CloseList
        };
        let mut depth = 1u64;
        while depth > 0 {
            let token = self.scan().ok_or_else(|| self.cut("the end of a definition"))?;
            depth += u64::from(token == open);
            depth -= u64::from(token == close);
        }
        Ok(())
    }
}

impl std::fmt::Display for Token<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Word(w) => f.write_str(&excerpt(w)),
            Self::Text(_) => f.write_str("a string"),
            Self::OpenNode => f.write_str("\"{\""),
            Self::CloseNode => f.write_str("\"}\""),
            Self::OpenList => f.write_str("\"[\""),
            Self::CloseList => f.write_str("\"]\""),
        }
    }
}

/// Commas are blanks.
fn is_blank(b: u8) -> bool {
    matches!(b, b' ' | b'\t' | b'\n' | b'\r' | b',')
}
