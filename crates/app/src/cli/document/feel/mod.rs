//! A hand on a document, through a device.

mod report;
mod script;
mod tally;

use std::path::PathBuf;
use std::time::Duration;

use clap::ValueEnum;
use document::{Object, State};
use glam::DVec3;
use tools::haptics::gates::GateOptions;
use tools::haptics::simulated::{Preset, SimulatedDevice};
use tools::haptics::{
    Abilities, Coupling, Demand, Device, Proxy, ProxyOptions, Servo, ServoOptions, TickRecord, Vcp,
    VcpOptions, Workspace,
};

use super::{Told, chosen, failure, open};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::interrupt;
use crate::cli::output::Output;
use crate::cli::progress::Bar;
use crate::cli::quantity::positive;
use crate::cli::simulate;
use crate::cli::source::Source;
use crate::devices;
use crate::threads::rehearsal::Rehearsal;
use crate::threads::sculpting::Sculpting;
use crate::threads::touch::Toucher;
use crate::threads::{Session, Show};
use report::Felt;
use script::Script;
use tally::{Tally, write_trace};

/// Time from step to step of the simulation, s.
const STEP: f64 = 1.0 / 30.0;
/// What may be touched is known so far about the hand, mm of the device.
const REACH: f64 = 15.0;
/// Nodes of what may be touched of an object, where thin parts want them close: as many as are made anew in a step of the simulation.
const NODES: usize = 60_000;
/// Time from tick to tick by the clock.
const TICK: Duration = Duration::from_millis(1);
/// Time after the last target, s.
const REST: f64 = 0.5;

/// Arguments of `isoclay feel`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Device in the hand: sim:ideal, sim:omni, sim:phantom, sim:falcon or sim:wooden, or one that `isoclay devices` lists
    #[arg(long, value_name = "DEVICE")]
    device: String,
    /// What the hand does (.toml, or .jsonl with an object a line); - reads standard input. docs/guide.md lists what it may say
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
    /// Largest force, N; that of the device counts besides. Without it a device that is plugged in does not push
    #[arg(long, value_name = "N", value_parser = positive)]
    force: Option<f64>,
    /// Radius of the ball that touches, mm of the device
    #[arg(long, value_name = "MM", default_value = "2", value_parser = positive)]
    radius: f64,
    /// Lengths of the document for one mm of the device [default: as many as let the object fit the device's room]
    #[arg(long, value_parser = positive)]
    scale: Option<f64>,
    /// How contact is found: by a proxy that the solid keeps out, or anew in every tick
    #[arg(long, value_name = "MODE", default_value = "proxy")]
    contact: ContactMode,
    /// Time that it takes, s [default: half a second more than the script]
    #[arg(long, value_name = "S", value_parser = positive)]
    seconds: Option<f64>,
    /// Use three threads and the clock in place of virtual time
    #[arg(long)]
    real_time: bool,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// How contact is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ContactMode {
    Proxy,
    Vcp,
}

/// Lets a hand follow a script on a document. Strokes that its button begins and ends are edits as any other.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    let source = Source::open(&args.script, None, "scripts .toml or .jsonl", &cancel)?.under("--script");
    let about = |why: String| Failure::input(format!("{}: {why}", source.name()));
    let script = Script::parse(&simulate::text(&source)?).map_err(about)?;
    let held = Held::named(args)?;
    let output = args.output.as_ref();
    let output = output.map(|path| Output::check("-o", path, &["csv"], None, &[&source]));
    let output = output.transpose()?;
    let seconds = args.seconds.unwrap_or(script.end() + REST);
    let mut notes = Vec::new();
    let document = open(&args.document, &mut notes)?;
    let name = chosen(document.state(), args.object.as_deref())?.to_string();
    let abilities = held.abilities();
    let workspace = workspace(document.state(), &name, abilities.reach, args.scale)?;
    let servo = servo(args, &abilities, workspace)?;
    let granted = servo.granted();
    notes.extend(granted.note());
    let show = show(args, document.state(), &name, &workspace)?;
    let sculpting = Sculpting::new(document, name, script.stroke.clone());
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
    let simulated = |mechanics| {
        let hand = script.hand(&workspace, seconds).map_err(about)?;
        Ok::<_, Failure>(SimulatedDevice::new(mechanics, hand))
    };
    let device: Box<dyn Device> = match held {
        Held::Simulated(preset) if !args.real_time => {
            let mut rehearsal = Rehearsal {
                device: simulated(preset.mechanics())?,
                servo,
                sculpting,
                show,
                step: STEP,
            };
            let mut control = bar.control(&cancel);
            let run = rehearsal.run(seconds, &mut control, goes_on, &mut keep);
            run.map_err(failure)?;
            bar.clear();
            interrupt::check(&cancel)?;
            let felt = |tally, strokes| Felt::new(&args.device, granted, &workspace, tally, strokes, None);
            return told(
                args,
                rehearsal.sculpting,
                felt,
                tally,
                &records,
                notes,
                output.as_ref(),
            );
        }
        Held::Simulated(preset) => Box::new(simulated(preset.mechanics())?.self_timed()),
        Held::Plugged(device) => device,
    };
    let session = Session {
        device,
        servo,
        sculpting,
        show,
        tick: TICK,
        step: Duration::from_secs_f64(STEP),
    };
    let start = std::time::Instant::now();
    let lasts = || {
        let passed = start.elapsed().as_secs_f64();
        passed < seconds && goes_on(passed)
    };
    let (sculpting, report) = session.run(lasts, &mut keep).map_err(failure)?;
    bar.clear();
    interrupt::check(&cancel)?;
    let felt = |tally, strokes| Felt::new(&args.device, granted, &workspace, tally, strokes, Some(&report));
    told(args, sculpting, felt, tally, &records, notes, output.as_ref())
}

/// Tells of the end: the document, the trace, and what was counted.
fn told(
    args: &Args,
    sculpting: Sculpting,
    felt: impl FnOnce(Tally, usize) -> Felt,
    tally: Tally,
    records: &[TickRecord],
    mut notes: Vec<String>,
    output: Option<&Output>,
) -> Outcome {
    let (mut document, strokes, told) = sculpting.close();
    notes.extend(told);
    let felt = felt(tally, strokes);
    let told = Told::of(&mut document, notes)?;
    if let Some(output) = output {
        let written = formats::atomic::replace(output.path(), |out| write_trace(records, out));
        written.map_err(|e| output.writing(e.into()))?;
        output.finish()?;
    }
    felt.print(told, args.json, output.is_some_and(Output::is_stdout))
}

/// What is in the hand.
enum Held {
    Simulated(Preset),
    Plugged(Box<dyn Device>),
}

impl Held {
    /// The device of a name. One that is plugged in pushes only if the user says how much.
    fn named(args: &Args) -> Outcome<Self> {
        let name = &args.device;
        if name.starts_with("sim:") {
            return preset(name).map(Self::Simulated);
        }
        let about = |e: &dyn std::fmt::Display| format!("--device {name}: {e}");
        let known: devices::Name = name.parse().map_err(|e| {
            Failure::usage(format!(
                "{}, and {} that are computed",
                about(&e),
                simulated_names()
            ))
        })?;
        if args.seconds.is_none() {
            let why = "a device in a real hand has no end of its own; say --seconds";
            return Err(Failure::usage(about(&why)));
        }
        let force = match args.force {
            Some(_) => devices::Force::Allowed,
            None => devices::Force::Withheld,
        };
        let opened = devices::open(&known, force).map_err(|e| Failure::input(about(&e)))?;
        Ok(Self::Plugged(Box::new(opened)))
    }

    fn abilities(&self) -> Abilities {
        match self {
            Self::Simulated(preset) => preset.mechanics().abilities(),
            Self::Plugged(device) => device.abilities().clone(),
        }
    }
}

fn simulated_names() -> String {
    Preset::ALL.map(|p| format!("sim:{}", p.name())).join(", ")
}

/// The computed device of a name.
fn preset(name: &str) -> Outcome<Preset> {
    let preset = name.strip_prefix("sim:").and_then(Preset::named);
    preset.ok_or_else(|| {
        Failure::usage(format!(
            "--device {name}: names no device that is known here; write one of {}",
            simulated_names()
        ))
    })
}

/// The object in the middle of the device's room.
fn workspace(state: &State, name: &str, reach: f64, scale: Option<f64>) -> Outcome<Workspace> {
    let b = object(state, name)?.field.world_box();
    let placed = state.placement(name).map_err(failure)?;
    let corner = |i: u32| {
        let pick = |axis: u32| f64::from(i >> axis & 1);
        placed.transform_point3(b.min + DVec3::new(pick(0), pick(1), pick(2)) * (b.max - b.min))
    };
    let (mut low, mut high) = (corner(0), corner(0));
    for p in (1..8).map(corner) {
        (low, high) = (low.min(p), high.max(p));
    }
    let fitting = 0.5 * (high - low).max_element() / reach;
    Ok(Workspace {
        scale: scale.unwrap_or(fitting),
        shift: 0.5 * (low + high),
        ..Workspace::default()
    })
}

fn object<'a>(state: &'a State, name: &str) -> Outcome<&'a Object> {
    state.object(name).map_err(failure)
}

/// Coupling and gates as they are wished.
fn servo(args: &Args, abilities: &Abilities, workspace: Workspace) -> Outcome<Servo> {
    let scale = workspace.scale;
    let options = ServoOptions {
        stiffness: args.stiffness,
        period: abilities.period.min(1e-3),
        workspace,
        gates: GateOptions {
            force: args.force.unwrap_or(f64::INFINITY),
            ..GateOptions::default()
        },
        ..ServoOptions::default()
    };
    let radius = args.radius * scale;
    let servo = Servo::new(abilities, options, |stiffness, damping| {
        let coupling = Coupling { stiffness, damping };
        match args.contact {
            ContactMode::Proxy => {
                let usual = ProxyOptions::default();
                Box::new(Proxy::new(ProxyOptions {
                    radius,
                    coupling,
                    push_out: usual.push_out * scale,
                    tolerance: usual.tolerance * scale,
                    ..usual
                }))
            }
            ContactMode::Vcp => {
                let usual = VcpOptions::default();
                Box::new(Vcp::new(VcpOptions {
                    radius,
                    coupling,
                    step: usual.step * scale,
                    ..usual
                }))
            }
        }
    });
    servo.map_err(Failure::usage)
}

/// What may be touched.
fn show(args: &Args, state: &State, name: &str, workspace: &Workspace) -> Outcome<Show> {
    let object = object(state, name)?;
    if object.meta.iso.is_none() {
        let why = format!("object {name:?} names no surface; fit it with an iso-value");
        return Err(Failure::input(why));
    }
    let placed = state.placement(name).map_err(failure)?;
    let lattice = object.field.lattice();
    let cell = (placed * lattice.world_from_lattice).matrix3;
    let knots = cell.x_axis.length() / f64::from(1_u32 << object.detail().min(31));
    let usual = Demand::of_ball(args.radius * workspace.scale);
    let mut toucher = Toucher::new(Demand {
        reach: (REACH * workspace.scale).max(4.0 * usual.radius),
        detail: knots,
        most_nodes: NODES,
        ..usual
    });
    Ok(Box::new(move |state, at| toucher.show(state, at)))
}
