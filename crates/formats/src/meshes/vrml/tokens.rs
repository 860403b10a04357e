//! Words of a VRML file, without comments and commas.

use crate::Fault;
use crate::error::excerpt;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token<'a> {
    /// A name, keyword or number.
    Word(&'a [u8]),
    /// The content of a string is of no use here.
    Text,
    OpenNode,
    CloseNode,
    OpenList,
    CloseList,
}

#[derive(Debug)]
pub(super) struct Tokens<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Tokens<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// A fault at the line of the last token.
    #[cold]
    pub fn bad(&self, what: impl Into<String>, remedy: &'static str) -> Fault {
        let read = &self.bytes[..self.at.min(self.bytes.len())];
        let line = 1 + memchr::memchr_iter(b'\n', read).count() as u64;
        Fault::line(line, what, remedy)
    }

    #[cold]
    pub fn cut(&self, what: &str) -> Fault {
        Fault::Truncated {
            what: what.into(),
            needed: self.bytes.len() as u64 + 1,
            found: self.bytes.len() as u64,
        }
    }

    pub fn next(&mut self) -> Option<Token<'a>> {
        let bytes = self.bytes;
        loop {
            match *bytes.get(self.at)? {
                b'#' => {
                    let rest = &bytes[self.at..];
                    self.at += memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
                }
                b if is_blank(b) => self.at += 1,
                _ => break,
            }
        }
        let start = self.at;
        self.at += 1;
        Some(match bytes[start] {
            b'{' => Token::OpenNode,
            b'}' => Token::CloseNode,
            b'[' => Token::OpenList,
            b']' => Token::CloseList,
            b'"' => {
                while let Some(b) = bytes.get(self.at) {
                    self.at += 1;
                    match b {
                        b'"' => break,
                        b'\\' => self.at += 1,
                        _ => {}
                    }
                }
                self.at = self.at.min(bytes.len());
                Token::Text
            }
            _ => {
                let ends = |b: &u8| is_blank(*b) || matches!(b, b'{' | b'}' | b'[' | b']' | b'"' | b'#');
                let length = bytes[self.at..].iter().position(ends);
                self.at += length.unwrap_or(bytes.len() - self.at);
                Token::Word(&bytes[start..self.at])
            }
        })
    }

    /// The next token, which is left to be read again.
    pub fn peek(&mut self) -> Option<Token<'a>> {
        let at = self.at;
        let token = self.next();
        self.at = at;
        token
    }

    /// A word that has to come next.
    pub fn word(&mut self, what: &str) -> Result<&'a [u8], Fault> {
        match self.next() {
            Some(Token::Word(w)) => Ok(w),
            Some(other) => Err(self.bad(
                format!("{other:?} where {what} has to stand"),
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

    /// Skips what was just opened by `open`, up to its end.
    pub fn skip(&mut self, open: Token<'a>) -> Result<(), Fault> {
        let close = if open == Token::OpenNode {
            Token::CloseNode
        } else {
            Token::CloseList
        };
        let mut depth = 1u64;
        while depth > 0 {
            let token = self.next().ok_or_else(|| self.cut("the end of a definition"))?;
            depth += u64::from(token == open);
            depth -= u64::from(token == close);
        }
        Ok(())
    }
}

/// Commas are blanks.
fn is_blank(b: u8) -> bool {
    matches!(b, b' ' | b'\t' | b'\n' | b'\r' | b',')
}
