//! What a careless or hostile world feeds the program: each case ends with a clear message that names the file,
//! or with a stated repair; never with a panic, a hang, or something half-written.

use std::fmt::Write as _;

use crate::common::{Bench, Run, data, number};

/// A cloud as text: `x y z nx ny nz` lines.
fn xyz(points: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> String {
    let mut text = String::new();
    for (p, n) in points {
        writeln!(text, "{} {} {} {} {} {}", p[0], p[1], p[2], n[0], n[1], n[2]).unwrap();
    }
    text
}

/// Points of the unit sphere with their normals, on a spiral.
fn sphere(count: usize) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
    (0..count).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (a, r) = (2.399963229728653 * i as f64, (1.0 - z * z).sqrt());
        let p = [r * a.cos(), r * a.sin(), z];
        (p, p)
    })
}

/// Fits `input` to `out.iclay`.
fn fit(bench: &Bench, input: &str) -> Run {
    bench.run(&format!("fit {input} -o out.iclay --json"))
}

/// The fit is refused with `code`, names the file, says `words`, and leaves nothing behind.
fn refused(bench: &Bench, input: &str, code: i32, words: &[&str]) {
    let before = bench.files();
    let run = fit(bench, input);
    assert_eq!(run.code, code, "{input}: {}{}", run.stdout, run.stderr);
    assert!(run.stderr.starts_with("isoclay: "), "{input}: {}", run.stderr);
    for word in words.iter().chain([&input.rsplit('/').next().unwrap()]) {
        assert!(
            run.stderr.contains(word),
            "{input}: no {word:?} in {}",
            run.stderr
        );
    }
    assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
    assert_eq!(bench.files(), before, "{input}: something was left behind");
}

#[test]
fn all_normals_zero() {
    let bench = Bench::new();
    bench.write("zero.xyz", xyz(sphere(500).map(|(p, _)| (p, [0.0; 3]))));
    refused(&bench, "zero.xyz", 3, &["normal", "zero"]);
}

#[test]
fn no_normals() {
    let bench = Bench::new();
    let text: String = sphere(500)
        .map(|(p, _)| format!("{} {} {}\n", p[0], p[1], p[2]))
        .collect();
    bench.write("bare.xyz", text);
    refused(&bench, "bare.xyz", 3, &["no normals", "--unoriented", "faces"]);
}

#[test]
fn all_points_equal() {
    let bench = Bench::new();
    bench.write(
        "equal.xyz",
        xyz((0..500).map(|_| ([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]))),
    );
    refused(&bench, "equal.xyz", 3, &["all 500 points"]);
}

#[test]
fn collinear_points() {
    let bench = Bench::new();
    bench.write(
        "line.xyz",
        xyz((0..500).map(|i| ([i as f64, 2.0 * i as f64, 0.0], [0.0, 0.0, 1.0]))),
    );
    refused(&bench, "line.xyz", 3, &["line"]);
}

#[test]
fn too_few_points() {
    let bench = Bench::new();
    bench.write("three.xyz", xyz(sphere(3)));
    refused(&bench, "three.xyz", 3, &["3", "needed"]);
}

/// The outlier is left out with a note, and the sphere is fitted as without it.
#[test]
fn one_outlier_far_away() {
    let bench = Bench::new();
    let outlier = std::iter::once(([1e7, 0.0, 0.0], [1.0, 0.0, 0.0]));
    bench.write("outlier.xyz", xyz(sphere(2000).chain(outlier)));
    let fitted = fit(&bench, "outlier.xyz").json();
    assert_eq!(number(&fitted, "used_count"), 2000.0);
    assert!(
        fitted["notes"].to_string().contains("1 of 2001 points left out"),
        "{}",
        fitted["notes"]
    );
    assert!(number(&fitted, "max") < 1e-3, "{fitted}");
    // A share of the diagonal is a share of the sphere's, not of the outlier's.
    let shared = bench
        .run("fit outlier.xyz -o out.iclay --tolerance 0.1% --json")
        .json();
    assert!(number(&shared, "tolerance") < 0.01, "{shared}");
}

/// Points that are not numbers are left out with a note.
#[test]
fn nan_points() {
    let bench = Bench::new();
    let odd = [
        ([f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ([0.0, f64::INFINITY, 0.0], [1.0, 0.0, 0.0]),
    ];
    bench.write("nan.xyz", xyz(sphere(2000).chain(odd)));
    let fitted = fit(&bench, "nan.xyz").json();
    assert_eq!(number(&fitted, "used_count"), 2000.0);
    assert!(fitted["notes"].to_string().contains('2'), "{}", fitted["notes"]);
    bench.write(
        "all-nan.xyz",
        xyz((0..50).map(|_| ([f64::NAN; 3], [1.0, 0.0, 0.0]))),
    );
    refused(&bench, "all-nan.xyz", 3, &[]);
}

#[test]
fn missing_empty_and_unknown_files() {
    let bench = Bench::new();
    refused(&bench, "nowhere.ply", 3, &["check the path"]);
    bench.write("empty.ply", "");
    refused(&bench, "empty.ply", 3, &["empty"]);
    bench.write("text.docx", "hello");
    refused(&bench, "text.docx", 3, &["not read here", ".nrrd"]);
    std::fs::create_dir(bench.path("folder.ply")).unwrap();
    refused(&bench, "folder.ply", 3, &["directory"]);
}

#[test]
fn truncated_files_at_many_lengths() {
    let bench = Bench::new();
    bench.json("phantom sphere -o whole.ply --count 400");
    for (name, bytes) in [
        ("cut.ply", std::fs::read(bench.path("whole.ply")).unwrap()),
        ("cut.obj.gz", std::fs::read(data("bunny.obj.gz")).unwrap()),
        ("cut.nii.gz", std::fs::read(data("head.nii.gz")).unwrap()),
    ] {
        for share in [0.02, 0.3, 0.7, 0.999] {
            bench.write(name, &bytes[..(bytes.len() as f64 * share) as usize]);
            refused(&bench, name, 3, &[]);
        }
    }
}

/// A damaged compressed file or field is refused wherever the bit is.
#[test]
fn flipped_bits() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 2000");
    bench.json("fit cloud.ply -o field.iclay --max-depth 6");
    let field = std::fs::read(bench.path("field.iclay")).unwrap();
    let cloud = std::fs::read(data("bunny.obj.gz")).unwrap();
    for i in 1..8 {
        let mut bytes = cloud.clone();
        bytes[cloud.len() * i / 8] ^= 0x10;
        bench.write("flipped.obj.gz", &bytes);
        refused(&bench, "flipped.obj.gz", 3, &[]);
        let mut bytes = field.clone();
        bytes[field.len() * i / 8] ^= 0x10;
        bench.write("flipped.iclay", &bytes);
        let run = bench.run("mesh flipped.iclay -o out.ply");
        assert_eq!(run.code, 3, "byte {}: {}", field.len() * i / 8, run.stderr);
        assert!(run.stderr.contains("flipped.iclay"), "{}", run.stderr);
        assert!(!bench.path("out.ply").exists());
    }
}

/// The header's word is not taken for the memory to set aside.
#[test]
fn a_header_that_promises_too_much() {
    let bench = Bench::new();
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 100000000000\nproperty float x\n\
                  property float y\nproperty float z\nend_header\n0123456789ab";
    bench.write("huge.ply", header);
    refused(&bench, "huge.ply", 3, &["100000000000"]);
}

#[test]
fn a_memory_ceiling_is_obeyed() {
    let bench = Bench::new();
    bench.json("phantom gyroid -o cloud.ply --count 50000");
    let run = bench.run("fit cloud.ply -o out.iclay --memory 8MiB");
    assert_eq!(run.code, 4, "{}", run.stderr);
    assert!(run.stderr.contains("--memory"), "{}", run.stderr);
    assert!(!bench.path("out.iclay").exists());
    let run = bench.run(&format!("fit {} -o out.iclay --memory 8MiB", data("head.nii.gz")));
    assert_eq!(run.code, 4, "{}", run.stderr);
    // What is advised is more than what was given, and suffices.
    let mut limit = 20;
    for attempt in 0.. {
        let run = bench.run(&format!(
            "fit cloud.ply -o out.iclay --max-depth 6 --memory {limit}MiB"
        ));
        if run.code == 0 {
            break;
        }
        let (_, advice) = run.stderr.split_once("raise --memory to ").expect("advice");
        let advised: u64 = advice.split_once("MiB").unwrap().0.parse().unwrap();
        assert!(advised > limit && attempt < 3, "{limit} MiB: {}", run.stderr);
        limit = advised;
    }
    let fitted = bench.json(&format!(
        "fit {} -o out.iclay --memory 256MiB",
        data("head.nii.gz")
    ));
    assert!(number(&fitted, "peak_rss_bytes") < 256.0 * 1048576.0, "{fitted}");
}

/// A NIfTI-1 volume of bytes.
fn nifti(dims: [i16; 3], values: &[u8]) -> Vec<u8> {
    let mut h = vec![0u8; 352];
    h[..4].copy_from_slice(&348i32.to_le_bytes());
    for (i, d) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        h[40 + 2 * i..42 + 2 * i].copy_from_slice(&d.to_le_bytes());
    }
    h[70..72].copy_from_slice(&2i16.to_le_bytes());
    h[72..74].copy_from_slice(&8i16.to_le_bytes());
    for i in 0..4 {
        h[76 + 4 * i..80 + 4 * i].copy_from_slice(&1f32.to_le_bytes());
    }
    h[108..112].copy_from_slice(&352f32.to_le_bytes());
    h[112..116].copy_from_slice(&1f32.to_le_bytes());
    h[344..348].copy_from_slice(b"n+1\0");
    h.extend_from_slice(values);
    h
}

#[test]
fn empty_and_constant_volumes() {
    let bench = Bench::new();
    bench.write("empty.nii", nifti([0, 4, 4], &[]));
    refused(&bench, "empty.nii", 3, &[]);
    bench.write("constant.nii", nifti([20, 18, 16], &[7; 20 * 18 * 16]));
    let fitted = fit(&bench, "constant.nii").json();
    assert!(number(&fitted, "max") < 1e-5, "{fitted}");
    // There is a field, but no surface in it; that is told at once.
    assert!(
        fitted["notes"].to_string().contains("no surface of its own"),
        "{fitted}"
    );
    let run = bench.run("mesh out.iclay -o out.ply");
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(
        run.stderr.contains("7.000000 all over") && !bench.path("out.ply").exists(),
        "{}",
        run.stderr
    );
}

/// A device that is always full: code 4, the path and what would help. (That an old file survives a disk that fills
/// at any byte is tested in `formats`, which can make such a disk.)
#[test]
fn a_full_disk() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 2000");
    bench.json("fit cloud.ply -o field.iclay");
    for (name, command) in [
        ("full.iclay", "fit cloud.ply -o full.iclay"),
        ("full.ply", "mesh field.iclay -o full.ply"),
        ("full.png", "picture field.iclay -o full.png --size 64x64"),
    ] {
        std::os::unix::fs::symlink("/dev/full", bench.path(name)).unwrap();
        let run = bench.run(command);
        assert_eq!(run.code, 4, "{command}: {}", run.stderr);
        assert!(
            run.stderr.contains(name) && run.stderr.contains("free some space"),
            "{command}: {}",
            run.stderr
        );
    }
}

/// Reports of several files, of which one meets a full disk: none of them is left, and old ones stay.
#[test]
fn a_full_disk_leaves_no_part_of_a_report() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 500");
    bench.json("fit cloud.ply -o field.iclay --max-depth 6");
    let region = "[region]\nmin = [-0.4, -0.4, 0.4]\nmax = [0.4, 0.4, 1.1]\nlevel = 0\n[time]\nduration = 0.02\nstep = 0.01\n";
    bench.write("scene.toml", format!("field = \"field.iclay\"\n{region}"));
    for (last, command) in [
        ("report.json", "check field.iclay cloud.ply -o out"),
        (
            "frame-00002.ply",
            "simulate scene.toml -o moved.iclay --frames out --every 1",
        ),
    ] {
        std::fs::create_dir(bench.path("out")).unwrap();
        bench.write("out/error.ply", "old");
        std::os::unix::fs::symlink("/dev/full", bench.path("out").join(last)).unwrap();
        let run = bench.run(command);
        assert_eq!(run.code, 4, "{command}: {}", run.stderr);
        assert!(
            run.stderr.contains(last) && run.stderr.contains("free some space"),
            "{command}: {}",
            run.stderr
        );
        let mut names: Vec<_> = std::fs::read_dir(bench.path("out"))
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        names.sort();
        assert_eq!(names, ["error.ply", last], "{command}");
        assert_eq!(std::fs::read(bench.path("out/error.ply")).unwrap(), b"old");
        assert!(!bench.path("moved.iclay").exists(), "{command}");
        std::fs::remove_dir_all(bench.path("out")).unwrap();
    }
    // A directory that was made for a report goes with it.
    let run = bench.run("check field.iclay nowhere.ply -o made/for/it");
    assert!(run.code == 3 && !bench.path("made").exists());
}

/// Ctrl-C in the middle of a fit: exit code 4, the old file as it was, nothing beside it.
#[test]
fn a_cancelled_fit() {
    use std::process::Stdio;
    use std::time::Duration;
    let bench = Bench::new();
    bench.json("phantom gyroid -o cloud.ply --count 400000");
    bench.write("out.iclay", "the old file");
    let before = bench.files();
    let arguments = "fit cloud.ply -o out.iclay --tolerance 1e-6 --precision f64 --threads 1";
    let child = bench
        .command()
        .args(arguments.split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Long enough to be at work, far from long enough to be done.
    std::thread::sleep(Duration::from_millis(700));
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    let run = Run::from(child.wait_with_output().unwrap());
    assert_eq!(run.code, 4, "{}{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("cancelled"), "{}", run.stderr);
    assert_eq!(
        std::fs::read_to_string(bench.path("out.iclay")).unwrap(),
        "the old file"
    );
    assert_eq!(bench.files(), before);
}

/// Number of processes whose working directory is `directory`, as far as the system tells.
fn at_work_in(directory: &std::path::Path) -> usize {
    let directory = directory.canonicalize().unwrap();
    std::fs::read_dir("/proc")
        .into_iter()
        .flatten()
        .flatten()
        .filter(|process| {
            let cwd = std::fs::read_link(process.path().join("cwd"));
            cwd.is_ok_and(|cwd| cwd == directory)
        })
        .count()
}

/// Ctrl-C at moments of a fixed sequence, in every command: exit code 4 wherever the work is, also where nothing looks
/// at a flag (`eval` waits for its input), and no half-written file. A command that was done before ends with 0.
#[test]
fn ctrl_c_ends_every_command() {
    use std::process::Stdio;
    use std::time::Duration;
    let bench = Bench::new();
    bench.json("phantom gyroid -o cloud.ply --count 150000");
    bench.json("phantom head -o head.nii --size 96");
    bench.json("fit cloud.ply -o field.iclay");
    bench.json("mesh field.iclay -o mesh.stl --resolution 150");
    std::fs::create_dir(bench.path("tmp")).unwrap();
    let before = bench.files();
    let mut draw = 0x2545_f491_4f6c_dd1du64;
    let mut cancelled = Vec::new();
    for command in [
        "fit cloud.ply -o out.iclay --tolerance 1e-6 --threads 1",
        "fit cloud.ply -o out.iclay --unoriented --threads 1",
        "fit cloud.ply -o out.iclay --robust --threads 1",
        "fit mesh.stl -o out.iclay --tolerance 0.0005% --threads 1",
        "fit head.nii -o out.iclay --tolerance 0.01% --threads 1",
        "mesh field.iclay -o out.ply --resolution 1000 --threads 1",
        "check field.iclay cloud.ply --threads 1",
        "sample field.iclay --like head.nii -o out.nii",
        "picture field.iclay -o out.png --size 2000x2000",
        "convert mesh.stl out.obj",
        "info mesh.stl",
        "phantom gyroid -o out.ply --count 3000000",
        "eval field.iclay --points -",
        // Fits in a hidden directory of the charts, and files of standard input and output in temporary ones.
        "charts hard sphere -o charts",
        "charts fit phantom:gyroid -o charts",
        "mesh field.iclay -o - --resolution 1000 --threads 1",
    ] {
        let mut child = bench
            .command()
            .args(command.split_whitespace())
            .env("TMPDIR", bench.path("tmp"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let open_input = child.stdin.take();
        draw = draw
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        std::thread::sleep(Duration::from_millis(100 + (draw >> 33) % 400));
        let pid = rustix::process::Pid::from_child(&child);
        // A process that has ended stays until it is waited for.
        rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
        let run = Run::from(child.wait_with_output().unwrap());
        drop(open_input);
        let written: Vec<String> = bench
            .files()
            .into_iter()
            .filter(|f| !before.contains(f))
            .collect();
        match run.code {
            0 => written.iter().map(|f| bench.path(f)).for_each(|f| {
                std::fs::remove_file(&f)
                    .or_else(|_| std::fs::remove_dir_all(&f))
                    .unwrap()
            }),
            4 => {
                assert!(run.stderr.contains("cancelled"), "{command}: {}", run.stderr);
                assert!(written.is_empty(), "{command}: left {written:?}");
                let kept = std::fs::read_dir(bench.path("tmp")).unwrap().count();
                assert_eq!(kept, 0, "{command}: temporary files are left");
                assert_eq!(at_work_in(&bench.path("")), 0, "{command}: a process goes on");
                cancelled.push(command);
            }
            other => panic!("{command}: code {other}: {}", run.stderr),
        }
    }
    assert!(
        cancelled.contains(&"eval field.iclay --points -") && cancelled.len() > 4,
        "only {cancelled:?}"
    );
}

/// Coordinates of a survey keep their millimetres from a cloud in text to the field, its values and its mesh.
#[test]
fn a_survey_keeps_its_millimetres() {
    let bench = Bench::new();
    let centre = [5_400_000.123, 3_500_000.456, 117.25];
    let count = 4000;
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\nend_header\n"
    );
    for (p, n) in sphere(count) {
        let [x, y, z] = [0, 1, 2].map(|a| centre[a] + p[a]);
        writeln!(text, "{x:.4} {y:.4} {z:.4} {} {} {}", n[0], n[1], n[2]).unwrap();
    }
    bench.write("survey.ply", text);
    let fitted = fit(&bench, "survey.ply").json();
    assert!(number(&fitted, "max") < 1e-3, "{fitted}");
    bench.json("mesh out.iclay -o mesh.ply --resolution 40");
    let mesh = formats::meshes::read(&bench.path("mesh.ply"), &formats::ReadLimits::default()).unwrap();
    for v in mesh.vertices {
        let r = v.distance(glam::DVec3::from_array(centre));
        assert!((r - 1.0).abs() < 2e-3, "a vertex at {v} lies {r} from the centre");
    }
    let [x, y, z] = centre;
    bench.write("at.xyz", format!("{} {y} {z}\n{} {y} {z}\n", x + 1.0, x + 0.99));
    let values = bench.run("eval out.iclay --points at.xyz");
    let value = |line: usize| -> f64 {
        let line = values
            .stdout
            .lines()
            .filter(|l| !l.starts_with(|c: char| c.is_alphabetic()))
            .nth(line)
            .unwrap();
        line.split([' ', ',', '\t']).nth(3).unwrap().parse().unwrap()
    };
    assert!(
        value(0).abs() < 1e-3 && (value(1) - 0.01).abs() < 1e-3,
        "{}",
        values.stdout
    );
    for name in ["out.xyz", "out2.ply", "out.pcd"] {
        bench.json(&format!("convert survey.ply {name}"));
        let back = formats::points::read(&bench.path(name), &formats::ReadLimits::default()).unwrap();
        for (p, (unit, _)) in back.positions.iter().zip(sphere(count)) {
            let wanted = glam::DVec3::from_array([0, 1, 2].map(|a| centre[a] + unit[a]));
            assert!(
                (*p - wanted).abs().max_element() < 1e-4,
                "{name}: {p} for {wanted}"
            );
        }
    }
}

/// Limits that cannot be kept, or that mean nothing, are refused or doubted in words.
#[test]
fn limits_that_cannot_be_kept() {
    let bench = Bench::new();
    bench.write("ball.xyz", xyz(sphere(3000)));
    for (options, words) in [
        ("--coefficients 20000", &["--coefficients 20000", "42875"][..]),
        ("--max-depth 3", &["--max-depth 3", "from 6 to 16"]),
    ] {
        let run = bench.run(&format!("fit ball.xyz -o out.iclay {options}"));
        assert_eq!(run.code, 2, "{options}: {}", run.stderr);
        assert!(words.iter().all(|w| run.stderr.contains(w)), "{}", run.stderr);
        assert!(!bench.path("out.iclay").exists());
    }
    let note =
        |options: &str| bench.json(&format!("fit ball.xyz -o out.iclay {options}"))["notes"].to_string();
    assert!(note("--tolerance 10").contains("larger than the object"));
    assert!(note("--tolerance 1e-9 --max-depth 6").contains("--precision f64"));
    assert!(!note("--tolerance 1e-9 --max-depth 6 --precision f64").contains("--precision"));
    assert!(!note("--tolerance 0.01").contains("--tolerance"));
    // Meshes and volumes are doubted alike.
    bench.write(
        "wedge.obj",
        "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    );
    bench.json("phantom head -o head.nii --size 16");
    for (input, large, words) in [
        ("wedge.obj --as mesh", "10", "larger than the object"),
        ("head.nii", "1e9", "larger than the range"),
    ] {
        let note = |options: &str| {
            bench.json(&format!("fit {input} -o out.iclay --tolerance {options}"))["notes"].to_string()
        };
        assert!(note(large).contains(words), "{input}: {}", note(large));
        assert!(
            note("1e-9 --coefficients 45000").contains("--precision f64"),
            "{input}"
        );
        assert!(!note("1e-9 --coefficients 45000 --precision f64").contains("--precision"));
        assert!(!note("1%").contains("--tolerance"), "{input}");
    }
    let fitted = bench.json("fit ball.xyz -o out.iclay --tolerance 1e-5 --coefficients 45000");
    assert!(number(&fitted, "coefficients") <= 45000.0, "{fitted}");
    assert!(
        fitted["notes"]
            .to_string()
            .contains("--coefficients leaves no room"),
        "{fitted}"
    );
}

/// The ceiling on memory holds in whatever phase: the peak stays within it, and the run ends with the field that there
/// is without it, with a note that says what it cost, or with exit code 4.
#[test]
fn memory_stays_below_its_ceiling() {
    let bench = Bench::new();
    bench.json("phantom gyroid -o clean.ply --count 300000");
    bench.json("phantom cup -o noisy.ply --count 120000 --noise 1%");
    bench.json("phantom head -o head.nii --size 128");
    bench.json("fit clean.ply -o field.iclay");
    bench.json("mesh field.iclay -o mesh.stl --resolution 120");
    // A list of a million corners in one face.
    let mut long =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uint uchar vertex_indices\nend_header\n"
            .to_vec();
    [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.]
        .iter()
        .for_each(|v| long.extend(v.to_le_bytes()));
    long.extend(6_000_000u32.to_le_bytes());
    long.extend((0..6_000_000u32).map(|i| (i % 4) as u8));
    bench.write("long.ply", long);
    let region =
        "[region]\nmin = [-0.8, -0.8, -0.8]\nmax = [0.8, 0.8, 0.8]\n[time]\nduration = 0.02\nstep = 0.01\n";
    let pull = "[[pull]]\nat = [0.0, 0.0, 0.0]\nradius = 0.1\nstrength = 1.0\n";
    bench.write("scene.toml", format!("field = \"field.iclay\"\n{region}{pull}"));
    for (command, limits) in [
        ("fit clean.ply -o out.iclay --tolerance 1e-4", &[128u64, 160][..]),
        ("fit clean.ply -o out.iclay --unoriented", &[128, 200]),
        ("fit clean.ply -o out.iclay --method offset-pairs", &[128]),
        ("fit clean.ply -o out.iclay --precision f64 --robust", &[128]),
        ("fit noisy.ply -o out.iclay", &[128]),
        ("fit noisy.ply -o out.iclay --unoriented=tagging", &[128]),
        ("fit mesh.stl -o out.iclay", &[128, 256]),
        ("fit head.nii -o out.iclay --tolerance 0.02%", &[128]),
        (
            "fit head.nii -o out.iclay --method interpolate --precision f64",
            &[128],
        ),
        ("mesh field.iclay -o out.ply --resolution 500", &[128, 200]),
        ("check field.iclay clean.ply", &[128]),
        ("info long.ply", &[128, 256]),
        ("convert long.ply out.stl --as mesh", &[200]),
        ("picture field.iclay -o out.png --size 3000x3000", &[128]),
        ("phantom gyroid -o out.ply --count 4000000", &[128]),
        (
            "sample field.iclay --like head.nii --spacing 1 -o out.nrrd",
            &[128],
        ),
        ("simulate scene.toml -o out.iclay --mesh out.ply", &[128]),
    ] {
        for &limit in limits {
            let (code, peak, said) = peak_of(&bench, &format!("{command} --memory {limit}MiB"));
            let bound = limit as f64 * 1.05 + 24.0;
            assert!(peak <= bound, "{command}: {peak:.0} MiB of {limit} (code {code})");
            assert!(
                code == 0 || code == 4,
                "{command} in {limit} MiB: code {code}: {said}"
            );
            // The last word is the program's own, wherever the memory ended.
            let refused = said.lines().last().unwrap_or_default();
            assert!(
                code == 0 || said.lines().count() == 1 && refused.contains("; raise"),
                "{command} in {limit} MiB: {said}"
            );
        }
    }
}

/// Exit code, largest resident size in MiB and messages of a run.
fn peak_of(bench: &Bench, command: &str) -> (i32, f64, String) {
    use std::process::Stdio;
    let mut child = bench
        .command()
        .args(command.split_whitespace())
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(bench.path("stderr")).unwrap())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0u64;
    let code = loop {
        // The mark only rises: the last look before the end has it, up to what the last millisecond added.
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        if let Some(line) = text.lines().find_map(|l| l.strip_prefix("VmHWM:")) {
            peak = line.trim().trim_end_matches("kB").trim().parse().unwrap();
        }
        if let Some(status) = child.try_wait().unwrap() {
            break status.code().expect("the program ends by itself");
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    };
    let said = std::fs::read_to_string(bench.path("stderr")).unwrap();
    (code, peak as f64 / 1024.0, said)
}
