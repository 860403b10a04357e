//! Programs that are killed while they write.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use document::{Document, Options, Properties, State};
use fitting::Control;
use glam::{DAffine3, DVec3};
use serde_json::Value;
use tempfile::tempdir;

use super::common::{Draw, ball, dented, object};
use super::knots;

const PATH: &str = "ISOCLAY_TEST_DOCUMENT";
const KIND: &str = "ISOCLAY_TEST_EDITS";

/// What a writer does without end.
#[derive(Clone, Copy)]
struct Kind {
    name: &'static str,
    first: fn() -> State,
    /// Title, command and state of an edit, another one for each number.
    next: fn(&State, u32) -> (String, Value, State),
    quota: u64,
    /// Within these it is killed after its first edit.
    microseconds: u32,
}

const KINDS: [Kind; 2] = [
    Kind {
        name: "dents",
        first: || State::new().with("a", object(&ball())).unwrap(),
        next: |state, n| ("dent".into(), Value::Null, dented(state, "a", n)),
        quota: 60_000,
        microseconds: 30_000,
    },
    Kind {
        name: "knots",
        first: || knots::state_of(knots::uneven()),
        next: stroke_on_knots,
        quota: 4_000_000,
        microseconds: 700_000,
    },
];

/// Strokes on a block with knots of its own: such as leave it its knots, then some for which it is written in levels; then a new block.
fn stroke_on_knots(state: &State, n: u32) -> (String, Value, State) {
    let x = f64::from(n % 977) / 977.0;
    let tool = match n % 11 {
        0 => format!(
            "paint = {{ layer = 'stiffness', brush = {{ along = [[{x}, 1, 1]], radius = 1.5, value = 4 }} }}"
        ),
        1 => format!("refine = {{ along = [[{}, 2, 1]], radius = 0.5 }}", 3.0 * x),
        2 => format!("hold = {{ name = 'top', points = [[{x}, 0, 2]] }}"),
        3 => format!("place = {{ by = [{x}, 2, 3], turn = [0, 0, 30] }}"),
        4 => format!("paint = {{ layer = 'mass', formula = '2 + {x} * x^2' }}"),
        5 => "free = { name = 'top' }".into(),
        6 => format!("carve = {{ along = [[{x}, 1, 2]], shape = {{ sphere = {{ radius = 0.6 }} }} }}"),
        7 => format!("push = {{ along = [[{x}, 0, 2]], radius = 1.5, speed = 0.1 }}"),
        8 => "material = { solid = 'elastic' }".into(),
        9 => format!("pull = {{ along = [[{x}, -1, 2]], lift = 0.4, radius = 0.5 }}"),
        _ => {
            let first = knots::state_of(knots::uneven());
            let mut block = first.object("block").unwrap().clone();
            block.properties = Properties::placed(DAffine3::from_translation(DVec3::splat(f64::from(n))));
            return ("anew".into(), Value::Null, state.with("block", block).unwrap());
        }
    };
    let command = knots::commands(&format!("[[stroke]]\n{tool}")).remove(0);
    // After a kill a hold may be there, or not.
    let next = match command.apply(state, &mut Control::default()) {
        Ok((next, _)) => next,
        Err(refusal) => {
            assert!(tool.contains("'top'"), "{tool}: {refusal}");
            state.clone()
        }
    };
    (command.title(), command.to_value(), next)
}

fn hex(hash: &[u8; 32]) -> String {
    hash.iter().map(|b| format!("{b:02x}")).collect()
}

/// Edits a document without end; tells each that it begins, and each that is safe.
#[test]
#[ignore = "run by those that kill it"]
fn endless_writer() {
    let told = |name| std::env::var(name).expect("set by the test that runs this");
    let kind = told(KIND);
    let kind = KINDS.iter().find(|k| k.name == kind).unwrap();
    let options = Options {
        quota: kind.quota,
        ..Options::default()
    };
    let mut document = Document::open(Path::new(&told(PATH)), options).unwrap().document;
    // On goes what was begun.
    let mut count = document.history().unwrap().len() as u32 + document.counts().unwrap().forgotten as u32;
    loop {
        let (title, command, next) = (kind.next)(document.state(), count);
        println!("begun {}", hex(&next.sha256()));
        document.commit(&title, command, next).unwrap();
        println!("safe {}", hex(&document.state().sha256()));
        count += 1;
    }
}

/// Kills a writer of one document at random moments.
fn killed(kind: &Kind, times: u32) {
    let directory = tempdir().unwrap();
    let path = directory.path().join("killed.isoclay");
    drop(Document::create(&path, (kind.first)(), Options::default()).unwrap());
    let mut draw = Draw(5);
    let mut torn = 0;
    for time in 0..times {
        let mut writer = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "killed::endless_writer",
                "--ignored",
                "--nocapture",
                "--test-threads=1",
            ])
            .env(PATH, &path)
            .env(KIND, kind.name)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(writer.stdout.take().unwrap()).lines();
        // Of the last that was begun, and the last that was safe. What runs the writer may put words before its first line.
        let mut told = [String::new(), String::new()];
        let hear = |told: &mut [String; 2], line: &str| {
            for (told, word) in told.iter_mut().zip(["begun ", "safe "]) {
                if let Some((_, hash)) = line.split_once(word) {
                    *told = hash.into();
                }
            }
        };
        let mut all = lines.by_ref().map_while(Result::ok);
        while told[1].is_empty() {
            hear(&mut told, &all.next().expect("it writes"));
        }
        std::thread::sleep(Duration::from_micros(u64::from(draw.below(kind.microseconds))));
        writer.kill().unwrap();
        writer.wait().unwrap();
        lines
            .map_while(Result::ok)
            .for_each(|line| hear(&mut told, &line));
        let opened = Document::open(&path, Options::default()).unwrap();
        assert!(
            opened.lost.as_ref().is_none_or(|lost| lost.is_torn),
            "{:?}",
            opened.lost
        );
        torn += u32::from(opened.lost.is_some());
        let now = hex(&opened.document.state().sha256());
        assert!(told.contains(&now), "kill {time}: {now} is none of {told:?}");
        if time % 50 == 49 {
            println!("{}: killed {} times", kind.name, time + 1);
        }
    }
    let mut document = Document::open(&path, Options::default()).unwrap().document;
    let counts = document.counts().unwrap();
    println!(
        "{}: killed {times} times, {torn} records torn, {} edits, {} of them forgotten",
        kind.name,
        counts.done as u64 + counts.forgotten,
        counts.forgotten
    );
}

#[test]
fn a_killed_program_loses_no_edit_that_it_told() {
    killed(&KINDS[0], 30);
    killed(&KINDS[1], 4);
}

#[test]
#[ignore = "minutes"]
fn a_program_killed_two_hundred_times_loses_no_edit_that_it_told() {
    for kind in &KINDS {
        killed(kind, 200);
    }
}
