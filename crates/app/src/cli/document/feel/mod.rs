//! A hand on a document, through a device.

mod report;
mod script;
mod tally;
mod tool;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tools::haptics::simulated::SimulatedDevice;
use tools::haptics::{Abilities, Device, Embedding, TickRecord, Unresolved};

use super::{Told, chosen, failure, open, open_to_change};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::interrupt;
use crate::cli::output::Output;
use crate::cli::progress::Bar;
use crate::cli::quantity::{human_count, human_number, positive};
use crate::cli::simulate;
use crate::cli::source::Source;
use crate::devices::{self, Force, Name};
use crate::threads::Session;
use crate::threads::grip::{ContactMode, Grip, STEP, TICK, workspace};
use crate::threads::rehearsal::Rehearsal;
use crate::threads::sculpting::Sculpting;
use report::Felt;
use script::Script;
use tally::{Tally, write_trace};
use tool::Tool;

/// Time of a session with a device that is not simulated, s.
const REAL: f64 = 60.0;
/// Time after the last target, s.
const REST: f64 = 0.5;

/// Arguments of `isoclay feel`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Device in the hand: sim:omni and others that are simulated, or one of those that `isoclay devices` names
    #[arg(long, value_name = "DEVICE")]
    device: String,
    /// What the hand does, or of a real one only what its first button does (.toml, or .jsonl with an object a line); - reads standard input. docs/guide.md lists what it may say
    #[arg(long, value_name = "SCRIPT")]
    script: PathBuf,
    /// Object to work on, where there are several
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Also write what happened in every tick (.csv); - writes to standard output
    #[arg(short, long, value_name = "TRACE")]
    pub output: Option<PathBuf>,
    /// Stiffness at the hand, N/m, as far as the device holds it
    #[arg(long, value_name = "N/M", default_value = "500", value_parser = positive)]
    stiffness: f64,
    /// Largest force, N; that of the device counts besides. A device that is plugged in pushes only if this is said
    #[arg(long, value_name = "N", value_parser = positive)]
    force: Option<f64>,
    /// Radius of the ball that touches, mm of the device
    #[arg(long, value_name = "MM", default_value = "2", value_parser = positive)]
    radius: f64,
    /// What touches: ball, or with its sizes in mm of the device a tool of many points that turns and feels torque: sphere:5, cylinder:4x12, box:10x10x10, plate:20x30x1, spatula:10x30x1, knife:12x30x2, or points:FILE, the vertices of a mesh or cloud
    #[arg(long, value_name = "TOOL", default_value = "ball")]
    tool: Tool,
    /// Lengths of the document for one mm of the device [default: as many as let the object fit the device's room]
    #[arg(long, value_parser = positive)]
    scale: Option<f64>,
    /// How contact is found: by a proxy that the solid keeps out, or anew in every tick
    #[arg(long, value_name = "MODE", default_value = "proxy")]
    contact: ContactMode,
    /// Time that it takes, s [default: half a second more than the script; of a device that is not simulated 60]
    #[arg(long, value_name = "S", value_parser = positive)]
    seconds: Option<f64>,
    /// Use three threads and the clock in place of virtual time; any device that is not simulated does
    #[arg(long)]
    real_time: bool,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Lets a hand follow a script on a document. Strokes that its button begins and ends are edits as any other.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    let source = Source::open(&args.script, None, "scripts .toml or .jsonl", &cancel)?.under("--script");
    let about = |why: String| Failure::input(format!("{}: {why}", source.name()));
    let script = Script::parse(&simulate::text(&source)?).map_err(about)?;
    let named: Name = args
        .device
        .parse()
        .map_err(|why| Failure::usage(format!("--device {}: {why}", args.device)))?;
    let is_real = !matches!(named, Name::Simulated(_));
    if !is_real && !script.has_targets() {
        let why = "there is no target; write one [[target]] with time and at, or more";
        return Err(about(why.into()));
    }
    let grip = Grip {
        stiffness: args.stiffness,
        force: args.force.unwrap_or(f64::INFINITY),
        radius: args.radius,
        tool: args.tool.points(&cancel)?,
        contact: args.contact,
    };
    if grip.tool.is_some() && args.contact == ContactMode::Vcp {
        let why = "--contact vcp: is for the ball; leave it out, or --tool";
        return Err(Failure::usage(why));
    }
    let output = args.output.as_ref();
    let output = output.map(|path| Output::check("-o", path, &["csv"], None, &[&source]));
    let output = output.transpose()?;
    let usual = if is_real { REAL } else { script.end() + REST };
    let seconds = args.seconds.unwrap_or(usual);
    let mut notes = Vec::new();
    let opened = if grip.tool.is_some() { open_to_change } else { open };
    let document = opened(&args.document, &mut notes)?;
    let name = chosen(document.state(), args.object.as_deref())?.to_string();
    let (held, workspace) = match &named {
        Name::Simulated(preset) => {
            let mechanics = preset.mechanics();
            let workspace =
                workspace(document.state(), &name, mechanics.reach, args.scale).map_err(failure)?;
            let hand = script.hand(&workspace, seconds);
            let device = SimulatedDevice::new(mechanics, hand);
            (Held::Simulated(Box::new(device)), workspace)
        }
        named => {
            // Nobody is pushed who did not say how hard.
            let force = match args.force {
                Some(_) => Force::Allowed,
                None => Force::Withheld,
            };
            let device = devices::open(named, force)
                .map_err(|why| Failure::input(format!("--device {}: {why}", args.device)))?;
            let reach = device.abilities().reach;
            let workspace = workspace(document.state(), &name, reach, args.scale).map_err(failure)?;
            (Held::Real(Box::new(device)), workspace)
        }
    };
    let servo = grip.servo(held.abilities(), workspace).map_err(Failure::usage)?;
    notes.extend(servo.granted().note());
    let unresolved = Arc::default();
    let show = grip.show(document.state(), &name, &workspace, &unresolved)?;
    let granted = servo.granted();
    let mut sculpting = Sculpting::new(document, name, script.stroke.clone());
    if let Some(rate) = script.rate {
        sculpting = sculpting.embedding(Embedding { rate: rate.0 }, STEP);
    }
    let mut tally = Tally::default();
    let mut records = Vec::new();
    let mut keep = |record: &TickRecord| {
        tally.add(record, workspace.scale);
        if output.is_some() {
            records.push(*record);
        }
    };
    let bar = Bar::new();
    let goes_on = |passed: f64| {
        bar.show("feeling", passed / seconds);
        !cancel.is_cancelled()
    };
    let held = match held {
        Held::Simulated(device) if args.real_time => Held::Real(Box::new(device.self_timed())),
        held => held,
    };
    let (sculpting, threads) = match held {
        Held::Real(device) => {
            let session = Session {
                tick: Duration::from_secs_f64(device.abilities().period.min(TICK)),
                device,
                servo,
                sculpting,
                show,
                step: Duration::from_secs_f64(STEP),
            };
            let start = std::time::Instant::now();
            let lasts = || {
                let passed = start.elapsed().as_secs_f64();
                passed < seconds && goes_on(passed)
            };
            let (sculpting, report) = session.run(lasts, &mut keep).map_err(failure)?;
            (sculpting, Some(report))
        }
        Held::Simulated(device) => {
            let mut rehearsal = Rehearsal {
                device: *device,
                servo,
                sculpting,
                show,
                step: STEP,
            };
            let mut control = bar.control(&cancel);
            let run = rehearsal.run(seconds, &mut control, goes_on, &mut keep);
            run.map_err(failure)?;
            (rehearsal.sculpting, None)
        }
    };
    bar.clear();
    interrupt::check(&cancel)?;
    let (mut document, strokes, told) = sculpting.close();
    notes.extend(told);
    notes.extend(unresolved.lock().ok().and_then(|worst| worst.map(too_thin)));
    let felt = Felt::new(
        &args.device,
        granted,
        &workspace,
        tally,
        strokes,
        threads.as_ref(),
    );
    let told = Told::of(&mut document, notes)?;
    if let Some(output) = &output {
        let written = formats::atomic::replace(output.path(), |out| write_trace(&records, out));
        written.map_err(|e| output.writing(e))?;
        output.finish()?;
    }
    felt.print(told, args.json, output.as_ref().is_some_and(Output::is_stdout))
}

/// What is in the hand.
enum Held {
    /// A device that is computed, with the hand.
    Simulated(Box<SimulatedDevice>),
    /// One that only the clock moves on.
    Real(Box<dyn Device>),
}

impl Held {
    fn abilities(&self) -> &Abilities {
        match self {
            Self::Simulated(device) => device.abilities(),
            Self::Real(device) => device.abilities(),
        }
    }
}

/// What a hand cannot feel, and what helps.
fn too_thin(found: Unresolved) -> String {
    let helps = "a smaller --radius shows finer parts";
    match found.missed {
        0 => format!(
            "at {} places sheets or gaps are only {} thick and feel blurred; {helps}",
            human_count(found.thin),
            human_number(found.thinnest)
        ),
        missed => format!(
            "at {} places what is there is too thin to be felt; {helps}",
            human_count(missed)
        ),
    }
}
