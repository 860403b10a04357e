//! What may be linked is written in `deny.toml`; this holds the dependency tree against it, with nothing
//! installed but cargo. It is the part of `cargo deny check licenses sources` that we need.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("crates/app lies two levels down")
}

/// The entries of `allow = [...]`.
fn allowed() -> BTreeSet<String> {
    let text = std::fs::read_to_string(workspace().join("deny.toml")).unwrap();
    let list = text
        .split_once("allow = [")
        .expect("deny.toml has an allow list")
        .1
        .split_once(']')
        .unwrap()
        .0;
    list.split(',')
        .map(|e| e.trim().trim_matches('"').to_string())
        .filter(|e| !e.is_empty())
        .collect()
}

/// Whether an SPDX expression can be met by allowed licences. `/` is the old way to write OR.
fn is_met(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let e = expression.trim();
    // OR binds weakest: split at the top level first, then at AND.
    for (operator, all) in [(" OR ", false), ("/", false), (" AND ", true)] {
        let parts = split_top_level(e, operator);
        if parts.len() > 1 {
            return if all {
                parts.iter().all(|p| is_met(p, allowed))
            } else {
                parts.iter().any(|p| is_met(p, allowed))
            };
        }
    }
    match e.strip_prefix('(').and_then(|e| e.strip_suffix(')')) {
        Some(inner) => is_met(inner, allowed),
        None => allowed.contains(e),
    }
}

fn split_top_level<'a>(e: &'a str, operator: &str) -> Vec<&'a str> {
    let (mut parts, mut start, mut depth) = (Vec::new(), 0, 0);
    for (i, c) in e.char_indices() {
        depth += match c {
            '(' => 1,
            ')' => -1,
            _ => 0,
        };
        if depth == 0 && i >= start && e[i..].starts_with(operator) {
            parts.push(&e[start..i]);
            start = i + operator.len();
        }
    }
    parts.push(&e[start..]);
    parts
}

#[test]
fn expressions_are_read_as_spdx_says() {
    let allowed = BTreeSet::from(["MIT".to_string(), "Unicode-3.0".to_string()]);
    for (expression, met) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("MIT OR GPL-3.0", true),
        ("MIT/Apache-2.0", true),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", true),
        ("MIT AND GPL-3.0", false),
        ("MIT AND GPL-3.0 OR Zlib", false),
        ("Apache-2.0 WITH LLVM-exception", false),
    ] {
        assert_eq!(is_met(expression, &allowed), met, "{expression}");
    }
}

#[test]
fn every_dependency_has_an_allowed_licence_and_source() {
    let out = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--locked",
            "--filter-platform",
            "x86_64-unknown-linux-gnu",
        ])
        .current_dir(workspace())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let metadata: Value = serde_json::from_slice(&out.stdout).unwrap();
    let nodes: BTreeSet<&str> = metadata["resolve"]["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n["id"].as_str().unwrap())
        .collect();
    let allowed = allowed();
    let mut bad = Vec::new();
    let packages = metadata["packages"].as_array().unwrap();
    for p in packages
        .iter()
        .filter(|p| nodes.contains(p["id"].as_str().unwrap()))
    {
        let name = format!("{} {}", p["name"], p["version"]);
        match p["license"].as_str() {
            Some(l) if is_met(l, &allowed) => {}
            l => bad.push(format!("{name}: licence {l:?} is not in deny.toml")),
        }
        match p["source"].as_str() {
            None | Some("registry+https://github.com/rust-lang/crates.io-index") => {}
            Some(s) => bad.push(format!("{name}: comes from {s}")),
        }
    }
    assert!(nodes.len() > 20, "only {} packages were seen", nodes.len());
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

/// Packages that a build of these takes, each with its features.
fn built(of: &[&str]) -> BTreeSet<String> {
    let out = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--prefix", "none", "--format", "{p} {f}"])
        .args(of)
        .current_dir(workspace())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).unwrap();
    text.lines().map(|l| l.trim_end_matches(" (*)").into()).collect()
}

/// See `crates/features`.
#[test]
fn one_set_of_features() {
    let tests = built(&["--workspace", "--edges", "normal,build,dev"]);
    for package in ["isoclay", "isoclay-python"] {
        let own = built(&["--package", package, "--edges", "normal,build"]);
        assert!(own.len() > 50, "{own:?}");
        let twice: Vec<_> = own.difference(&tests).collect();
        assert!(
            twice.is_empty(),
            "{package} has them with other features than the tests: {twice:#?}"
        );
    }
}

/// The keys in brackets that begin with one, as `[Hua04 eq. 12; Piegl97]`.
fn keys_cited(text: &str) -> BTreeSet<String> {
    let is_key = |word: &&str| {
        let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
        let mut chars = letters.chars();
        letters.len() + 2 == word.len()
            && letters.len() > 1
            && chars.next().is_some_and(|c| c.is_ascii_uppercase())
            && chars.all(|c| c.is_ascii_lowercase())
    };
    let brackets = text.split('[').skip(1).filter_map(|rest| rest.split(']').next());
    let words = brackets.filter_map(|inside| {
        let words: Vec<&str> = inside
            .split(|c: char| !c.is_alphanumeric())
            .filter(|w| !w.is_empty())
            .collect();
        words.first().is_some_and(is_key).then_some(words)
    });
    let keys = words.flatten().filter(is_key);
    keys.map(str::to_owned).collect()
}

/// Comments of Rust files and Markdown below a directory, generated files left out.
fn texts(directory: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && name != "target" {
                texts(&path, found);
            }
        } else if name.ends_with(".md") && name != "bibliography.md" {
            found.push(std::fs::read_to_string(&path).unwrap());
        } else if name.ends_with(".rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            let comments = text.lines().filter_map(|l| l.trim_start().strip_prefix("//"));
            found.push(comments.collect::<Vec<_>>().join("\n"));
        }
    }
}

#[test]
fn citations_and_bibliography_agree() {
    let mut found = Vec::new();
    for directory in ["crates", "docs"] {
        texts(&workspace().join(directory), &mut found);
    }
    found.push(std::fs::read_to_string(workspace().join("README.md")).unwrap());
    let cited: BTreeSet<String> = found.iter().flat_map(|t| keys_cited(t)).collect();
    let list = std::fs::read_to_string(workspace().join("docs/bibliography.md")).unwrap();
    let rows = list
        .lines()
        .filter_map(|l| l.strip_prefix("| ")?.split_once(" |"));
    let entries: BTreeSet<String> = rows
        .map(|(key, _)| key.to_owned())
        .filter(|k| k != "key" && k != "---")
        .collect();
    let unknown: Vec<_> = cited.difference(&entries).collect();
    let unused: Vec<_> = entries.difference(&cited).collect();
    assert!(
        unknown.is_empty(),
        "cited, but not in docs/bibliography.md: {unknown:?}"
    );
    assert!(
        unused.is_empty(),
        "in docs/bibliography.md, but cited nowhere: {unused:?}"
    );
    assert!(cited.len() > 20, "{cited:?}");
}
