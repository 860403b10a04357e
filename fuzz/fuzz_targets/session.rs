#![no_main]
//! A script of any text: an error, or strokes that are the same after they were written down and read again, each of which can
//! be done on a small ball or says why not.

use std::sync::OnceLock;

use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::AnyField;
use document::{Command, CommandError, Object, State};
use fitting::{Cancel, Control, Progress};
use formats::field::FieldMeta;
use glam::{DAffine3, DVec3};
use libfuzzer_sys::fuzz_target;

/// Control steps after which a stroke is stopped.
const PATIENCE: usize = 12;
/// A tool finer than this may rightly take more memory than the fuzzer grants.
const FINEST: f64 = 0.4;

fn ball() -> State {
    let lattice = Lattice { world_from_lattice: DAffine3::IDENTITY, cells: [6; 3] };
    let field: HierarchicalSpline<f32> =
        HierarchicalSpline::schoenberg(lattice, 1.0, |p| 2.0 - p.distance(DVec3::splat(3.0))).unwrap();
    let meta = FieldMeta { iso: Some(0.0), ..FieldMeta::default() };
    let object = Object::new(&AnyField::F32(field), meta).unwrap();
    State::new().with("a", object).unwrap()
}

/// The command with nothing finer than the ball is, if it is a stroke.
fn bounded(command: Command) -> Option<Command> {
    let Command::Stroke { object, mut stroke } = command else { return None };
    stroke.coarse = Some(0);
    let radii = [
        stroke.pull.as_ref().map(|tool| tool.radius),
        stroke.chisel.as_ref().map(|tool| tool.radius),
        stroke.squirt.as_ref().map(|tool| tool.radius),
        stroke.drill.as_ref().map(|tool| tool.radius),
        stroke.join.as_ref().map(|tool| tool.radius),
    ];
    let is_fine = radii.into_iter().flatten().any(|radius| radius.0 < FINEST);
    (!is_fine && stroke.refine.is_none()).then_some(Command::Stroke { object, stroke })
}

fuzz_target!(|bytes: &[u8]| {
    static BALL: OnceLock<State> = OnceLock::new();
    let state = BALL.get_or_init(ball);
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let object = |own: Option<&str>| Ok::<_, CommandError>(own.unwrap_or("a").into());
    let Ok(commands) = Command::of_script(text, object) else { return };
    for command in commands.into_iter().take(3) {
        let value = command.to_value();
        let again: Command = serde_json::from_value(value.clone()).expect("what was written can be read");
        assert_eq!(again.to_value(), value);
        let _ = command.title();
        let Some(command) = bounded(command) else { continue };
        let cancel = Cancel::new();
        let (stop, mut steps) = (cancel.clone(), 0);
        let on_progress = Box::new(move |_: Progress| {
            steps += 1;
            if steps > PATIENCE {
                stop.cancel();
            }
        });
        let before = state.sha256();
        let _ = command.apply(state, &mut Control { on_progress, cancel, ..Control::default() });
        assert_eq!(state.sha256(), before);
    }
});
