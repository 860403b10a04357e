//! The grammar of the command line, its exit codes, and what goes to stdout.

mod batch;
mod coarse;
mod devices;
mod documents;
mod feel;
mod gallery;
mod meshes;
mod strokes;
mod turntable;

use std::io::{Read, Write};
use std::process::Stdio;

use crate::common::{Bench, data, number, wrong_values};

#[test]
fn wrong_usage_ends_with_code_2_and_a_remedy() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 500");
    let bunny = data("bunny.obj.gz");
    let head = data("head.nii.gz");
    for (arguments, word) in [
        ("", "Usage"),
        ("fit", "--output"),
        ("fit cloud.ply", "--output"),
        ("fit cloud.ply -o out.iclay --tolerance 1cm", "0.2mm"),
        ("fit cloud.ply -o out.iclay --tolerance -1", "above zero"),
        ("fit cloud.ply -o out.iclay --tolerance 1mm", "--unit"),
        ("fit cloud.ply -o out.iclay --memory 2Gib", "2GiB"),
        ("fit cloud.ply -o out.iclay --threads 0", "1 to 1024"),
        ("fit cloud.ply -o out.iclay --method exact", "interpolate"),
        ("fit cloud.ply -o out.iclay --method interpolate", "volumes"),
        ("fit cloud.ply -o out.iclay --unit inch", "mm, cm or m"),
        ("fit cloud.ply -o out.iclay --unoriented=guess", "tagging"),
        (&format!("fit {head} -o out.iclay --unoriented"), "point clouds"),
        ("fit cloud.ply -o out.txt", ".iclay"),
        ("fit cloud.ply -o nowhere/out.iclay", "no directory"),
        (&format!("fit {head} -o out.iclay --tolerance 1mm"), "density"),
        (&format!("fit {head} -o out.iclay --unit cm"), "mm"),
        (&format!("fit {head} -o out.iclay --robust"), "point clouds"),
        (
            &format!("fit {head} -o out.iclay --method offset-pairs"),
            "adaptive",
        ),
        (
            &format!("fit {head} -o out.iclay --method interpolate --tolerance 1"),
            "interpolating",
        ),
        (&format!("fit {bunny} -o ."), "directory"),
        (&format!("fit {head} -o out.iclay --as mesh"), "--as"),
        ("mesh field.iclay -o out.stp", ".ply"),
        (
            "mesh field.iclay -o out.ply --resolution 8 --tolerance 1",
            "cannot be used with",
        ),
        ("mesh field.iclay -o out.ply --iso nan", "finite"),
        ("phantom cube -o out.ply", "sphere"),
        ("charts", "fit"),
    ] {
        let run = bench.run(arguments);
        assert_eq!(run.code, 2, "{arguments}: {}{}", run.stdout, run.stderr);
        assert!(
            run.stderr.contains(word),
            "{arguments}: no {word:?} in {}",
            run.stderr
        );
    }
    assert_eq!(bench.files(), ["cloud.ply"]);
}

#[test]
fn help_names_every_subcommand_and_the_exit_codes() {
    let bench = Bench::new();
    let run = bench.run("--help");
    assert_eq!(run.code, 0);
    let words = [
        "fit",
        "mesh",
        "sample",
        "eval",
        "info",
        "check",
        "phantom",
        "picture",
        "charts",
        "Exit codes",
    ];
    for word in words {
        assert!(run.stdout.contains(word), "{word}");
        if word.chars().all(char::is_lowercase) {
            assert_eq!(bench.run(&format!("{word} --help")).code, 0, "{word}");
        }
    }
    assert!(bench.run("--version").stdout.starts_with("isoclay "));
}

#[test]
fn json_has_the_promised_fields() {
    let bench = Bench::new();
    bench.json("phantom torus -o cloud.ply --count 3000");
    let fit = bench.json("fit cloud.ply -o field.iclay --threads 1 --unit cm --tolerance 1mm");
    for key in [
        "input_count",
        "coefficients",
        "totals_bytes",
        "bricks",
        "depth",
        "rms",
        "p95",
        "max",
        "bound",
        "seconds",
        "cpu_seconds",
        "peak_rss_bytes",
    ] {
        assert!(number(&fit, key) > 0.0, "{key} in {fit}");
    }
    assert_eq!(number(&fit, "threads"), 1.0);
    assert_eq!(
        number(&fit, "tolerance"),
        0.1,
        "a millimetre is a tenth of a centimetre"
    );
    assert_eq!(fit["unit"], "cm");
    assert_eq!(fit["field_sha256"].as_str().unwrap().len(), 64);
    assert!(number(&fit, "bound") >= number(&fit, "rms"));
    let info = bench.json("info field.iclay");
    assert_eq!(info["field_sha256"], fit["field_sha256"]);
    assert_eq!(info["coefficients"], fit["coefficients"]);
    assert_eq!(info["rms"], fit["rms"]);
    let table = bench.run("info field.iclay");
    assert!(table.code == 0 && table.stdout.contains("coefficients") && table.stderr.is_empty());
}

#[test]
fn eval_answers_each_point_in_order_from_file_and_stdin() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 3000");
    bench.json("fit cloud.ply -o field.iclay");
    let mut points = String::new();
    for i in 0..5000 {
        let t = i as f64 * 1e-3;
        points += &format!("{} {} {}\n", 0.9 * t.cos(), 0.9 * t.sin(), 0.05 * t);
    }
    bench.write("points.xyz", &points);
    let run = bench.run("eval field.iclay --points points.xyz");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let mut lines = run.stdout.lines();
    assert_eq!(lines.next(), Some("x,y,z,value,gx,gy,gz"));
    let mut count = 0;
    for (line, point) in lines.zip(points.lines()) {
        let v: Vec<f64> = line.split(',').map(|w| w.parse().unwrap()).collect();
        let p: Vec<f64> = point.split(' ').map(|w| w.parse().unwrap()).collect();
        assert_eq!(v.len(), 7);
        assert_eq!(v[..3], p[..], "points come back as they were");
        let r = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        assert!((v[3] - (1.0 - r)).abs() < 0.01, "distance {} at radius {r}", v[3]);
        assert!(
            (0..3).all(|a| (v[4 + a] + p[a] / r).abs() < 0.1),
            "gradient in {line}"
        );
        count += 1;
    }
    assert_eq!(count, 5000);
    let mut child = bench
        .command()
        .args(["eval", "field.iclay", "--points", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(points.as_bytes()).unwrap();
    assert_eq!(
        String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap(),
        run.stdout
    );
    bench.write("nan.xyz", "0 0 0\nnan 0 0\n");
    let run = bench.run("eval field.iclay --points nan.xyz");
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("1 of 2 points"), "{}", run.stderr);
}

/// A reader that goes away ends the program quietly.
#[test]
fn a_broken_pipe_is_no_panic() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 3000");
    bench.json("fit cloud.ply -o field.iclay");
    bench.write("points.xyz", "0.5 0.5 0.5\n".repeat(100_000));
    let mut child = bench
        .command()
        .args(["eval", "field.iclay", "--points", "points.xyz"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0; 64];
    let mut stdout = child.stdout.take().unwrap();
    stdout.read_exact(&mut first).unwrap();
    drop(stdout);
    let out = child.wait_with_output().unwrap();
    assert!(out.stderr.is_empty(), "{}", String::from_utf8_lossy(&out.stderr));
    assert_eq!(out.status.code(), Some(0));
}

#[test]
fn same_bits_with_1_and_2_threads() {
    let bench = Bench::new();
    bench.json("phantom tetrahedron -o cloud.ply --noise 0.2%");
    for input in ["cloud.ply", &data("head.nii.gz")] {
        for n in [1, 2, 4] {
            bench.json(&format!("fit {input} -o {n}.iclay --threads {n}"));
            bench.json(&format!(
                "mesh {n}.iclay -o {n}.ply --threads {n} --resolution 64"
            ));
        }
        for n in [2, 4] {
            let field = |n| bench.json(&format!("info {n}.iclay"))["field_sha256"].clone();
            assert_eq!(field(1), field(n), "{input} with {n} threads");
            let mesh = |n: i32| std::fs::read(bench.path(&format!("{n}.ply"))).unwrap();
            assert!(mesh(1) == mesh(n), "{input}: meshes with {n} threads differ");
        }
    }
}

/// A mesh is fitted by its faces where the file holds nothing else or the user says so, and checked against them.
#[test]
fn a_mesh_is_fitted_as_the_solid_that_it_bounds() {
    let bench = Bench::new();
    let vertices = "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 2 1 0\nv 0 0 1\nv 2 0 1\nv 0 1 1\nv 2 1 1\n";
    // The last two triangles, of the side x = 2, face the wrong way.
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 4 2 6 8\n";
    std::fs::write(bench.path("box.obj"), format!("{vertices}{faces}")).unwrap();
    let fit = bench.json("fit box.obj --as mesh --tolerance 1% -o box.iclay");
    assert_eq!(fit["defects"]["flipped_faces"], 2);
    let tolerance = number(&fit, "tolerance");
    assert!(number(&fit, "max") <= tolerance);
    let check = bench.json("check box.iclay box.obj --as mesh");
    assert_eq!(check["wrong_signs"], 0);
    // At a right-angled corner the distance grows by 1/√3 of the way.
    assert!(number(&check, "p95") <= tolerance && number(&check, "max") <= 1.8 * tolerance);
    assert!(number(&check, "back_max") <= tolerance);
    bench.json("mesh box.iclay -o box.stl --resolution 16");
    let again = bench.json("fit box.stl --tolerance 1% -o again.iclay");
    assert_eq!(again["defects"]["boundary_edges"], 0);
    assert_eq!(
        bench.run("fit box.obj -o out.iclay --as mesh --smoothing 1").code,
        2
    );
}

/// What the fit says of a field, what the field remembers, and what is measured again are the same figures, to the bit.
#[test]
fn fit_info_and_check_agree() {
    let bench = Bench::new();
    bench.json("phantom cup -o clean.ply --count 9000");
    bench.json("phantom cup -o noisy.ply --count 9000 --noise 1%");
    bench.json("phantom head -o head.nii --size 40 --noise 2%");
    bench.json("fit clean.ply -o field.iclay");
    bench.json("mesh field.iclay -o smooth.stl --resolution 40");
    let corners = "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 2 1 0\nv 0 0 1\nv 2 0 1\nv 0 1 1\nv 2 1 1\n";
    // A box, and the same again across it: creases, crossings, inner walls.
    let crossed = "v 1 -1 .2\nv 3 -1 .2\nv 1 .5 .2\nv 3 .5 .2\nv 1 -1 .7\nv 3 -1 .7\nv 1 .5 .7\nv 3 .5 .7\n";
    let faces = |first: usize| {
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        quads.map(|q| {
            format!(
                "f {} {} {} {}\n",
                q[0] + first,
                q[1] + first,
                q[2] + first,
                q[3] + first
            )
        })
    };
    let sharp = format!("{corners}{crossed}{}{}", faces(1).concat(), faces(9).concat());
    std::fs::write(bench.path("sharp.obj"), sharp).unwrap();
    for (input, options) in [
        ("smooth.stl", "--tolerance 0.1%"),
        ("smooth.stl", "--coefficients 60000"),
        ("sharp.obj --as mesh", "--tolerance 0.2%"),
        ("sharp.obj --as mesh", "--coefficients 70000 --precision f64"),
        ("clean.ply", ""),
        ("clean.ply", "--tolerance 1e-5 --max-depth 7"),
        ("clean.ply", "--coefficients 50000 --precision f64"),
        ("clean.ply", "--unoriented"),
        ("clean.ply", "--method offset-pairs"),
        ("noisy.ply", ""),
        ("noisy.ply", "--robust"),
        ("noisy.ply", "--unoriented --robust"),
        ("head.nii", ""),
        ("head.nii", "--tolerance 2%"),
        ("head.nii", "--coefficients 3000"),
        ("head.nii", "--smoothing 0.5 --precision f64"),
        ("head.nii", "--method interpolate"),
    ] {
        let fit = bench.json(&format!("fit {input} -o field.iclay {options}"));
        let info = bench.json("info field.iclay");
        let check = bench.json(&format!("check field.iclay {input}"));
        let told = fit["notes"].to_string();
        let spent = ["coefficients allowed are spent", "--coefficients leaves no room"];
        let count: usize = spent.iter().map(|words| told.matches(words).count()).sum();
        assert!(count <= 1, "{input} {options}: {told}");
        for key in [
            "input_count",
            "used_count",
            "coefficients",
            "rms",
            "p95",
            "max",
            "bound",
            "leaves",
        ] {
            let value = number(&fit, key);
            assert_eq!(value, number(&info, key), "{input} {options}: {key} of info");
            assert_eq!(value, number(&check, key), "{input} {options}: {key} of check");
        }
        assert_eq!(
            fit["leaves_over_tolerance"], check["leaves_over_tolerance"],
            "{input} {options}"
        );
        assert_eq!(
            fit["leaves_over_tolerance"], info["leaves_over_tolerance"],
            "{input} {options}"
        );
        assert!(
            number(&fit, "bound") >= number(&fit, "max"),
            "{input} {options}: {fit}"
        );
    }
}

/// A field is not measured against what it was not fitted to, unless that is asked for.
#[test]
fn check_refuses_what_does_not_belong_together() {
    let bench = Bench::new();
    bench.json("phantom sphere -o ball.ply --count 3000");
    bench.json("phantom sphere -o other.ply --count 3000 --seed 2");
    bench.json("phantom head -o head.nii --size 24");
    bench.json("phantom head -o noisy.nii --size 24 --noise 1%");
    bench.json("fit ball.ply -o ball.iclay");
    bench.json("fit head.nii -o head.iclay");
    for (field, input, word) in [
        ("ball.iclay", "other.ply", "other samples"),
        ("ball.iclay", "head.nii", "fitted to a cloud"),
        ("head.iclay", "noisy.nii", "other samples"),
        ("head.iclay", "ball.ply", "fitted to a volume"),
        ("head.iclay", "head.nii --stride 2", "other samples"),
    ] {
        let run = bench.run(&format!("check {field} {input} -o report"));
        assert_eq!(run.code, 2, "{field} {input}: {}", run.stderr);
        assert!(
            run.stderr.contains(word) && run.stderr.contains("--anyway"),
            "{}",
            run.stderr
        );
        assert!(!bench.path("report").exists());
        let anyway = bench.json(&format!("check {field} {input} --anyway"));
        assert!(number(&anyway, "max") > 0.0, "{anyway}");
    }
    // The same samples in another file are the same input.
    bench.json("convert ball.ply ball.xyz");
    bench.json("check ball.iclay ball.xyz");
}

/// Every option of every command answers a wrong value with exit code 2 or 3 and a message that names the option and the
/// value and says what would be right. `cli::tests` sees to it that no option is missing in the table.
#[test]
fn a_wrong_value_is_named_with_its_option_and_its_remedy() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 500");
    bench.json("phantom head -o head.nii --size 16");
    bench.json("fit cloud.ply -o field.iclay --max-depth 6");
    bench.json("new clay.isoclay field.iclay");
    bench.write("notes.docx", "some words");
    let region =
        "[region]\nmin = [-0.5, -0.5, 0.6]\nmax = [0.5, 0.5, 1.3]\n[time]\nduration = 0.01\nstep = 0.01\n";
    bench.write("scene.toml", format!("field = \"field.iclay\"\n{region}"));
    bench.write("hand.toml", "target = [{ time = 0, at = [0, 0, 2] }]\n");
    let before = bench.files();
    let mut wrong = Vec::new();
    for (commands, options, arguments, word) in wrong_values::ROWS {
        for (k, command) in commands.split(' ').enumerate() {
            let names: Vec<&str> = options.split(' ').collect();
            let option = names[k.min(names.len() - 1)];
            let mut typed = command.replace('_', " ");
            let mut value = "";
            for part in arguments.split(' ') {
                value = part.split_once('*').map_or(value, |(_, v)| v);
                typed += " ";
                typed += &match part {
                    "@cloud" | "@volume" => wrong_values::besides(command, part),
                    "@out" => wrong_values::out(command).to_string(),
                    "@script" if command == "sculpt" => "--script scene.toml".into(),
                    "@script" => String::new(),
                    part => part.replace('*', ""),
                };
            }
            let run = bench.run(&typed);
            let short = match option {
                "--output" => "-o",
                long if long.starts_with("--") => long,
                _ => "",
            };
            let said = &run.stderr;
            let is_right = matches!(run.code, 2 | 3)
                && said.contains(value)
                && said.contains(short)
                && said.contains(word)
                && !said.contains("panicked");
            if std::env::var_os("ISOCLAY_SHOW_MESSAGES").is_some() || !is_right {
                wrong.push(format!("{typed}\n  {} {said}", run.code));
            }
            if bench.files() != before {
                wrong.push(format!("{typed}\n  something was left behind"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What comes and goes through pipes is to the byte what comes and goes through files; tables and notes go to stderr.
#[test]
fn pipes_carry_the_bytes_of_files() {
    let bench = Bench::new();
    bench.json("phantom torus -o cloud.ply --count 2000");
    bench.json("convert cloud.ply cloud.xyz");
    bench.json("fit cloud.ply -o field.iclay --max-depth 6");
    bench.json("phantom head -o head.nii --size 16");
    let read = |name: &str| std::fs::read(bench.path(name)).unwrap();
    for (file, typed, input, expected) in [
        ("mesh.ply", "mesh - -o - --resolution 32", "field.iclay", None),
        (
            "mesh.stl",
            "mesh - -o - --format stl --resolution 32",
            "field.iclay",
            None,
        ),
        (
            "out.pcd",
            "convert - - --format pcd",
            "cloud.ply",
            Some("convert cloud.ply out.pcd"),
        ),
        (
            "out.xyz",
            "convert - - --input-format xyz --format xyz",
            "cloud.xyz",
            Some("convert cloud.xyz out.xyz"),
        ),
        (
            "out.nrrd",
            "convert - - --format nrrd",
            "head.nii",
            Some("convert head.nii out.nrrd"),
        ),
        (
            "out.nii",
            "sample field.iclay --like - -o -",
            "head.nii",
            Some("sample field.iclay --like head.nii -o out.nii"),
        ),
        (
            "out.png",
            "picture - -o - --size 32x32",
            "field.iclay",
            Some("picture field.iclay -o out.png --size 32x32"),
        ),
    ] {
        let to_file = expected.map_or_else(
            || format!("mesh field.iclay -o {file} --resolution 32"),
            String::from,
        );
        bench.json(&to_file);
        let (run, bytes) = bench.pipe(typed, &read(input));
        assert_eq!(run.code, 0, "{typed}: {}", run.stderr);
        assert!(bytes == read(file), "{typed}: {} bytes", bytes.len());
        assert!(run.stderr.contains("standard output"), "{typed}: {}", run.stderr);
    }
    // The arguments are in the file, so that only what it holds is the same.
    let (run, field) = bench.pipe("fit - -o - --max-depth 6 --json", &read("cloud.ply"));
    bench.write("piped.iclay", field);
    let summary: serde_json::Value = serde_json::from_str(run.stderr.lines().last().unwrap()).unwrap();
    assert_eq!(
        summary["field_sha256"],
        bench.json("info piped.iclay")["field_sha256"]
    );
    assert_eq!(
        summary["field_sha256"],
        bench.json("info field.iclay")["field_sha256"]
    );
    let (run, said) = bench.pipe("info - --format xyz --json", &read("cloud.xyz"));
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(String::from_utf8(said).unwrap().contains("\"points\":2000"));
    let (run, _) = bench.pipe("check - cloud.ply --json", &read("field.iclay"));
    assert_eq!(run.code, 0, "{}", run.stderr);

    let before = bench.files();
    for (typed, word) in [
        ("info -", "--format"),
        ("check - -", "only once"),
        (
            "fit - -o out.iclay --format xyz",
            "standard input: the number of points",
        ),
        ("mesh - -o out.ply", "standard input: is no fitted field"),
    ] {
        let (run, out) = bench.pipe(typed, b"no numbers here");
        assert!(
            matches!(run.code, 2 | 3) && run.stderr.contains(word),
            "{typed}: {}",
            run.stderr
        );
        assert!(out.is_empty(), "{typed}");
    }
    // A device tells no format by its name.
    assert_eq!(bench.run("mesh field.iclay -o /dev/null --format glb").code, 0);
    assert_eq!(bench.files(), before);
}

#[test]
fn errors_are_json_objects_too() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 500");
    for (typed, code, word, remedy) in [
        (
            "mesh nowhere.iclay -o out.ply --json",
            3,
            "nowhere.iclay",
            Some("check the path"),
        ),
        (
            "mesh cloud.ply -o out.ply --json",
            3,
            "fitted field",
            Some("isoclay fit cloud.ply"),
        ),
        (
            "fit cloud.ply -o out.iclay --json --memory 1MiB",
            4,
            "memory",
            Some("--memory"),
        ),
        ("fit cloud.ply --json", 2, "--output", Some("Usage")),
        (
            "info cloud.ply --json --spacing 2",
            2,
            "Reading volumes",
            Some("leave them out"),
        ),
    ] {
        let run = bench.run(typed);
        assert_eq!(run.code, code, "{typed}: {}", run.stderr);
        let object: serde_json::Value = serde_json::from_str(run.stdout.lines().last().unwrap()).unwrap();
        assert_eq!(object["exit_code"], code);
        assert!(object["message"].as_str().unwrap().contains(word), "{object}");
        assert_eq!(
            object["remedy"].as_str().map(|r| r.contains(remedy.unwrap())),
            Some(true),
            "{object}"
        );
        assert!(!run.stderr.is_empty(), "people read it too");
    }
    // Standard output is the data's, even if they never come.
    let run = bench.run("mesh cloud.ply -o - --json");
    assert!(run.stdout.is_empty() && run.stderr.lines().last().unwrap().starts_with('{'));
    assert!(bench.run("mesh cloud.ply -o out.ply").stdout.is_empty());
}
