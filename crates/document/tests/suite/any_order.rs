//! Strokes of every tool in any order, shown first or not, with undos and reopenings between them, and numbers beyond reason among theirs.

use std::collections::BTreeMap;

use document::{Command, CommandError, Document, Options, Preview, State};
use fitting::Control;
use glam::DVec3;
use tempfile::tempdir;
use tools::live::Pose;

use super::clay::{again, plate};
use super::common::Draw;
use super::knots;

/// An object: its name, the middle of its top, half of where strokes begin, and the radius of its tools.
const GROUNDS: [(&str, [f64; 3], f64, f64); 2] = [
    ("clay", [12.0, 12.0, 13.6], 5.0, 1.2),
    ("block", [0.0, 0.0, 2.0], 2.0, 0.5),
];

/// Strokes with `RADIUS`es, `FAR` ways, places `AT`, `TO` and `THERE` on the top, and their box `MIN` to `MAX`, all drawn anew for each.
const STROKES: &[&str] = &[
    "pull = { along = [AT], lift = FAR, radius = RADIUS }",
    "pull = { along = [AT, TO], by = [0, 0, FAR], radius = RADIUS, how = { rule = 'compliance' } }",
    "pull = { along = [AT], disc = RADIUS, lift = FAR, radius = RADIUS }\nmask = { boxes = [{ min = MIN, max = MAX }], soft = RADIUS }",
    "pull = { along = [AT], lift = FAR, radius = RADIUS, how = { solid = 'elastic' } }",
    "pull = { along = [AT], lift = FAR, radius = RADIUS }\nduring = [{ step = 2, paint = { layer = 'stiffness', brush = { along = [AT], radius = RADIUS, value = 3 } } }]",
    "paced = true\npull = { along = [AT], way = [[0, 0, FAR], [FAR, 0, FAR]], radius = RADIUS }",
    "chisel = { along = [AT, TO], depth = FAR, radius = RADIUS }",
    "paced = true\nsquirt = { along = [AT, AT, TO], depth = FAR, radius = RADIUS }",
    "drill = { along = [AT], by = [0, FAR, -6], radius = RADIUS }",
    "join = { along = [AT], by = [0, FAR, 2], radius = RADIUS }",
    "extrude = { area = [AT, TO, THERE], by = [0, 0, FAR], radius = RADIUS }",
    "extrude = { area = { spline = { through = [AT, TO, THERE], closed = true } }, by = [0, FAR, FAR], radius = RADIUS }",
    "bend = { at = AT, axis = [0, -1, 0], direction = [1, 0, 0], angle = 5, length = 6, radius = RADIUS }",
    "sweep = { operation = 'add', shape = { sphere = { radius = RADIUS } }, along = { spline = { through = [AT, TO, THERE] } } }",
    "sweep = { operation = 'carve', shape = { box = { size = [RADIUS, RADIUS, FAR] } }, along = [AT, TO], follow = true }",
    "wall = FAR\ncarve = { shape = { sphere = { radius = RADIUS } }, along = [AT, TO] }",
    "symmetry = { at = AT, normal = [1, 0, 0] }\ncarve = { shape = { sphere = { radius = RADIUS } }, along = [TO] }",
    "add = { shape = { box = { size = [RADIUS, RADIUS, FAR] } }, along = [AT, TO], turn = [[0, 0, 0], [0, FAR, 60]], blend = FAR }",
    "paced = true\nadd = { shape = { sphere = { radius = RADIUS } }, along = [AT, TO, THERE] }",
    "push = { along = [AT, TO], radius = RADIUS, speed = FAR, steps = 3 }",
    "paced = true\npush = { along = [AT, TO], radius = RADIUS, speed = 0.1, force = [-1, FAR] }",
    "smooth = { along = [AT, TO], radius = RADIUS, level = 2, keep-volume = true }",
    "coarse = 0\ninflate = { along = [AT], radius = RADIUS, by = FAR }",
    "within = { min = MIN, max = MAX }\ninflate = { along = [AT, TO], radius = RADIUS, by = FAR }",
    "refine = { along = [AT], radius = RADIUS }",
    "simplify = { along = [AT, TO], radius = RADIUS, tolerance = 0.01 }",
    "paint = { layer = 'stiffness', brush = { along = [AT, TO], radius = RADIUS, value = 3 } }",
    "mask = { formula = 'x - y' }\npaint = { layer = 'mass', formula = '1 + FAR * x^2' }",
    "paint = { layer = 'rest-length', formula = '1 + 0.1 * FAR * (y > 1)' }",
    "hold = { name = 'NAME', points = [AT], spring = 200 }",
    "hold = { name = 'NAME', sketch = [AT, TO] }",
    "free = {}",
    "move = { motion = { grab = { along = [AT, TO], radius = RADIUS } } }",
    "move = { motion = { twist = { at = AT, axis = [0, 0, 1], angle = 20, radius = RADIUS } } }",
    "move = { motion = { shift = { region = { min = MIN, max = MAX }, by = [0, 0, FAR], blend = RADIUS } } }",
    "move = { motion = { mirror = { at = AT, normal = [1, 0, 0] } } }",
    "place = { turn = [0, FAR, 9], by = [FAR, 0, 1], scale = 1.1 }",
    "material = { solid = 'elastic' }",
    "material = { solid = 'clay' }",
    "copy = { to = 'NAME' }",
    "cut = { region = { min = MIN, max = MAX }, to = 'NAME', blend = FAR }",
    "paste = { from = 'clay', region = { min = MIN, max = MAX }, by = [0, FAR, FAR], turn = [0, 0, 30], blend = FAR }",
];

/// A stroke on an object; in one of five one number in eight is beyond reason.
fn drawn(kind: usize, (_, middle, half, radius): (&str, [f64; 3], f64, f64), draw: &mut Draw) -> String {
    let is_wild = draw.below(5) == 0;
    let mut number = |low: f64, high: f64| {
        if is_wild && draw.below(8) == 0 {
            [0.0, -3.0, 1e-7, 1e4, 1e30][draw.below(5) as usize]
        } else {
            low + (high - low) * f64::from(draw.below(1001)) / 1000.0
        }
    };
    let mut text = String::new();
    let mut rest = STROKES[kind];
    let mut box_of = || -> [f64; 3] { [0, 1, 2].map(|a| middle[a] - number(0.2, 1.2) * half) };
    let (min, wide) = (box_of(), box_of());
    let max: [f64; 3] = [0, 1, 2].map(|a| 2.0 * middle[a] - wide[a]);
    while let Some(at) = rest.find(|c: char| c.is_ascii_uppercase()) {
        let (before, from) = rest.split_at(at);
        let end = from.find(|c: char| !c.is_ascii_uppercase()).unwrap_or(from.len());
        let (word, after) = from.split_at(end);
        text += before;
        text += &match word {
            "RADIUS" => format!("{:?}", radius * number(0.9, 1.6)),
            "FAR" => format!("{:?}", radius * number(0.2, 0.9)),
            "MIN" => format!("{min:?}"),
            "MAX" => format!("{max:?}"),
            "NAME" => ["a", "b", "c"][number(0.0, 2.9).clamp(0.0, 2.0) as usize].to_string(),
            place => {
                // Corners of a triangle wide enough for an outline.
                let [x, y] = match place {
                    "AT" => [-0.7, -0.7],
                    "TO" => [0.7, -0.6],
                    _ => [0.0, 0.8],
                };
                let [x, y] = [x, y].map(|c| (c + number(-0.3, 0.3)) * half);
                format!("[{:?}, {:?}, {:?}]", middle[0] + x, middle[1] + y, middle[2])
            }
        };
        rest = after;
    }
    text + rest
}

/// What became of a stroke: whether it changed anything.
fn done(document: &mut Document, text: &str, name: &str, shown: Option<Pose>) -> Result<bool, CommandError> {
    let control = &mut Control::default();
    let command = Command::of_script(&format!("[[stroke]]\n{text}"), |_| {
        Ok::<_, CommandError>(name.into())
    })?
    .remove(0);
    // As the journal has it.
    let command: Command = serde_json::from_value(command.to_value()).unwrap();
    if let Some(pose) = shown {
        let mut preview = Preview::of(document.state(), command, control)?;
        let shown = preview.state().sha256();
        // Tools without one place stay where they are, and so does what cannot act there.
        if preview.put(pose, control).is_err() {
            assert_eq!(preview.state().sha256(), shown);
        }
        return preview.apply(document);
    }
    let (next, _) = command.apply(document.state(), control)?;
    Ok(document.commit(&command.title(), command.to_value(), next)?)
}

/// How often strokes of each kind changed something, did nothing, and were refused, and why last.
type Count = BTreeMap<usize, ([usize; 3], String)>;

fn session(seed: u64, strokes: usize, counts: &mut Count) {
    let directory = tempdir().unwrap();
    let path = directory.path().join("a.isoclay");
    let block = knots::state_of(knots::uneven()).object("block").unwrap().clone();
    let first: State = plate().with("block", block).unwrap();
    let mut document = Document::create(&path, first, Options::default()).unwrap();
    let mut draw = Draw(seed);
    let mut hashes = vec![document.state().sha256()];
    for _ in 0..strokes {
        let kind = draw.below(STROKES.len() as u32) as usize;
        let ground = GROUNDS[draw.below(2) as usize];
        let text = drawn(kind, ground, &mut draw);
        let shown = (draw.below(4) == 0).then(|| Pose {
            force: 1.5,
            ..Pose::at(DVec3::from_array(ground.1) + DVec3::new(0.3, 0.2, 0.0))
        });
        let size = document.size();
        let clock = std::time::Instant::now();
        let (count, why) = counts.entry(kind).or_default();
        let done = done(&mut document, &text, ground.0, shown);
        if !matches!(done, Ok(true)) {
            assert_eq!(
                (document.size(), document.state().sha256()),
                (size, *hashes.last().unwrap()),
                "{text}"
            );
        }
        match done {
            Ok(true) => {
                hashes.push(document.state().sha256());
                count[0] += 1;
            }
            Ok(false) => count[1] += 1,
            Err(refusal) => {
                count[2] += 1;
                *why = format!("{}: {text}: {refusal}", ground.0);
            }
        }
        if clock.elapsed().as_secs() > 10 {
            println!("seed {seed}: {:?}: {}: {text}", clock.elapsed(), ground.0);
        }
        if draw.below(5) == 0 {
            // What comes next takes the place of these.
            let undone = document.undo(1 + draw.below(3) as usize).unwrap();
            hashes.truncate(hashes.len() - undone);
            assert_eq!(document.state().sha256(), *hashes.last().unwrap());
        }
        if draw.below(8) == 0 {
            drop(document);
            document = super::open(&path);
            assert_eq!(document.state().sha256(), *hashes.last().unwrap());
        }
    }
    if seed.is_multiple_of(4) {
        let last = document.state().sha256();
        assert_eq!(again(&mut document, 2).sha256(), last, "seed {seed}");
    }
    drop(document);
    let mut document = super::open(&path);
    assert_eq!(document.undo(usize::MAX).unwrap(), hashes.len() - 1);
    assert_eq!(document.state().sha256(), hashes[0], "seed {seed}");
    for hash in &hashes[1..] {
        assert_eq!(document.redo(1).unwrap(), 1);
        assert_eq!(document.state().sha256(), *hash, "seed {seed}");
    }
    assert_eq!(document.undo(usize::MAX).unwrap(), hashes.len() - 1);
    assert_eq!(document.state().sha256(), hashes[0], "seed {seed}");
}

#[test]
fn strokes_in_any_order_are_undone_to_the_first_hash() {
    let mut counts = Count::new();
    for seed in [1, 4] {
        session(seed, 8, &mut counts);
    }
    assert!(counts.len() > 8, "{counts:?}");
}

/// Every kind of stroke, in 24 sessions.
#[test]
#[ignore = "minutes"]
fn strokes_of_every_tool_are_undone_to_the_first_hash() {
    let mut counts = Count::new();
    for seed in 100..124 {
        session(seed, 24, &mut counts);
    }
    for (kind, ([changed, nothing, refused], why)) in &counts {
        println!("{changed} {nothing} {refused}: {}\n    {why}", STROKES[*kind]);
    }
    let at_work = counts.values().filter(|(count, _)| count[0] > 0).count();
    assert!(4 * at_work > 3 * STROKES.len(), "{at_work} of {}", STROKES.len());
}
