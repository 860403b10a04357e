//! Lines of a header, read no further than their end.

use super::Content;
use crate::Fault;
use crate::input::read_fault;
use crate::limits::Budget;

/// Longest header: lists of thousands of data files fit.
const LONGEST: u64 = 1 << 20;

/// Lines of text before binary data.
pub(in crate::volumes) struct Lines<'c, 'a, 'b> {
    content: &'c mut Content<'a>,
    budget: &'b mut Budget,
    read: u64,
    /// Number of the line last given, from 1.
    pub number: u64,
}

impl<'c, 'a, 'b> Lines<'c, 'a, 'b> {
    pub fn new(content: &'c mut Content<'a>, budget: &'b mut Budget) -> Self {
        Self {
            content,
            budget,
            read: 0,
            number: 0,
        }
    }

    /// The next line without its end; `None` at the end of the content.
    pub fn next(&mut self) -> Result<Option<String>, Fault> {
        let mut line = Vec::new();
        let mut byte = [0];
        let before = self.read;
        loop {
            let n = self.content.source.read(&mut byte).map_err(read_fault)?;
            self.read += n as u64;
            if n == 0 || byte[0] == b'\n' {
                break;
            }
            line.push(byte[0]);
            if self.read > LONGEST {
                return Err(Fault::line(
                    self.number + 1,
                    format!("the header has more than {LONGEST} bytes"),
                    "is this the right kind of file?",
                ));
            }
        }
        let length = self.read - before;
        self.content.bound = self.content.bound.map(|b| b.saturating_sub(length));
        // Lists of file names become paths of about twice their length.
        self.budget.reserve("the header", length, 3)?;
        if length == 0 {
            return Ok(None);
        }
        self.number += 1;
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        let text = String::from_utf8(line).map_err(|e| {
            Fault::line(
                self.number,
                format!("{} is no text", crate::error::excerpt(e.as_bytes())),
                "a header is text up to the voxels; is it damaged?",
            )
        })?;
        Ok(Some(text))
    }
}
