//! The scripts of the gallery leave what they left when its pictures were drawn, to the bit.

use std::collections::BTreeMap;
use std::path::Path;

use super::common::{Bench, data};

/// Set to write down what the scripts leave now.
const RECORD: &str = "ISOCLAY_RECORD";

#[test]
fn scripts_of_the_gallery_leave_what_is_recorded() {
    let gallery = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/gallery");
    let bench = Bench::new();
    bench.json(&format!("fit {} -o bunny.iclay", data("bunny.obj.gz")));
    bench.json(&format!("fit {} -o head.iclay", data("head.nii.gz")));
    let mut scripts: Vec<_> = gallery
        .read_dir()
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    scripts.sort();
    let mut found = BTreeMap::new();
    for script in scripts {
        let name = script.file_stem().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&script).unwrap();
        let start = match text.lines().next().unwrap() {
            "# start: bunny" => "bunny.iclay",
            "# start: head" => "head.iclay",
            "# start: block" => "--box 48,40,16 --spacing 1 --unit mm",
            other => panic!("{name}: {other:?} does not say what the script starts from"),
        };
        bench.json(&format!("new {name}.isoclay {start}"));
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
