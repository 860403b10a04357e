//! The scripts of the gallery leave what they left when its pictures were drawn, to the bit.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::{Bench, data};

/// Set to write down what the scripts leave now.
const RECORD: &str = "ISOCLAY_RECORD";

#[test]
fn scripts_of_the_gallery_leave_what_is_recorded() {
    let gallery = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/gallery");
    let bench = Bench::new();
    bench.json(&format!("fit {} -o bunny.iclay", data("bunny.obj.gz")));
    bench.json(&format!("fit {} -o head.iclay", data("head.nii.gz")));
    let files = |ends: &str| {
        let all = gallery.read_dir().unwrap().map(|entry| entry.unwrap().path());
        let mut found: Vec<_> = all
            .filter(|path| path.extension().is_some_and(|e| e == ends))
            .collect();
        found.sort_by_key(|path| path.file_stem().unwrap().to_os_string());
        found
    };
    for cloud in files("xyz") {
        let name = cloud.file_stem().unwrap().to_string_lossy().into_owned();
        bench.json(&format!("fit {} --unoriented -o {name}.iclay", cloud.display()));
    }
    let mut found = BTreeMap::new();
    for script in files("toml") {
        let name = script.file_stem().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&script).unwrap();
        let start = text.lines().next().unwrap().strip_prefix("# start: ");
        let start = start.unwrap_or_else(|| panic!("{name} does not say what the script starts from"));
        // Another script, a field, or a block.
        let before = bench.path(&format!("{start}.isoclay"));
        if before.exists() {
            std::fs::copy(before, bench.path(&format!("{name}.isoclay"))).unwrap();
        } else if bench.path(&format!("{start}.iclay")).exists() {
            bench.json(&format!("new {name}.isoclay {start}.iclay"));
        } else {
            bench.json(&format!("new {name}.isoclay {start}"));
        }
        if let Some(tried) = text.lines().find_map(|line| line.strip_prefix("# tried: ")) {
            // Nothing is left of what was only shown.
            let bytes = || std::fs::read(bench.path(&format!("{name}.isoclay"))).unwrap();
            let before = bytes();
            bench.write("tried.toml", format!("[[stroke]]\n{tried}\n"));
            let told = bench.json(&format!(
                "sculpt {name}.isoclay --script tried.toml --preview tried.iclay"
            ));
            assert_ne!(told["changed"], serde_json::json!({}), "{name}: {told}");
            assert!(bytes() == before, "{name}");
        }
        let done = bench.json(&format!("sculpt {name}.isoclay --script {}", script.display()));
        assert!(done["done"].as_u64() >= Some(1), "{name}: {done}");
        found.insert(name, done["state_sha256"].as_str().unwrap().to_string());
    }
    let recorded = gallery.join("hashes.json");
    if std::env::var_os(RECORD).is_some() {
        let text = serde_json::to_string_pretty(&found).unwrap();
        std::fs::write(&recorded, text + "\n").unwrap();
    }
    let expected: BTreeMap<String, String> =
        serde_json::from_str(&std::fs::read_to_string(&recorded).unwrap()).unwrap();
    assert_eq!(
        found, expected,
        "if that is meant, set {RECORD}=1 and draw the gallery again"
    );
}
