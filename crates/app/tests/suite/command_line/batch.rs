//! `isoclay batch`: many inputs, of which some are bad, some hang and some are killed over.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, geteuid, kill_process};
use serde_json::Value;

use crate::common::{Bench, Run, number, sphere_text};

/// Options under which all fits here are quick.
const QUICK: &str = "--max-depth 6 --coefficients 50000";

/// Twenty inputs in the folder `scans`, of which `BROKEN` cannot be fitted, each for a reason of its own.
fn scans(bench: &Bench) {
    for folder in [
        "scans/clouds",
        "scans/again",
        "scans/volumes",
        "scans/stack",
        "scans/empty",
    ] {
        fs::create_dir_all(bench.path(folder)).unwrap();
    }
    for (i, solid) in ["sphere", "torus", "gyroid", "tetrahedron"].iter().enumerate() {
        let seed = i + 1;
        bench.json(&format!(
            "phantom {solid} -o scans/clouds/{solid}.ply --count 1500 --seed {seed}"
        ));
    }
    // The same name in another folder.
    bench.write(
        "scans/again/sphere.ply",
        fs::read(bench.path("scans/clouds/torus.ply")).unwrap(),
    );
    bench.write("scans/ball.xyz", sphere_text([1.0, 2.0, 3.0], 4.0, 900));
    bench.write(
        "scans/odd; name $(x) 'q\" <b>.xyz",
        sphere_text([0.0; 3], 1.0, 800),
    );
    bench.write("scans/list.txt", sphere_text([0.0; 3], 2.0, 700));
    bench.json("convert scans/clouds/torus.ply scans/torus.pcd");
    bench.json("phantom head -o scans/volumes/head.nii --size 16");
    bench.json("convert scans/volumes/head.nii scans/volumes/head.nrrd");
    bench.json("convert scans/volumes/head.nii scans/volumes/head.mha");
    bench.json(&format!("fit scans/ball.xyz -o ball.iclay {QUICK}"));
    bench.json("mesh ball.iclay -o scans/ball.stl --triangles 600");
    bench.json("mesh ball.iclay -o scans/ball.glb --triangles 500");
    // A series is one input.
    let series = Path::new(env!("CARGO_MANIFEST_DIR")).join("../formats/tests/data/dicom/ct");
    fs::create_dir(bench.path("scans/series")).unwrap();
    for file in fs::read_dir(series).unwrap().flatten() {
        fs::copy(file.path(), bench.path("scans/series").join(file.file_name())).unwrap();
    }
    // What is no scan.
    bench.write("scans/notes.docx", "some words");
    bench.write("scans/README.txt", "These scans were made\nin 3 days.\n");
    bench.write("scans/.hidden.ply", "ply\n");
    // What is broken.
    let ply = fs::read(bench.path("scans/clouds/gyroid.ply")).unwrap();
    bench.write("scans/cut.ply", &ply[..ply.len() / 2]);
    bench.write("scans/empty.ply", "");
    bench.write("scans/nan.xyz", "nan nan nan 0 0 1\n".repeat(100));
    bench.write("scans/wrong.nii", sphere_text([0.0; 3], 1.0, 50));
    bench.write("scans/words.stl", "no mesh at all");
}

const GOOD: usize = 15;
const BROKEN: [&str; 5] = ["cut.ply", "empty.ply", "nan.xyz", "words.stl", "wrong.nii"];

fn batch(bench: &Bench, arguments: &str) -> Run {
    bench.run(&format!("batch {arguments} {QUICK}"))
}

/// The objects that a batch with `--json` printed; the last is that of the whole.
fn objects(run: &Run) -> Vec<Value> {
    run.stdout
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect()
}

/// Content of all files below a directory that are to be the same for the same inputs.
fn results(directory: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for part in ["fields", "meshes", "pictures"] {
        for entry in fs::read_dir(directory.join(part)).into_iter().flatten() {
            let path = entry.unwrap().path();
            found.insert(
                path.strip_prefix(directory).unwrap().into(),
                fs::read(&path).unwrap(),
            );
        }
    }
    found
}

/// Entries of a manifest without what differs from run to run.
fn entries(manifest: &Path) -> Vec<Value> {
    let text = fs::read_to_string(manifest).unwrap();
    let lines = text.lines().map(|l| serde_json::from_str::<Value>(l).unwrap());
    let mut entries: Vec<Value> = lines.filter(|l| l.get("name").is_some()).collect();
    for e in &mut entries {
        for key in ["seconds", "peak_rss_bytes"] {
            e.as_object_mut().unwrap().remove(key);
        }
        for part in ["fit", "mesh"] {
            for key in ["seconds", "cpu_seconds", "peak_rss_bytes", "threads"] {
                if let Some(o) = e.get_mut(part).and_then(Value::as_object_mut) {
                    o.remove(key);
                }
            }
        }
    }
    entries
}

/// Names of what is in a directory, hidden things too.
fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> = (fs::read_dir(directory).unwrap())
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn bad_inputs_stop_nothing_and_are_named() {
    let bench = Bench::new();
    scans(&bench);
    let pipe = bench.path("pipe.xyz");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    bench.write(
        "secret.ply",
        fs::read(bench.path("scans/clouds/sphere.ply")).unwrap(),
    );
    fs::set_permissions(bench.path("secret.ply"), fs::Permissions::from_mode(0o0)).unwrap();
    std::os::unix::fs::symlink("moved away.ply", bench.path("scans/clouds/link.ply")).unwrap();
    // The superuser reads it all the same.
    let secret = usize::from(!geteuid().is_root());
    let run = batch(
        &bench,
        "scans pipe.xyz secret.ply nowhere.ply scans/empty gone/*.ply scans/*.stl -o out --mesh ply --jobs 2 --json",
    );
    assert_eq!(run.code, 3, "{}", run.stderr);
    let objects = objects(&run);
    let (whole, each) = objects.split_last().unwrap();
    let failed = BROKEN.len() + 5 + secret;
    assert_eq!(whole["failed"], failed, "{whole}");
    assert_eq!(whole["done"], GOOD + 1 - secret, "{whole}");
    assert_eq!(whole["pending"], 0);
    assert_eq!(whole["exit_code"], 3);
    assert!(whole["remedy"].as_str().unwrap().contains("--resume"));
    assert_eq!(each.len(), GOOD + 1 + BROKEN.len() + 5);
    for (i, e) in each.iter().enumerate() {
        assert_eq!(e["ended"], i + 1);
        assert_eq!(e["of"], each.len());
        assert!(
            e["seconds_left"].is_number() || e["seconds_left"].is_null(),
            "{e}"
        );
    }
    let reason = |name: &str| {
        let all = whole["failures"].as_array().unwrap().iter();
        let mut own = all.filter(|f| f["input"].as_str().unwrap().ends_with(name));
        let found = own.next().unwrap_or_else(|| panic!("{name} in {whole}"));
        found["reason"].as_str().unwrap().to_owned()
    };
    for (name, words) in [
        ("cut.ply", "ends too early"),
        ("empty.ply", "0 bytes"),
        ("nan.xyz", "not finite"),
        ("wrong.nii", "wrong.nii"),
        ("words.stl", "words.stl"),
        ("pipe.xyz", "is a pipe"),
        ("nowhere.ply", "check the path"),
        ("link.ply", "check the path"),
        ("scans/empty", "nothing that can be fitted"),
        ("gone/*.ply", "no file fits this pattern"),
    ] {
        assert!(reason(name).contains(words), "{name}: {}", reason(name));
    }
    assert!(
        run.stderr
            .contains(&format!("{failed} of {} inputs failed", each.len())),
        "{}",
        run.stderr
    );
    assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
    let skipped = whole["skipped"].to_string();
    for name in ["notes.docx", "README.txt"] {
        assert!(skipped.contains(name), "{skipped}");
    }

    let out = bench.path("out");
    assert_eq!(
        names(&out),
        [
            "fields",
            "manifest.jsonl",
            "meshes",
            "pictures",
            "report.html",
            "summary.csv",
            "summary.json"
        ]
    );
    let results = results(&out);
    let ending = |e: &str| {
        results
            .keys()
            .filter(|p| p.to_str().unwrap().ends_with(e))
            .count()
    };
    let good = GOOD + 1 - secret;
    assert_eq!(
        (ending(".iclay"), ending(".ply"), ending(".errors.png")),
        (good, good, good)
    );
    let both = results
        .keys()
        .filter(|p| p.to_str().unwrap().starts_with("fields/sphere.ply-"));
    assert_eq!(both.count(), 2, "two inputs of one name");

    // The summary tells what the fits told, and each file's own content.
    let summary: Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    for e in summary["entries"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|e| e["state"] == "done")
    {
        assert!(number(&e["fit"], "rms") <= number(&e["fit"], "max"), "{e}");
        assert!(number(e, "seconds") > 0.0 && number(e, "peak_rss_bytes") > 1e6);
        let field = out.join(e["outputs"]["field"]["path"].as_str().unwrap());
        let info = bench.json(&format!("info {}", field.display()));
        assert_eq!(info["field_sha256"], e["fit"]["field_sha256"]);
        assert_eq!(info["rms"], e["fit"]["rms"]);
    }
    let csv = fs::read_to_string(out.join("summary.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + each.len());
    assert!(
        csv.contains("\"scans/odd; name $(x) 'q\"\" <b>.xyz\",done"),
        "{csv}"
    );
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!report.contains("<b>.xyz") && report.contains("\\u003cb\\u003e.xyz"));

    // The same as single fits, to the bit.
    bench.json(&format!("fit scans/clouds/torus.ply -o single.iclay {QUICK}"));
    let (_, field) = results
        .iter()
        .find(|(p, _)| p.to_str().unwrap().starts_with("fields/torus.ply-"))
        .unwrap();
    let info = bench.json("info single.iclay");
    bench.write("copy.iclay", field);
    assert_eq!(
        bench.json("info copy.iclay")["field_sha256"],
        info["field_sha256"]
    );

    // Nothing is done twice, nothing is lost, and what is bad by itself is not tried again.
    let before = entries(&out.join("manifest.jsonl"));
    let again = batch(&bench, "scans -o out --mesh ply");
    assert_eq!(again.code, 2);
    assert!(again.stderr.contains("--resume"), "{}", again.stderr);
    let again = batch(
        &bench,
        "scans pipe.xyz secret.ply nowhere.ply scans/empty gone/*.ply scans/*.stl -o out --mesh ply --resume --json",
    );
    let objects = self::objects(&again);
    assert_eq!(objects.last().unwrap()["kept"], good + BROKEN.len());
    assert_eq!(entries(&out.join("manifest.jsonl")), before);
    assert_eq!(self::results(&out), results);

    // A result that was touched, an input that was mended, and another option are done anew.
    let touched = out.join(results.keys().next().unwrap());
    fs::write(&touched, "spoilt").unwrap();
    bench.write(
        "scans/empty.ply",
        fs::read(bench.path("scans/clouds/sphere.ply")).unwrap(),
    );
    let mended = batch(&bench, "scans -o out --mesh ply --resume --json");
    let objects = self::objects(&mended);
    // All but the one that was mended, and the link.
    assert_eq!(objects.last().unwrap()["failed"], BROKEN.len());
    assert_eq!(objects.last().unwrap()["kept"], GOOD - 1 + BROKEN.len() - 1);
    assert_eq!(
        fs::read(&touched).unwrap(),
        results[touched.strip_prefix(&out).unwrap()]
    );
}

/// A batch under way, and the lines of its standard output.
fn start(bench: &Bench, arguments: &str) -> (Child, impl Iterator<Item = Value> + use<>) {
    let mut child = bench
        .command()
        .args(format!("batch {arguments}").split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    (child, lines.map_while(|l| serde_json::from_str(&l.ok()?).ok()))
}

/// Processes that another has started.
fn children(parent: u32) -> Vec<Pid> {
    let is_child = |status: String| {
        let line = status.lines().find_map(|l| l.strip_prefix("PPid:"));
        line.is_some_and(|l| l.trim() == parent.to_string())
    };
    let all = fs::read_dir("/proc").unwrap().flatten();
    all.filter_map(|e| e.file_name().to_str()?.parse().ok())
        .filter(|pid| fs::read_to_string(format!("/proc/{pid}/status")).is_ok_and(is_child))
        .filter_map(Pid::from_raw)
        .collect()
}

/// Whether a process is there, and not just waiting for its end to be noticed.
fn is_alive(p: &Pid) -> bool {
    fs::read_to_string(format!("/proc/{}/status", p.as_raw_nonzero()))
        .is_ok_and(|s| !s.lines().any(|l| l.starts_with("State:") && l.contains('Z')))
}

fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "{what} did not come");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Killed again and again, at moments spread over the work, a batch ends as if nothing had been; its processes die with
/// it, and what they had begun goes away.
#[test]
fn killed_and_resumed_it_is_the_same_to_the_bit() {
    let bench = Bench::new();
    scans(&bench);
    assert_eq!(batch(&bench, "scans -o whole --jobs 2").code, 3);
    let total = GOOD + BROKEN.len();
    let arguments = format!("scans -o out --jobs 2 --json --resume {QUICK}");
    let mut kills = 0;
    loop {
        let (mut child, mut lines) = start(&bench, &arguments);
        // So many new results, then a while that is another each time.
        let mut fresh = 0;
        let last = loop {
            let Some(line) = lines.next() else { break None };
            if line.get("of").is_none() {
                break Some(line);
            }
            fresh += usize::from(line["kept"] == false);
            if fresh > 1 + kills % 3 {
                std::thread::sleep(Duration::from_millis(7 * kills as u64 % 40));
                break None;
            }
        };
        if let Some(whole) = last {
            assert_eq!(child.wait().unwrap().code(), Some(3));
            assert!(whole["kept"].as_u64().unwrap() > 2, "{whole}");
            break;
        }
        let own = children(child.id());
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        assert!(kills <= total, "it never ends");
        wait_for("the end of its processes", || {
            (!own.iter().any(is_alive)).then_some(())
        });
    }
    assert!(kills >= 3, "killed {kills} times only");
    let (whole, out) = (bench.path("whole"), bench.path("out"));
    assert_eq!(results(&out), results(&whole));
    assert_eq!(
        entries(&out.join("manifest.jsonl")),
        entries(&whole.join("manifest.jsonl"))
    );
    assert_eq!(names(&out), names(&whole), "something was left behind");
}

/// Ctrl-C ends the batch and all that it started, with exit code 4, and it can go on.
#[test]
fn a_cancel_ends_all_and_leaves_what_can_be_resumed() {
    let bench = Bench::new();
    scans(&bench);
    let (mut child, mut lines) = start(&bench, &format!("scans -o out --jobs 2 --json {QUICK}"));
    lines.next().unwrap();
    let own = wait_for("a process of its own", || {
        Some(children(child.id())).filter(|c| !c.is_empty())
    });
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let rest: Vec<Value> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(4));
    let last = rest.last().unwrap();
    assert_eq!(last["exit_code"], 4, "{last}");
    assert!(!own.iter().any(is_alive));
    assert!(
        !names(&bench.path("out")).iter().any(|n| n.starts_with('.')),
        "{:?}",
        names(&bench.path("out"))
    );
    let run = batch(&bench, "scans -o out --resume --json");
    assert!(objects(&run).last().unwrap()["kept"].as_u64().unwrap() >= 1);
    assert_eq!(run.code, 3);
}

/// A file that takes minutes to read, and no room on the disk.
#[test]
fn the_time_limit_is_one_for_reading_too() {
    let bench = Bench::new();
    let huge = fs::File::create(bench.path("huge.stl")).unwrap();
    huge.set_len(1 << 37).unwrap();
    let run = batch(&bench, "huge.stl -o out --json --no-report --time-limit 1s");
    assert_eq!(run.code, 3, "{}", run.stderr);
    let told = objects(&run);
    let failure = &told.last().unwrap()["failures"][0];
    assert!(
        failure["reason"].as_str().unwrap().contains("--time-limit"),
        "{failure}"
    );
}

/// A fit that hangs, and one that falls, are each one failure; the others are done.
#[test]
fn hangs_and_crashes_are_failures_like_others() {
    let bench = Bench::new();
    bench.json("phantom sphere -o b.ply --count 800");
    bench.json("phantom gyroid -o a.ply --count 150000");
    for (signal, time, words, code) in [
        (Signal::STOP, "4s", "--time-limit", None),
        (Signal::ABORT, "2h", "signal 6", Some(6)),
        (Signal::KILL, "2h", "memory", Some(9)),
    ] {
        let (mut child, lines) = start(
            &bench,
            &format!("a.ply b.ply -o out --jobs 1 --json --no-report --resume --time-limit {time}"),
        );
        // Not before it is the program: what stops between fork and exec stops whoever starts it.
        let is_fit = |p: &Pid| {
            fs::read(format!("/proc/{}/cmdline", p.as_raw_nonzero()))
                .is_ok_and(|line| line.split(|b| *b == 0).any(|word| word == b"fit"))
        };
        let fit = wait_for("the fit", || children(child.id()).into_iter().find(is_fit));
        kill_process(fit, signal).unwrap();
        let lines: Vec<Value> = lines.collect();
        assert_eq!(child.wait().unwrap().code(), Some(3));
        let whole = lines.last().unwrap();
        assert_eq!(
            (&whole["done"], &whole["failed"]),
            (&1.into(), &1.into()),
            "{whole}"
        );
        let reason = whole["failures"][0]["reason"].as_str().unwrap();
        assert!(reason.contains(words), "{reason}");
        let manifest = entries(&bench.path("out/manifest.jsonl"));
        assert_eq!(manifest[0]["failure"]["signal"].as_i64(), code);
    }
}

/// No process holds more than its share, and what needs more fails alone or ends coarser.
#[test]
fn the_memory_is_shared_out() {
    let bench = Bench::new();
    bench.json("phantom gyroid -o large.ply --count 400000");
    bench.json("phantom sphere -o small.ply --count 500");
    let run = bench.run("batch large.ply small.ply -o out --jobs 2 --memory 220MiB --no-report --json");
    let summary: Value = serde_json::from_slice(&fs::read(bench.path("out/summary.json")).unwrap()).unwrap();
    // A fit that is refused for its share of the memory has no peak.
    let entries = summary["entries"].as_array().unwrap().iter();
    let peaks: Vec<f64> = entries.filter_map(|e| e["peak_rss_bytes"].as_f64()).collect();
    assert!(!peaks.is_empty(), "{summary}");
    let peak: f64 = peaks.iter().sum();
    assert!(peak < f64::from(220 << 20), "{peak}: {summary}");
    assert_eq!(summary["entries"][1]["state"], "done", "{}", run.stderr);
    let large = summary["entries"][0].to_string();
    assert!(large.contains("memory"), "{large}");
}

/// Shares done apart and joined are the whole.
#[test]
fn shards_joined_are_the_whole() {
    let bench = Bench::new();
    scans(&bench);
    assert_eq!(batch(&bench, "scans -o whole --mesh stl").code, 3);
    let run = batch(&bench, "scans -o out --shard 3/3 --mesh stl --json");
    assert!(matches!(run.code, 0 | 3), "{}", run.stderr);
    assert!(!bench.path("out/report.html").exists(), "a part of a report");
    batch(&bench, "scans -o out --shard 1/3 --mesh stl");
    let early = bench.run("batch --merge out --json");
    assert_eq!(early.code, 3);
    assert!(early.stdout.contains("shards not there: 2/3"), "{}", early.stdout);
    let pending = objects(&early).last().unwrap()["pending"].as_u64().unwrap();
    assert!((6..=7).contains(&pending), "{pending}");
    batch(&bench, "./scans/ -o out --shard 2/3 --mesh stl");
    let merged = bench.run("batch --merge out --json");
    assert_eq!(merged.code, 3);
    assert_eq!(objects(&merged).last().unwrap()["failed"], BROKEN.len());
    let (whole, out) = (bench.path("whole"), bench.path("out"));
    assert_eq!(results(&out), results(&whole));
    assert_eq!(
        entries(&out.join("manifest.jsonl")),
        entries(&whole.join("manifest.jsonl"))
    );
    assert!(out.join("report.html").exists());

    // Of another batch.
    batch(&bench, "scans -o out --shard 2/3 --resume");
    let mixed = bench.run("batch --merge out");
    assert_eq!(mixed.code, 3);
    assert!(mixed.stderr.contains("different batches"), "{}", mixed.stderr);
}

/// Names that no program likes: they are read, and lead nowhere but into the directory.
#[test]
fn hostile_names_stay_names() {
    let bench = Bench::new();
    let text = sphere_text([0.0; 3], 1.0, 300);
    let directory = bench.path("in");
    fs::create_dir_all(directory.join("up..")).unwrap();
    let hostile: [&[u8]; 9] = [
        b"<script>alert(1)<script>.xyz",
        b"--json.xyz",
        b"-o.xyz",
        b"new\nline.xyz",
        b"bell\x07\x1b[2J.xyz",
        b"not\xfftext.xyz",
        b"javascript:alert(1).xyz",
        b"%2e%2e%2f.xyz",
        b"up../x..xyz",
    ];
    for name in hostile {
        fs::write(directory.join(std::ffi::OsStr::from_bytes(name)), &text).unwrap();
    }
    let run = bench
        .command()
        .current_dir(&directory)
        .args([
            "batch",
            "-o",
            "../out",
            "--json",
            "--max-depth",
            "6",
            "--",
            ".",
            "--json.xyz",
        ])
        .output()
        .unwrap();
    let run = Run::from(run);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(!run.stderr.contains('\x1b') && !run.stderr.contains('\x07'));
    assert_eq!(objects(&run).last().unwrap()["done"], hostile.len());
    let results = results(&bench.path("out"));
    assert_eq!(results.len(), 3 * hostile.len());
    for path in results.keys() {
        let name = path.file_name().unwrap().to_str().unwrap();
        assert!(
            name.bytes()
                .all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b)),
            "{name}"
        );
    }
    assert_eq!(bench.files(), ["in", "out"]);
}

/// One batch at a time in a directory.
#[test]
fn a_directory_belongs_to_one_batch() {
    let bench = Bench::new();
    bench.json("phantom gyroid -o a.ply --count 200000");
    let (mut child, lines) = start(&bench, "a.ply -o out --json --no-report");
    wait_for("the fit", || children(child.id()).first().copied());
    let second = bench.run("batch a.ply -o out --resume");
    assert_eq!(second.code, 4, "{}", second.stderr);
    assert!(second.stderr.contains("another batch"), "{}", second.stderr);
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    drop(lines);
    assert_eq!(child.wait().unwrap().code(), Some(4));
    assert_eq!(bench.run("batch a.ply -o a.ply").code, 2);
    assert_eq!(bench.run("batch - -o out2").code, 2);
}

/// Directories in which results are made are gone when a reason is read.
#[test]
fn reasons_name_no_passing_directory() {
    let bench = Bench::new();
    let head = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 8 8 8\nspacings: 1 1 1\nencoding: ascii\n\n";
    bench.write("flat.nrrd", format!("{head}{}", "7 ".repeat(512)));
    let run = batch(&bench, "flat.nrrd -o out --mesh ply --json");
    assert_eq!(run.code, 3, "{}", run.stderr);
    let objects = objects(&run);
    let reason = objects.last().unwrap()["failures"][0]["reason"].as_str().unwrap();
    assert!(
        reason.starts_with("flat.nrrd") && reason.contains("all over"),
        "{reason}"
    );
}
