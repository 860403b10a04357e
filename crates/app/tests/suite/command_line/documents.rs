//! Documents: edits by scenes, undone and done again, and what leaves them.

use crate::common::{Bench, number};

const SCENE: &str = r#"
field = "unused"
[region]
min = [-0.6, -0.6, 0.5]
max = [0.6, 0.6, 1.1]
[[pull]]
at = [0.0, 0.0, 1.0]
radius = 0.2
strength = STRENGTH
[release]
as = "clay"
[plasticity]
rate = 20.0
[material]
mass = 0.01
damping = 0.1
[time]
duration = 0.1
step = 0.01
"#;

fn ball() -> Bench {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 2000");
    bench.json("fit cloud.ply -o ball.iclay --max-depth 6");
    for (name, strength) in [("out.toml", "4.0"), ("in.toml", "-3.0")] {
        bench.write(name, SCENE.replace("STRENGTH", strength));
    }
    bench
}

#[test]
fn a_document_is_edited_undone_done_again_and_replayed() {
    let bench = ball();
    let fields = |v: &serde_json::Value| v["field_sha256"]["ball"].as_str().unwrap().to_string();
    let first = bench.json("new clay.isoclay ball.iclay");
    assert_eq!(
        fields(&first),
        bench.json("info ball.iclay")["field_sha256"].as_str().unwrap()
    );
    // Shown, and not made.
    let bytes = || std::fs::read(bench.path("clay.isoclay")).unwrap();
    let before = bytes();
    let shown = bench.json("sculpt clay.isoclay --script out.toml --preview shown.iclay");
    assert_eq!((bytes(), shown["done"].as_u64()), (before, Some(0)));
    assert_eq!(
        bench.json("info shown.iclay")["field_sha256"].as_str().unwrap(),
        fields(&shown)
    );
    // The box about the pull: coarse functions reach far beyond its region, and not to the other side of the ball.
    let corner = |n: usize, axis: usize| shown["changed"]["ball"][n][axis].as_f64().unwrap();
    let is_about = |axis: usize| corner(0, axis) < 0.0 && corner(1, axis) > 0.0;
    assert!(is_about(0) && is_about(1) && corner(1, 2) > 1.0, "{shown}");
    assert!(corner(0, 2) > -0.5, "{shown}");
    let out = bench.json("sculpt clay.isoclay --script out.toml --threads 1");
    assert_eq!(fields(&out), fields(&shown));
    assert_eq!(out["state_sha256"], shown["state_sha256"]);
    let both = bench.json("sculpt clay.isoclay --script in.toml --threads 8");
    assert_ne!(fields(&out), fields(&first));
    assert_ne!(fields(&both), fields(&out));
    // A scene on a field and on an object of a document leave the same.
    let simulated = bench.json("simulate out.toml --field ball.iclay -o pulled.iclay");
    assert_eq!(simulated["field_sha256"].as_str().unwrap(), fields(&out));
    assert_eq!(fields(&bench.json("undo clay.isoclay 2")), fields(&first));
    assert_eq!(fields(&bench.json("redo clay.isoclay")), fields(&out));
    let past_the_end = bench.json("redo clay.isoclay 5");
    assert_eq!(fields(&past_the_end), fields(&both));
    assert!(past_the_end["notes"][0].as_str().unwrap().contains("1 of 5"));
    for threads in [1, 2, 8] {
        let replayed = bench.json(&format!("replay clay.isoclay --threads {threads}"));
        assert_eq!(fields(&replayed), fields(&both));
    }
    let history = bench.run("history clay.isoclay");
    assert!(history.stdout.contains("on ball (out.toml)") && history.stdout.contains("on ball (in.toml)"));
    bench.json("undo clay.isoclay");
    assert!(
        bench
            .run("history clay.isoclay")
            .stdout
            .contains("scene on ball (in.toml)  (undone)")
    );
    let exported = bench.json("export clay.isoclay -o now.iclay");
    assert_eq!(exported["field_sha256"].as_str().unwrap(), fields(&out));
    // What takes a field takes a document of one object.
    let mesh = bench.json("mesh clay.isoclay -o a.ply");
    assert_eq!(
        mesh["triangles"],
        bench.json("mesh now.iclay -o b.ply")["triangles"]
    );
    assert_eq!(
        std::fs::read(bench.path("a.ply")).unwrap(),
        std::fs::read(bench.path("b.ply")).unwrap()
    );
}

#[test]
fn an_object_of_several_is_named() {
    let bench = ball();
    bench.write(
        "copy.toml",
        "[[stroke]]\ncopy = { to = \"twin\" }\n\n[[stroke]]\nobject = \"twin\"\ncarve = { shape = { sphere = { radius = 0.4 } }, along = \
         [[0.0, 0.0, 1.0]] }\n",
    );
    bench.json("new clay.isoclay ball.iclay");
    let made = bench.json("sculpt clay.isoclay --script copy.toml");
    let listed = bench.json("info clay.isoclay");
    assert_eq!(listed["done"], 2);
    for (object, name) in listed["objects"].as_array().unwrap().iter().zip(["ball", "twin"]) {
        assert_eq!(object["name"], name);
        assert_eq!(object["field_sha256"], made["field_sha256"][name]);
        assert_eq!(
            bench.json(&format!("info clay.isoclay --object {name}"))["field_sha256"],
            object["field_sha256"]
        );
    }
    let volume = |name: &str| {
        let mesh = format!("mesh clay.isoclay --object {name} -o {name}.stl --check");
        number(&bench.json(&mesh)["quality"], "volume")
    };
    assert!(volume("twin") < 0.99 * volume("ball"));
    let unnamed = bench.run("picture clay.isoclay -o a.png");
    assert_eq!(unnamed.code, 2);
    assert!(
        unnamed.stderr.contains("(ball, twin); name one by --object"),
        "{}",
        unnamed.stderr
    );
}

#[test]
fn documents_that_cannot_be_used_say_why_and_stay_as_they_are() {
    let bench = ball();
    std::fs::copy(bench.path("ball.iclay"), bench.path("cow.iclay")).unwrap();
    bench.json("new two.isoclay ball.iclay cow.iclay");
    let before = std::fs::read(bench.path("two.isoclay")).unwrap();
    bench.write(
        "far.toml",
        SCENE
            .replace("min = [-0.6", "min = [-99.0")
            .replace("STRENGTH", "1"),
    );
    bench.write(
        "typo.toml",
        SCENE.replace("strength = STRENGTH", "strenght = 1.0"),
    );
    for (arguments, code, word) in [
        ("new two.isoclay ball.iclay", 2, "exists already"),
        ("new three.isoclay ball.iclay ball.iclay", 2, "rename"),
        ("sculpt two.isoclay --script out.toml", 2, "--object"),
        ("sculpt two.isoclay --script far.toml --object cow", 3, "far.toml"),
        (
            "sculpt two.isoclay --script typo.toml --object cow",
            3,
            "strenght",
        ),
        ("mesh two.isoclay -o out.ply", 2, "isoclay export"),
        ("export two.isoclay -o out.iclay", 2, "--object"),
    ] {
        let run = bench.run(arguments);
        assert_eq!(run.code, code, "{arguments}: {}", run.stderr);
        assert!(run.stderr.contains(word), "{arguments}: {}", run.stderr);
    }
    assert_eq!(std::fs::read(bench.path("two.isoclay")).unwrap(), before);
    assert!(!bench.path("three.isoclay").exists());
    // A torn end is left out and told; the next edit takes its place.
    bench.write("torn.isoclay", [&before[..], &[1, 2, 3]].concat());
    let torn = bench.json("history torn.isoclay");
    assert!(torn["notes"][0].as_str().unwrap().contains("not whole"));
    bench.json("sculpt torn.isoclay --script out.toml --object cow");
    assert!(bench.json("history torn.isoclay").get("notes").is_none());
}

/// A file that may grow no further stands for a disk that fills up in the middle of an edit.
#[test]
fn an_edit_that_finds_no_room_leaves_the_document_as_it_was() {
    let bench = ball();
    bench.json("new clay.isoclay ball.iclay");
    let before = std::fs::read(bench.path("clay.isoclay")).unwrap();
    // POSIX counts blocks of 512 bytes; some of the edit fits.
    let room = before.len() / 512 + 2;
    let program = env!("CARGO_BIN_EXE_isoclay");
    let limited = std::process::Command::new("sh")
        .arg("-c")
        .arg(format!(
            "trap '' XFSZ; ulimit -f {room}; exec {program} sculpt clay.isoclay --script out.toml"
        ))
        .current_dir(&bench.directory)
        .output()
        .unwrap();
    let said = String::from_utf8(limited.stderr).unwrap();
    assert_eq!(limited.status.code(), Some(4), "{said}");
    assert!(said.contains("clay.isoclay: writing failed"), "{said}");
    assert_eq!(std::fs::read(bench.path("clay.isoclay")).unwrap(), before);
    let after = bench.json("sculpt clay.isoclay --script out.toml");
    assert_eq!(after["done"], 1);
}

/// Each stroke is an edit; an error names the stroke or the line, and the edits before it stay.
#[test]
fn a_session_carves_and_adds_stroke_by_stroke() {
    let bench = ball();
    bench.json("new clay.isoclay ball.iclay");
    bench.write(
        "session.toml",
        r#"
[[stroke]]
carve = { shape = { sphere = { radius = 0.2 } }, along = [[0.0, -0.4, 1.0], [0.0, 0.4, 1.0]], blend = 0.05 }
[[stroke]]
object = "ball"
add = { shape = { torus = { axis = [0, 1, 0], major = 0.5, minor = 0.1 } }, along = [[0.45, 0.0, 0.0]] }
[[stroke]]
within = { min = [-2, -2, -2], max = [2, 2, 0] }
move = { motion = { grab = { along = [[0.0, 0.0, -1.0], [0.0, 0.0, -0.8]], radius = 0.5 } } }
"#,
    );
    let done = bench.json("sculpt clay.isoclay --script session.toml");
    assert_eq!(done["done"], 3);
    let replayed = bench.json("replay clay.isoclay");
    assert_eq!(replayed["field_sha256"], done["field_sha256"]);
    // A torus through a ball: what juts out has a hole.
    let mesh = bench.json("mesh clay.isoclay -o clay.ply --check");
    assert_eq!(mesh["quality"]["open_edges"], 0, "{mesh}");
    bench.write(
        "half.toml",
        "[[stroke]]\ncarve = { shape = { sphere = { radius = 0.1 } }, along = [[1.0, 0.0, 0.0]] }\n[[stroke]]\n",
    );
    let run = bench.run("sculpt clay.isoclay --script half.toml");
    assert_eq!(run.code, 3);
    assert!(
        run.stderr.contains("stroke 2") && run.stderr.contains("one of carve, add"),
        "{}",
        run.stderr
    );
    assert_eq!(bench.json("history clay.isoclay")["done"], 3);
    bench.write("typo.toml", "[[stroke]]\n\ncarv = 1\n");
    let run = bench.run("sculpt clay.isoclay --script typo.toml");
    assert!(run.stderr.contains("line 3"), "{}", run.stderr);
}

#[test]
fn a_block_is_made_from_nothing_and_shaped() {
    let bench = Bench::new();
    bench.json("new block.isoclay --box 10,6,4 --spacing 0.4 --unit mm");
    let mesh = bench.json("mesh block.isoclay -o block.ply --check");
    let volume = number(&mesh["quality"], "volume");
    // 240, less what the rounding of the edges takes: 0.6 mm.
    assert!((volume - 234.2).abs() < 1.0, "{mesh}");
    bench.write(
        "drill.toml",
        "[[stroke]]\nobject = \"block\"\ncarve = { shape = { cylinder = { axis = [0, 0, 1], radius = 1.0, height = 9.0 } }, along = [[1, 0, 0]] }\n",
    );
    bench.json("sculpt block.isoclay --script drill.toml");
    let drilled = bench.json("mesh block.isoclay -o drilled.ply --check");
    let taken = volume - number(&drilled["quality"], "volume");
    let whole = 4.0 * std::f64::consts::PI;
    assert!((taken / whole - 1.0).abs() < 0.02, "{taken} of {whole}");
    for (arguments, word) in [
        ("new a.isoclay --box 10", "--spacing"),
        ("new a.isoclay --spacing 1", "--box"),
        ("new a.isoclay --box 1 --spacing 0.9", "from 2"),
        ("new a.isoclay", "FIELD"),
    ] {
        let run = bench.run(arguments);
        assert_eq!(run.code, 2, "{arguments}");
        assert!(run.stderr.contains(word), "{arguments}: {}", run.stderr);
    }
    assert!(!bench.path("a.isoclay").exists());
}

/// A block on knots of its own is asked for whatever a field is asked for, keeps its knots where tools can, and is written in
/// levels, with a word, where they cannot.
#[test]
fn a_block_on_knots_of_its_own_is_kept_asked_and_shaped() {
    let bench = Bench::new();
    let first = bench.json(
        "new block.isoclay --box 10,6,4 --spacing 0.5 --unit mm --knots x=2..5.5/14;z=1,1.2,1.4..2.6/6",
    );
    let hash = |v: &serde_json::Value| v["field_sha256"]["block"].as_str().unwrap().to_string();
    let info = bench.json("info block.isoclay");
    let shape: Vec<u64> = serde_json::from_value(info["objects"][0]["knots"].clone()).unwrap();
    assert!(shape[0] > shape[1], "{info}");
    let mesh = bench.json("mesh block.isoclay -o block.ply --check");
    let volume = number(&mesh["quality"], "volume");
    // 240, less what the rounding of the edges takes: 0.75 mm.
    assert!((volume - 231.0).abs() < 2.0, "{mesh}");
    bench.json("picture block.isoclay -o block.png --size 64x64");
    bench.write("at.xyz", "0 0 1.5\n0 0 2.5\n");
    let run = bench.run("eval block.isoclay --points at.xyz");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let script = |name: &str, text: &str| bench.write(name, text);
    script(
        "finer.toml",
        "[[stroke]]\nrefine = { along = [[4, 2, 2]], radius = 0.5 }\n[[stroke]]\nplace = { by = [0, 0, 9] }\n",
    );
    let finer = bench.json("sculpt block.isoclay --script finer.toml");
    assert!(finer["notes"].as_array().is_none_or(Vec::is_empty), "{finer}");
    assert_ne!(hash(&finer), hash(&first));
    let higher = bench.json("mesh block.isoclay -o higher.ply --check");
    assert!(
        (number(&higher["quality"], "volume") - volume).abs() < 0.01 * volume,
        "{higher}"
    );
    script(
        "carve.toml",
        "[[stroke]]\ncarve = { shape = { sphere = { radius = 1 } }, along = [[3, 1, 2]] }\n",
    );
    let carved = bench.json("sculpt block.isoclay --script carve.toml");
    assert!(
        carved["notes"][0]
            .as_str()
            .unwrap()
            .contains("knots were given up"),
        "{carved}"
    );
    for threads in [1, 2, 8] {
        let replayed = bench.json(&format!("replay block.isoclay --threads {threads}"));
        assert_eq!(hash(&replayed), hash(&carved));
    }
    bench.json("undo block.isoclay");
    let out = bench.json("export block.isoclay -o block.iclay");
    assert!(
        out["notes"][0].as_str().unwrap().contains("knots were given up"),
        "{out}"
    );
    assert_eq!(hash(&bench.json("undo block.isoclay 2")), hash(&first));
    let check = bench.run("check block.isoclay at.xyz --anyway");
    assert_ne!(check.code, 0);
    let like = bench.run("export block.isoclay --like at.xyz -o out.xyz");
    assert_ne!(like.code, 0);
    bench.json("new twice.isoclay block.isoclay");
    let again = bench.json("info twice.isoclay");
    assert_eq!(again["objects"][0]["field_sha256"], hash(&first));
    for (knots, part) in [
        ("x=40,41", "some within"),
        ("x=1", "two at least"),
        ("x=0..1/60000", "are handled"),
    ] {
        let run = bench.run(&format!("new a.isoclay --box 10 --spacing 1 --knots {knots}"));
        assert_eq!(run.code, 2, "{knots}");
        assert!(run.stderr.contains(part), "{knots}: {}", run.stderr);
    }
    assert_eq!(bench.run("new a.isoclay --knots x=1,2").code, 2);
}

#[test]
fn a_scan_comes_back_with_the_edits_of_its_object() {
    let bench = Bench::new();
    bench.json("phantom head -o head.nii --size 32");
    bench.json("fit head.nii -o head.iclay");
    bench.json("new clay.isoclay head.iclay");
    bench.json("export clay.isoclay --like head.nii -o same.nii");
    let bytes = |name: &str| std::fs::read(bench.path(name)).unwrap();
    assert_eq!(bytes("same.nii"), bytes("head.nii"));
    let corners = bench.json("info head.iclay")["box"].clone();
    let corner = |n: usize, axis: usize| corners[n][axis].as_f64().unwrap();
    let [x, y, z] = [0, 1, 2].map(|axis| (corner(0, axis) + corner(1, axis)) / 2.0);
    let r = 0.2 * (corner(1, 0) - corner(0, 0));
    bench.write(
        "carve.toml",
        format!(
            "[[stroke]]\ncarve = {{ shape = {{ sphere = {{ radius = {r} }} }}, along = [[{x}, {y}, {z}]] }}\n"
        ),
    );
    bench.json("sculpt clay.isoclay --script carve.toml");
    let told = bench.run("export clay.isoclay --like head.nii -o carved.nii --fill -7");
    assert!(told.stdout.contains("density -7"), "{}", told.stdout);
    let (old, new) = (bytes("head.nii"), bytes("carved.nii"));
    assert_eq!(old.len(), new.len());
    assert_eq!(old[..352], new[..352]);
    assert_ne!(old, new);
    // What was done while another density was the surface stays done.
    bench.write("bone.toml", "[[stroke]]\nsurface = { iso = 2 }\n");
    bench.json("sculpt clay.isoclay --script bone.toml");
    bench.json("export clay.isoclay --like head.nii -o later.nii --fill -7");
    assert_eq!(bytes("later.nii"), new);
    bench.json("undo clay.isoclay 2");
    bench.json("export clay.isoclay --like head.nii -o back.nii.gz");
    bench.json("export clay.isoclay --like head.nii -o back.nii");
    assert_eq!(bytes("back.nii"), old);
    bench.json("phantom head -o other.nii --size 32 --seed 2 --noise 1%");
    let run = bench.run("export clay.isoclay --like other.nii -o out.nii");
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("other samples"), "{}", run.stderr);
    assert!(!bench.path("out.nii").exists());
}

#[test]
fn a_cloud_comes_back_with_the_edits_of_its_object() {
    let bench = ball();
    let bytes = |name: &str| std::fs::read(bench.path(name)).unwrap();
    bench.json("new clay.isoclay ball.iclay");
    bench.json("export clay.isoclay --like cloud.ply -o same.ply");
    assert_eq!(bytes("same.ply"), bytes("cloud.ply"));
    // Inflated on one side.
    bench.write(
        "swell.toml",
        "[[stroke]]\nadd = { shape = { sphere = { radius = 0.5 } }, along = [[0, 0, 0.62]], blend = 0.1 }\n",
    );
    bench.json("sculpt clay.isoclay --script swell.toml");
    bench.json("export clay.isoclay --like cloud.ply -o swollen.ply");
    bench.json("export clay.isoclay -o swollen.iclay");
    let check = bench.json("check swollen.iclay swollen.ply --anyway");
    assert!(number(&check, "rms") < 0.01, "{check}");
    assert!(number(&check, "input_count") >= 2000.0);
}

#[test]
fn clouds_of_other_formats_come_back_too() {
    let bench = ball();
    let bytes = |name: &str| std::fs::read(bench.path(name)).unwrap();
    for format in ["pcd", "las", "laz", "e57"] {
        bench.json(&format!("convert cloud.ply cloud.{format}"));
    }
    let text = crate::common::sphere_text([0.0; 3], 1.0, 1500);
    let lines = text.lines().map(|line| {
        let n: Vec<&str> = line.split(' ').collect();
        format!(
            "v {} {} {} 0.5\nvn {} {} {}\n",
            n[0], n[1], n[2], n[3], n[4], n[5]
        )
    });
    bench.write("cloud.obj", lines.collect::<String>());
    for format in ["pcd", "las", "laz", "obj", "e57"] {
        // E57 is in metres, and read in millimetres.
        let unit = if format == "e57" { 1000.0 } else { 1.0 };
        let swell = format!(
            "[[stroke]]\ninflate = {{ along = [[0, 0, {unit}]], radius = {}, by = {} }}\n",
            0.7 * unit,
            0.1 * unit
        );
        bench.write("swell.toml", swell);
        bench.json(&format!("fit cloud.{format} -o {format}.iclay --max-depth 6"));
        bench.json(&format!("new {format}.isoclay {format}.iclay"));
        let export = format!("export {format}.isoclay --like cloud.{format} -o");
        bench.json(&format!("{export} same.{format}"));
        assert_eq!(
            bytes(&format!("same.{format}")),
            bytes(&format!("cloud.{format}"))
        );
        bench.json(&format!("sculpt {format}.isoclay --script swell.toml"));
        bench.json(&format!("{export} swollen.{format}"));
        bench.json(&format!("export {format}.isoclay -o {format}-now.iclay"));
        let check = bench.json(&format!("check {format}-now.iclay swollen.{format} --anyway"));
        assert!(number(&check, "rms") < 0.01 * unit, "{format}: {check}");
        assert_ne!(
            bytes(&format!("swollen.{format}")),
            bytes(&format!("cloud.{format}"))
        );
    }
    bench.json("mesh ball.iclay -o ball.stl");
    bench.json("new clay.isoclay ball.iclay");
    let run = bench.run("export clay.isoclay --like ball.stl -o out.stl");
    assert!(
        run.code == 2 && run.stderr.contains("this is a mesh"),
        "{}",
        run.stderr
    );
}

/// Whoever may only read a document sees it, and is told before any work that edits cannot be kept.
#[test]
fn documents_of_others_are_read() {
    use std::fs::{Permissions, copy, set_permissions};
    use std::os::unix::fs::PermissionsExt;
    use std::os::unix::process::CommandExt;

    let bench = ball();
    bench.json("new clay.isoclay ball.iclay");
    // Root may do everything: somebody else runs a copy of the program that they can reach.
    copy(env!("CARGO_BIN_EXE_isoclay"), bench.path("isoclay")).unwrap();
    set_permissions(&bench.directory, Permissions::from_mode(0o755)).unwrap();
    set_permissions(bench.path("clay.isoclay"), Permissions::from_mode(0o444)).unwrap();
    let run = |arguments: &str| {
        let mut command = std::process::Command::new(bench.path("isoclay"));
        if rustix::process::geteuid().is_root() {
            command.uid(65534);
        }
        let arguments = arguments.split(' ');
        let run = command.args(arguments).current_dir(&bench.directory).output();
        crate::common::Run::from(run.unwrap())
    };
    let before = std::fs::read(bench.path("clay.isoclay")).unwrap();
    for command in ["info clay.isoclay", "history clay.isoclay", "replay clay.isoclay"] {
        let read = run(command);
        assert_eq!(read.code, 0, "{command}: {}", read.stderr);
    }
    for command in [
        "sculpt clay.isoclay --script out.toml",
        "undo clay.isoclay",
        "new other.isoclay ball.iclay",
    ] {
        let refused = run(command);
        assert_eq!(refused.code, 4, "{command}: {}", refused.stderr);
        assert!(
            refused.stderr.contains("check the permissions"),
            "{}",
            refused.stderr
        );
    }
    // A preview changes no document.
    std::fs::create_dir(bench.path("theirs")).unwrap();
    set_permissions(bench.path("theirs"), Permissions::from_mode(0o777)).unwrap();
    let preview = run("sculpt clay.isoclay --script out.toml --preview theirs/shown.iclay");
    assert_eq!(preview.code, 0, "{}", preview.stderr);
    assert!(bench.path("theirs/shown.iclay").is_file());
    assert_eq!(std::fs::read(bench.path("clay.isoclay")).unwrap(), before);
}

/// Two pictures in one file would be one.
#[test]
fn two_pictures_of_one_name_are_refused() {
    let bench = ball();
    std::os::unix::fs::symlink("a.png", bench.path("link.png")).unwrap();
    for errors in ["a.png", "./a.png", "link.png"] {
        let refused = bench.run(&format!("picture ball.iclay -o a.png --errors {errors}"));
        assert_eq!(refused.code, 2, "{errors}: {}", refused.stderr);
        assert!(refused.stderr.contains("name another file"), "{}", refused.stderr);
        // The link leads to a file now.
        bench.write("a.png", "");
    }
}
