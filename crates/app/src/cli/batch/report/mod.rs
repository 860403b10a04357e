//! `report.html`: what came of a batch, for a browser. One file with its data and its script in it, and pictures beside
//! it that are loaded when they are looked at; nothing comes from the network.
//!
//! Names and messages are data of strangers. They stand in one place, a JSON value in a classic script, where no
//! character can end the script; the page shows them as text nodes alone. Paths of pictures are names that this program
//! made.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::super::failure::{Failure, Outcome};
use super::manifest::Entry;
use super::totals::Totals;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Writes the report into the directory of the batch.
pub fn write(directory: &Path, totals: &Totals, entries: &BTreeMap<String, Entry>) -> Outcome {
    let page = page(totals, &totals.ordered(entries));
    formats::atomic::replace(&directory.join("report.html"), |out| {
        out.write_all(page.as_bytes())
    })
    .map_err(Failure::limit)
}

fn page(totals: &Totals, entries: &[&Entry]) -> String {
    let rows: Vec<Value> = entries.iter().map(|e| row(e)).collect();
    let data = json!({ "totals": totals, "rows": rows });
    let parts = [
        ("/*STYLE*/", STYLE.to_owned()),
        ("/*DATA*/", format!("const BATCH = {};", in_script(&data))),
        ("/*SCRIPT*/", SCRIPT.to_owned()),
    ];
    // Each mark stands once, in this order; what is put in is not looked at again.
    let (mut page, mut rest) = (String::new(), PAGE);
    for (mark, part) in parts {
        let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
        page += before;
        page += &part;
        rest = after;
    }
    page + rest
}

/// What the page shows of an entry.
fn row(e: &Entry) -> Value {
    let path = |role: &str| e.outputs.get(role).map(|w| &w.path);
    let fit = |key: &str| e.fit.get(key);
    json!({
        "input": e.input,
        "state": e.state,
        "kind": e.kind,
        "rms": fit("rms"),
        "p95": fit("p95"),
        "max": fit("max"),
        "unit": fit("unit"),
        "tolerance": fit("tolerance"),
        "coefficients": fit("coefficients"),
        "seconds": e.seconds,
        "peak": e.peak_rss_bytes,
        "bytes": e.outputs.get("field").map(|w| w.bytes),
        "inputBytes": e.input_bytes,
        "hash": fit("field_sha256"),
        "field": path("field"),
        "mesh": path("mesh"),
        "picture": path("picture"),
        "errors": path("errors"),
        "notes": e.notes,
        "stage": e.failure.as_ref().map(|f| &f.stage),
        "reason": e.failure.as_ref().map(|f| &f.message),
    })
}

/// JSON that is also a script: no `<` or `>` that could end it or begin a comment, and neither of the two line breaks
/// that JSON allows in strings and old scripts do not.
fn in_script(value: &Value) -> String {
    value
        .to_string()
        .replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029")
}

#[cfg(test)]
mod tests {
    use serde_json::Map;

    use super::super::manifest::{Run, State};
    use super::*;

    #[test]
    fn nothing_in_a_name_leaves_the_data() {
        let hostile = "</script><!--<script>alert(1)\u{2028}&lt;/*SCRIPT*/\"'`${1}";
        let entry = Entry {
            input: hostile.into(),
            name: "x".into(),
            state: State::Done,
            kind: None,
            input_bytes: 0,
            input_sha256: None,
            key: None,
            failure: None,
            fit: Map::new(),
            mesh: Map::new(),
            outputs: BTreeMap::new(),
            seconds: 1.0,
            peak_rss_bytes: None,
            notes: vec![hostile.into()],
        };
        let run = Run::new(Map::new(), None, 1, vec![("x".into(), hostile.into())]);
        let totals = Totals::new(&[run], &BTreeMap::new(), 0.0);
        let page = page(&totals, &[&entry]);
        let script = in_script(&json!(hostile));
        assert!(!script.contains(['<', '>', '&', '\u{2028}']), "{script}");
        assert_eq!(serde_json::from_str::<String>(&script).unwrap(), hostile);
        assert_eq!(
            page.matches("</script>").count(),
            PAGE.matches("</script>").count()
        );
        assert_eq!(page.matches(SCRIPT).count(), 1);
        assert_eq!(page.matches(STYLE).count(), 1);
        for word in ["http:", "https:", "//cdn", "@import"] {
            assert!(!page.contains(word), "{word}: the network");
        }
    }
}
