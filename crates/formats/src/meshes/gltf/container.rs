//! Where the document and the buffers stand: a `.glb` file, or text with embedded or neighbouring buffers.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::json::Root;
use crate::limits::Budget;
use crate::{Fault, input, neighbour};

/// The document and, in a `.glb`, the first buffer.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Fault> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None));
    }
    let word = |at: usize| -> Result<u64, Fault> {
        let b = bytes.get(at..at + 4).ok_or(Fault::Truncated {
            what: "a header or chunk of the binary container".into(),
            needed: at as u64 + 4,
            found: bytes.len() as u64,
        })?;
        Ok(u64::from(u32::from_le_bytes(b.try_into().expect("four bytes"))))
    };
    let (version, length) = (word(4)?, word(8)?);
    if version != 2 {
        return Err(Fault::Value {
            what: "the version of the binary container",
            value: version.to_string(),
            remedy: "2 is read; export the file again",
        });
    }
    if length > bytes.len() as u64 {
        return Err(Fault::Truncated {
            what: "the binary container".into(),
            needed: length,
            found: bytes.len() as u64,
        });
    }
    let chunk = |at: usize, kind: &[u8; 4]| -> Result<&[u8], Fault> {
        let size = word(at)? as usize;
        let content = bytes.get(at + 8..(at + 8).saturating_add(size));
        match content {
            Some(content) if bytes[at + 4..at + 8] == *kind => Ok(content),
            Some(_) => Err(Fault::Damaged {
                what: format!(
                    "there is no chunk {:?} at byte {at}",
                    String::from_utf8_lossy(kind)
                ),
            }),
            None => Err(Fault::Truncated {
                what: format!("the chunk at byte {at}"),
                needed: size as u64,
                found: (bytes.len() as u64).saturating_sub(at as u64 + 8),
            }),
        }
    };
    let document = chunk(12, b"JSON")?;
    let next = 20 + document.len();
    let binary = if (next as u64) < length {
        Some(chunk(next, b"BIN\0")?)
    } else {
        None
    };
    Ok((document, binary))
}

/// The content of every buffer.
pub(super) fn buffers(
    root: &Root,
    binary: Option<&[u8]>,
    path: Option<&Path>,
    budget: &mut Budget,
) -> Result<Vec<Vec<u8>>, Fault> {
    let mut all = Vec::with_capacity(root.buffers.len());
    for (i, buffer) in root.buffers.iter().enumerate() {
        let content = match (&buffer.uri, binary) {
            (None, Some(binary)) if i == 0 => {
                budget.reserve("the buffers", binary.len() as u64, 1)?;
                binary.to_vec()
            }
            (None, _) => {
                return Err(Fault::Value {
                    what: "the place of a buffer",
                    value: format!("not given for buffer {i}"),
                    remedy: "export as .glb, or as .gltf with its buffers",
                });
            }
            (Some(uri), _) => match uri.strip_prefix("data:") {
                Some(data) => embedded(data, budget)?,
                None => neighbour(uri, path, budget)?,
            },
        };
        if buffer.byte_length > content.len() as u64 {
            return Err(Fault::Truncated {
                what: format!("buffer {i}"),
                needed: buffer.byte_length,
                found: content.len() as u64,
            });
        }
        all.push(content);
    }
    Ok(all)
}

fn embedded(data: &str, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    let damaged = |what: String| Fault::Damaged { what };
    let (_, text) = data
        .split_once(";base64,")
        .ok_or_else(|| damaged("an embedded buffer is not base64".into()))?;
    budget.reserve("the buffers", text.len() as u64 / 4 * 3 + 3, 1)?;
    STANDARD
        .decode(text)
        .map_err(|e| damaged(format!("an embedded buffer is not base64: {e}")))
}

/// A file in the folder of the document or below it.
fn neighbour(uri: &str, path: Option<&Path>, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    let refused = |remedy| Fault::Value {
        what: "the place of a buffer",
        value: format!("{:?}", uri.chars().take(80).collect::<String>()),
        remedy,
    };
    let name = decode_percent(uri).ok_or_else(|| refused("its name is no text"))?;
    if name.contains(':') || name.contains('\\') {
        return Err(refused("only files beside the document are opened; put it there"));
    }
    let path =
        path.ok_or_else(|| refused("bytes alone have no files beside them; read the file by its name"))?;
    let beside = neighbour::beside(Some(path), &name)
        .map_err(|_| refused("only files beside the document are opened; put it there"))?;
    // As it is: a buffer is bare numbers, whose first may look like any magic. The message would name the document
    // alone.
    let open = input::open_by_name(&beside).map_err(|e| Fault::Damaged {
        what: format!("its buffer {}: {e}", beside.display()),
    })?;
    open.read_all(budget)
}

fn decode_percent(uri: &str) -> Option<String> {
    let mut out = Vec::with_capacity(uri.len());
    let mut bytes = uri.bytes();
    while let Some(b) = bytes.next() {
        if b == b'%' {
            let mut digit = || bytes.next().and_then(|d| char::from(d).to_digit(16));
            let (high, low) = (digit()?, digit()?);
            out.push((high * 16 + low) as u8);
        } else {
            out.push(b);
        }
    }
    String::from_utf8(out).ok()
}
