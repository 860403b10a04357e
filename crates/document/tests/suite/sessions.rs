//! Sessions: the same bits by any number of threads, paint while tools work, and what is refused.

use document::{Command, CommandError, Document, Options, State};
use fitting::Control;
use tempfile::tempdir;

use super::clay::{again, block, height, plate, state_of};

fn commands(script: &str) -> Result<Vec<Command>, CommandError> {
    Command::of_script(script, |_| Ok("clay".into()))
}

fn done(state: &State, script: &str) -> Result<State, CommandError> {
    commands(script)?
        .iter()
        .try_fold(state.clone(), |state, command| {
            Ok(command.apply(&state, &mut Control::default())?.0)
        })
}

#[test]
fn force_tools_are_replayed_alike_by_one_two_and_eight_threads() {
    let directory = tempdir().unwrap();
    let mut document =
        Document::create(&directory.path().join("a.isoclay"), plate(), Options::default()).unwrap();
    let script = r#"
[[stroke]]
paint = { layer = "stiffness", formula = "1 + 4 * (x < 12)" }
[[stroke]]
pull = { along = [[8, 12, 13.6]], lift = 1.2, radius = 1.2 }
[[stroke]]
pull = { along = [[14, 9, 13.6], [17, 9, 13.6]], by = [0, 0.2, -0.8], radius = 1.2, how = { rule = "compliance" } }
[[stroke]]
chisel = { along = [[6, 15, 13.6], [15, 15, 13.6]], depth = 0.4, radius = 1.2 }
[[stroke]]
squirt = { along = [[15, 15, 13.6]], depth = 0.4, radius = 1.2 }
[[stroke]]
drill = { along = [[12, 12, 13.6]], by = [0, 0, -6], radius = 1.2 }
[[stroke]]
join = { along = [[17, 7, 13.6]], by = [0, 0, 2], radius = 1.2 }
[[stroke]]
paint = { layer = "mass", brush = { along = [[8, 12, 13]], radius = 3, value = 3 } }
[[stroke]]
paced = true
chisel = { along = [[6, 6, 13.6], [6.1, 6, 13.6], [9, 6, 13.6]], depth = 0.3, radius = 1.2 }
[[stroke]]
paced = true
pull = { along = [[8, 12, 14.5]], way = [[0, 0, 0.2], [0.2, 0, 0.9], [0.5, 0, 1.4]], radius = 1.2 }
[[stroke]]
extrude = { area = [[4, 12, 13.6], [9, 12, 13.6], [9, 17, 13.6], [4, 17, 13.6]], by = [0, 0, 1], radius = 1.2 }
[[stroke]]
bend = { at = [12, 12, 12], axis = [0, -1, 0], direction = [1, 0, 0], angle = 4, length = 6, radius = 1.2, region = { min = [8, 9, 10], max = [18, 15, 16] } }
[[stroke]]
sweep = { operation = "carve", shape = { box = { size = [1, 1, 1] } }, along = { spline = { through = [[6, 6, 12], [12, 8, 12.2], [18, 6, 12]] } }, follow = true }
[[stroke]]
push = { along = [[15, 16, 13.6], [17, 18, 13.6]], radius = 2, speed = 0.1, force = -1, steps = 4 }
[[stroke]]
wall = 0.4
carve = { shape = { sphere = { radius = 1 } }, along = [[17, 17, 12]] }
[[stroke]]
place = { turn = [0, 0, 30], by = [1, 2, 3] }
[[stroke]]
material = { solid = "elastic" }
[[stroke]]
surface = { iso = 290 }
"#;
    let commands = commands(script).unwrap();
    assert_eq!(commands.len(), 18);
    let mut hashes = vec![document.state().sha256()];
    for command in &commands {
        let (next, _) = command
            .apply(document.state(), &mut Control::default())
            .unwrap_or_else(|e| panic!("{}: {e}", command.title()));
        assert!(
            document
                .commit(&command.title(), command.to_value(), next)
                .unwrap(),
            "{}",
            command.title()
        );
        hashes.push(document.state().sha256());
    }
    for threads in [1, 2, 8] {
        let again = again(&mut document, threads);
        assert_eq!(again.sha256(), document.state().sha256(), "{threads} threads");
    }
    let history = document.history().unwrap();
    assert_eq!(history[8].title, "chisel on clay by hand, 3 steps");
    // One edit back after the other, and forth again.
    for hash in hashes.iter().rev().skip(1) {
        assert_eq!(document.undo(1).unwrap(), 1);
        assert_eq!(document.state().sha256(), *hash);
    }
    for hash in &hashes[1..] {
        assert_eq!(document.redo(1).unwrap(), 1);
        assert_eq!(document.state().sha256(), *hash);
    }
}

/// Longer springs make a stroke swell what it moves, shorter ones make it shrink; what was asked for arrives all the same.
#[test]
fn painted_rest_lengths_move_what_a_stroke_moves() {
    let ball = state_of(|p| 6.0 - p.distance(glam::DVec3::splat(12.0)));
    let beside = |value: f64| {
        let script = format!(
            "[[stroke]]\npaint = {{ layer = 'rest-length', formula = '1 + {value} * (x < 12)' }}\n\
             [[stroke]]\npull = {{ along = [[12, 12, 18]], lift = 0.6, radius = 1.2 }}"
        );
        let left = done(&ball, &script).unwrap();
        let tip = height(&left, 12.0, 12.0) - height(&ball, 12.0, 12.0);
        assert!((tip / 0.6 - 1.0).abs() < 0.02, "{value}: {tip}");
        height(&left, 9.5, 12.0) - height(&left, 14.5, 12.0)
    };
    let [less, none, more] = [-0.3, 0.0, 0.3].map(beside);
    println!("{less} {none} {more}");
    assert!(none.abs() < 1e-3, "{none}");
    assert!(less < -0.02 && more > 0.02, "{less} {more}");
}

/// The density falls by 40 a length, so that of 340 is one below the top: there tools work from then on.
#[test]
fn another_density_becomes_the_surface_and_stays_one() {
    let block = block();
    let lower = done(&block, "[[stroke]]\nsurface = { iso = 340 }").unwrap();
    assert_eq!(lower.object("clay").unwrap().iso(), Some(340.0));
    assert_ne!(lower.sha256(), block.sha256());
    let pulled = "[[stroke]]\npull = { along = [[12, 12, 11]], lift = 0.6, radius = 1.2 }";
    let left = done(&lower, pulled).unwrap();
    let at = |state: &State, z: f64| {
        let field = state.object("clay").unwrap().field.as_field();
        field.value(glam::DVec3::new(12.0, 12.0, z))
    };
    assert!((at(&lower, 11.0) - 340.0).abs() < 1e-3);
    assert!((at(&left, 11.6) - 340.0).abs() < 0.5, "{}", at(&left, 11.6));
    let back = done(&lower, "[[stroke]]\nsurface = { iso = 300 }").unwrap();
    assert_eq!(back.sha256(), block.sha256());
}

/// Paint of a step is felt from that step on, is kept with the object, and is done again with the stroke.
#[test]
fn paint_is_laid_on_while_a_tool_works() {
    let stroke = |during: &str| {
        format!(
            "[[stroke]]\npull = {{ along = [[12, 12, 12]], lift = 1.2, radius = 1.2, how = {{ rule = 'compliance', gain = 0.5 }} }}\n{during}"
        )
    };
    let paint = |step: usize| {
        format!(
            "during = [{{ step = {step}, paint = {{ layer = 'stiffness', formula = '1 + 19 * (x > 0)' }} }}]"
        )
    };
    let painted = "[[stroke]]\npaint = { layer = 'stiffness', formula = '1 + 19 * (x > 0)' }\n";
    let tip = |script: &str| {
        let left = done(&block(), script).unwrap_or_else(|e| panic!("{script}: {e}"));
        (height(&left, 12.0, 12.0), left)
    };
    let (free, _) = tip(&stroke(""));
    let (stiff, before) = tip(&format!("{painted}{}", stroke("")));
    let (first, at_once) = tip(&stroke(&paint(0)));
    let (later, mid) = tip(&stroke(&paint(6)));
    let (last, late) = tip(&stroke(&paint(1_000_000)));
    println!("{free} {stiff} {first} {later} {last}");
    assert_eq!(first, stiff);
    assert_eq!(at_once.sha256(), before.sha256());
    assert!(stiff < later && later < free, "{stiff} {later} {free}");
    assert_eq!(last, free);
    for state in [&mid, &late] {
        assert_eq!(state.object("clay").unwrap().layers.len(), 1);
    }
}

/// Lines of a stroke, and words of what is told.
const REFUSED: &[(&str, &[&str])] = &[
    // Poses and numbers that are none.
    (
        "chisel = { along = [[nan, 12, 12]], depth = 1, radius = 1 }",
        &["line 2", "finite"],
    ),
    (
        "carve = { along = [[1, inf, 12]], shape = { sphere = { radius = 1 } } }",
        &["line 2", "finite"],
    ),
    (
        "move = { motion = { grab = { along = [[1, 1, nan], [1, 1, 1]], radius = 1 } } }",
        &["finite"],
    ),
    (
        "smooth = { along = [[12, 12, 12]], radius = nan, level = 1 }",
        &["line 2", "above 0"],
    ),
    (
        "paced = true\npull = { along = [[12, 12, 12]], way = [[0, 0, nan]], radius = 1 }",
        &["line 3", "finite"],
    ),
    // Objects that are placed nowhere.
    ("place = {}", &["says nothing"]),
    (
        "place = { by = [1, 0, 0], about = [1, 2, 3] }",
        &["about", "turn or a scale"],
    ),
    ("place = { scale = 0 }", &["line 2", "above 0"]),
    ("place = { by = [0, 0, inf] }", &["line 2", "finite"]),
    ("place = { parent = 'nobody' }", &["no object \"nobody\"", "clay"]),
    ("place = { parent = 'clay' }", &["circle"]),
    (
        "place = { map = [[1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 0]] }",
        &["flattens"],
    ),
    (
        "symmetry = { at = [12, 12, 12], normal = [1, 0, 0] }\nplace = { by = [1, 0, 0] }",
        &["symmetry"],
    ),
    ("material = { solid = 'jelly' }", &["line 2", "clay"]),
    ("surface = { iso = nan }", &["line 2", "finite"]),
    (
        "surface = { iso = 1e6 }",
        &["iso is 1000000", "run from", "between"],
    ),
    // Vectors and boxes without length.
    (
        "pull = { along = [[12, 12, 12]], by = [0, 0, 0], radius = 1 }",
        &["no length"],
    ),
    (
        "drill = { along = [[12, 12, 12]], by = [0, 0, 0], radius = 1 }",
        &["turn it round"],
    ),
    (
        "carve = { along = [[12, 12, 12]], shape = { cylinder = { axis = [0, 0, 0], radius = 1, height = 1 } } }",
        &["axis"],
    ),
    (
        "move = { motion = { twist = { at = [12, 12, 12], axis = [0, 0, 0], angle = 9, radius = 2 } } }",
        &["axis"],
    ),
    (
        "move = { motion = { mirror = { at = [12, 12, 12], normal = [0, 0, 0] } } }",
        &["normal"],
    ),
    (
        "symmetry = { at = [12, 12, 12], normal = [0, 0, 0] }\nsmooth = { along = [[12, 12, 12]], radius = 3, level = 1 }",
        &["normal"],
    ),
    (
        "within = { min = [5, 5, 5], max = [9, 5, 9] }\nsmooth = { along = [[12, 12, 12]], radius = 3, level = 1 }",
        &["no size"],
    ),
    (
        "mask = { boxes = [{ min = [5, 5, 5], max = [5, 5, 5] }] }\nsmooth = { along = [[12, 12, 12]], radius = 3, level = 1 }",
        &["no size"],
    ),
    (
        "cut = { region = { min = [5, 5, 5], max = [5, 9, 9] } }",
        &["no size"],
    ),
    (
        "move = { motion = { shift = { region = { min = [5, 5, 9], max = [9, 9, 9] }, by = [1, 0, 0], blend = 1 } } }",
        &["no size"],
    ),
    (
        "add = { along = [[12, 12, 12]], shape = { box = { size = [1, 0, 1] } } }",
        &["above 0"],
    ),
    // Beside the object.
    (
        "carve = { along = [[12, 12, 99]], shape = { sphere = { radius = 1 } } }",
        &["reaches from"],
    ),
    (
        "smooth = { along = [[12, 12, 99]], radius = 1, level = 1 }",
        &["reaches from"],
    ),
    (
        "squirt = { along = [[12, 12, 99]], depth = 1, radius = 1 }",
        &["stay within"],
    ),
    (
        "paint = { layer = 'mass', brush = { along = [[12, 12, 99]], radius = 1, value = 2 } }",
        &["does not reach"],
    ),
    (
        "move = { motion = { grab = { along = [[12, 12, 99], [12, 12, 98]], radius = 1 } } }",
        &["reaches from"],
    ),
    // Beyond reason.
    (
        "pull = { along = [[12, 12, 12]], lift = 1e300, radius = 1 }",
        &["stay within"],
    ),
    (
        "pull = { along = [[12, 12, 12]], lift = 1, radius = 1e300 }",
        &["wider than the field"],
    ),
    (
        "squirt = { along = [[12, 12, 12]], depth = 1e9, radius = 1 }",
        &["stay within"],
    ),
    (
        "inflate = { along = [[12, 12, 12]], radius = 3, by = 1e30 }",
        &["by"],
    ),
    (
        "smooth = { along = [[12, 12, 12]], radius = 3, level = 99 }",
        &["1 to 10"],
    ),
    (
        "push = { along = [[12, 12, 12]], radius = 3, speed = 1e30 }",
        &["push less hard"],
    ),
    (
        "push = { along = [[12, 12, 12]], radius = 3, speed = 0 }",
        &["line 2", "above 0"],
    ),
    (
        "push = { along = [[12, 12, 12]], radius = 3, speed = 0.1, force = nan }",
        &["line 2", "finite"],
    ),
    (
        "push = { along = [[12, 12, 12]], radius = 3, speed = 0.1, force = 'hard' }",
        &["line 2", "a number or a list"],
    ),
    (
        "push = { along = [[12, 12, 12]], radius = 3, speed = 0.1, steps = 1.5 }",
        &["line 2", "u32"],
    ),
    (
        "push = { along = [[12, 12, 12]], radius = 3, speed = 0.1, steps = 99999 }",
        &["1 to 10000"],
    ),
    (
        "push = { along = [[1, 12, 12], [23, 12, 12]], radius = 0.001, speed = 1e-4 }",
        &["wider brush"],
    ),
    (
        "paced = true\npush = { along = [[12, 12, 12]], radius = 3, speed = 0.1, force = [1, 2] }",
        &["1 places and 2 forces"],
    ),
    (
        "paint = { layer = 'stiffness', brush = { along = [[12, 12, 12]], radius = 3, value = 1e9 } }",
        &["at most"],
    ),
    (
        "paint = { layer = 'stiffness', brush = { along = [[12, 12, 12]], radius = 3, value = 2, rate = 9 } }",
        &["at most 1"],
    ),
    (
        "chisel = { along = [[1, 1, 12], [23, 23, 12]], depth = 0.1, radius = 0.001 }",
        &["paths"],
    ),
    (
        "paced = true\nchisel = { along = [[1, 1, 12], [23, 23, 12]], depth = 0.1, radius = 0.001 }",
        &["smaller box"],
    ),
    // Curves, outlines and walls.
    (
        "sweep = { operation = 'add', along = [[12, 12, nan]], shape = { sphere = { radius = 1 } } }",
        &["line 2", "finite"],
    ),
    (
        "sweep = { operation = 'cut', along = [[12, 12, 12]], shape = { sphere = { radius = 1 } } }",
        &["line 2", "`carve` or `add`"],
    ),
    (
        "sweep = { operation = 'add', along = [[12, 12, 99]], shape = { sphere = { radius = 1 } } }",
        &["reaches from"],
    ),
    (
        "sweep = { operation = 'add', along = [[12, 12, 12], [14, 12, 12]], shape = { object = { name = 'clay' } } }",
        &["does not sweep"],
    ),
    (
        "sweep = { operation = 'add', along = { formulas = { x = 't', y = '1/t', z = '0', from = 0, to = 1 } }, shape = { sphere = { radius = 1 } } }",
        &["finite"],
    ),
    (
        "paced = true\nsweep = { operation = 'add', along = [[12, 12, 12]], shape = { sphere = { radius = 1 } } }",
        &["sweep goes nowhere by hand"],
    ),
    (
        "extrude = { area = [[9, 9, 12], [15, 9, 12], [15, 15, 12]], by = [0, 0, 0], radius = 1 }",
        &["no length"],
    ),
    (
        "extrude = { area = [[9, 9, 12], [15, 9, 12], [15, 15, 12]], by = [0, 0, 2], radius = 3 }",
        &["radii across"],
    ),
    (
        "extrude = { area = [[9, 9, 12], [15, 9, 12], [15, 15, 12]], by = [0, 0, 1e9], radius = 1 }",
        &["stay within"],
    ),
    (
        "extrude = { area = [[9, 9, 12], [15, 9, 12]], by = [0, 0, 2], radius = 1 }",
        &["encloses nothing"],
    ),
    (
        "bend = { at = [12, 12, 12], axis = [1, 0, 0], direction = [1, 0, 0], angle = 9, length = 3, radius = 1 }",
        &["same way"],
    ),
    (
        "bend = { at = [12, 12, 12], axis = [0, 1, 0], direction = [1, 0, 0], angle = 9, length = 3, radius = 0 }",
        &["line 2", "above 0"],
    ),
    (
        "during = [{ step = 1, paint = { layer = 'mass', formula = '2' } }]\nbend = { at = [12, 12, 12], axis = [0, 1, 0], direction = [1, 0, 0], angle = 9, length = 3, radius = 1 }",
        &["takes no time"],
    ),
    (
        "wall = 0\ncarve = { along = [[12, 12, 9]], shape = { sphere = { radius = 1 } } }",
        &["line 2", "above 0"],
    ),
    (
        "wall = 40\ncarve = { along = [[12, 12, 9]], shape = { sphere = { radius = 1 } } }",
        &["make it thinner"],
    ),
    // Formulas.
    (
        "paint = { layer = 'mass', formula = '1 + (x * ' }",
        &["character 10", "ends too early"],
    ),
    (
        "paint = { layer = 'mass', formula = 'x + wurst' }",
        &["character 5", "wurst"],
    ),
    (
        "paint = { layer = 'mass', formula = '1 / (z - z)' }",
        &["finite", "x = "],
    ),
    (
        "mask = { formula = 'x $ 3' }\nsmooth = { along = [[12, 12, 12]], radius = 3, level = 1 }",
        &["character 3"],
    ),
    (
        "carve = { along = [[12, 12, 12]], shape = { formula = { text = '1 / (x - x)', size = [2, 2, 2] } } }",
        &["finite"],
    ),
    (
        "pull = { along = [[12, 12, 12]], lift = 1, radius = 1, how = { filter = { formula = '1 +' } } }",
        &["character 4"],
    ),
    // Fields that nobody knows, and strokes that are none or too much.
    (
        "pull = { along = [[12, 12, 12]], lift = 1, radius = 1, strength = 2 }",
        &["line 2", "strength"],
    ),
    ("pulll = 1", &["line 2", "pulll"]),
    ("paced = 3\ncopy = { to = 'b' }", &["line 2"]),
    ("paced = true\ncopy = { to = 'b' }", &["by hand"]),
    (
        "paced = true\nmove = { motion = { grab = { along = [[12, 12, 12], [12, 12, 13]], radius = 3 } } }",
        &["leave paced out"],
    ),
    (
        "paced = true\nchisel = { along = [], depth = 1, radius = 1 }",
        &["no pose"],
    ),
    (
        "paced = true\nchisel = { along = [[12, 12, 12]], depth = 1, radius = 1, how = { solid = 'elastic' } }",
        &["elastic"],
    ),
    (
        "carve = { along = [], shape = { sphere = { radius = 1 } } }",
        &["place"],
    ),
    ("copy = { to = 'clay' }", &["already"]),
    (
        "paste = { from = 'wood', region = { min = [1, 1, 1], max = [2, 2, 2] } }",
        &["wood"],
    ),
    (
        "during = [{ step = 1, paint = { layer = 'mass', formula = '2' } }]\ncopy = { to = 'b' }",
        &["takes no time"],
    ),
    (
        "during = [{ step = 2, paint = { layer = 'mass', formula = '2' } }, { step = 1, paint = { layer = 'mass', formula = '3' } }]\n\
      pull = { along = [[12, 12, 12]], lift = 1, radius = 1 }",
        &["order"],
    ),
    (
        "during = [{ step = 2, paint = { layer = 'mass', formula = '2' } }]\nsymmetry = { at = [12, 12, 12], normal = [1, 0, 0] }\n\
      pull = { along = [[12, 12, 12]], lift = 1, radius = 1 }",
        &["both sides"],
    ),
    (
        "carve = { along = [[9, 9, 9], [12, 12, 12], [15, 15, 9]], turn = [[0, 0, 1], [0, 0, 2]], shape = { sphere = { radius = 1 } } }",
        &["turn"],
    ),
    (
        "coarse = 9\nsmooth = { along = [[12, 12, 12]], radius = 3, level = 1 }",
        &["levels 0 to"],
    ),
];

#[test]
fn sessions_that_make_no_sense_are_refused_and_the_document_stays() {
    let state = block();
    let hash = state.sha256();
    let mut wrong = Vec::new();
    for (lines, words) in REFUSED {
        let told = match done(&state, &format!("[[stroke]]\n{lines}")) {
            Ok(_) => "nothing".to_string(),
            Err(e) => e.to_string(),
        };
        if !words.iter().all(|word| told.contains(word)) {
            wrong.push(format!("{lines}\n    wanted {words:?}, told: {told}"));
        }
        assert_eq!(state.sha256(), hash, "{lines}");
    }
    // Line and column of sessions in JSON, whose empty lines count.
    let fine = r#"{"smooth": {"along": [[12, 12, 12]], "radius": 3, "level": 1}}"#;
    for (line, words) in [
        (r#"{"smoth": {}}"#, ["line 3, column 8", "smoth"]),
        (r#"{"copy": {"to": 3}}"#, ["line 3, column", "string"]),
        (r#"{"copy": {"to": "b"}"#, ["line 3, column", "EOF"]),
        (
            r#"{"carve": {"along": [[NaN, 0, 0]]}}"#,
            ["line 3, column", "expected"],
        ),
        (
            r#"{"carve": {"along": [[1e999, 0, 0]]}}"#,
            ["line 3, column", "range"],
        ),
        (r#"{"object": "clay"}"#, ["stroke 2", "no tool"]),
    ] {
        let told = commands(&format!("{fine}\n\n{line}\n")).unwrap_err().to_string();
        if !words.iter().all(|word| told.contains(word)) {
            wrong.push(format!("{line}\n    wanted {words:?}, told: {told}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
