#![no_main]
//! A file of any bytes, and one of any records with right checksums after an empty document: an error or a document that takes
//! an edit.

use std::io::Write;
use std::sync::OnceLock;

use document::{Document, Options, State};
use formats::ReadLimits;
use libfuzzer_sys::fuzz_target;

/// A document without objects.
fn empty() -> Vec<u8> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("empty.isoclay");
    Document::create(&path, State::new(), Options::default()).unwrap();
    std::fs::read(&path).unwrap()
}

/// An empty document and records of the bytes: kind, lengths of both parts, parts.
fn records(mut bytes: &[u8]) -> Vec<u8> {
    static EMPTY: OnceLock<Vec<u8>> = OnceLock::new();
    let mut file = EMPTY.get_or_init(empty).clone();
    while let [kind, text, bulk, rest @ ..] = bytes {
        let text = usize::from(*text).min(rest.len());
        let bulk = (8 * usize::from(*bulk)).min(rest.len() - text);
        let parts = [&rest[..text], &rest[text..text + bulk]];
        let mut head = u32::from(kind % 4).to_le_bytes().to_vec();
        parts.iter().for_each(|part| head.extend((part.len() as u64).to_le_bytes()));
        parts.iter().for_each(|part| head.extend(crc32fast::hash(part).to_le_bytes()));
        head.extend(crc32fast::hash(&head).to_le_bytes());
        file.extend(head);
        parts.iter().for_each(|part| file.extend_from_slice(part));
        bytes = &rest[text + bulk..];
    }
    file
}

fuzz_target!(|bytes: &[u8]| {
    let options = Options { limits: ReadLimits { max_bytes: 1 << 24 }, ..Options::default() };
    for content in [records(bytes), bytes.to_vec()] {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&content).unwrap();
        if let Ok(mut opened) = Document::open(file.path(), options) {
            let _ = opened.document.history();
            let _ = opened.document.undo(1);
            let _ = opened.document.commit("none", serde_json::Value::Null, State::new());
            let damaged = file.path().with_extension("damaged");
            let _ = std::fs::remove_file(damaged);
        }
    }
});
