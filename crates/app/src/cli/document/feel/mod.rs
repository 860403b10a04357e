//! A hand on a document, through a device.

mod report;
mod script;
mod tally;
mod tool;

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use clap::ValueEnum;
use document::{Object, State};
use glam::DVec3;
use tools::haptics::gates::GateOptions;
use tools::haptics::simulated::SimulatedDevice;
use tools::haptics::{
    Abilities, Coupling, Demand, Device, Embedding, PointTool, Proxy, ProxyOptions, Servo, ServoOptions,
    TickRecord, Unresolved, Vcp, VcpOptions, Workspace,
};

use super::{Told, chosen, failure, open};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::interrupt;
use crate::cli::output::Output;
use crate::cli::progress::Bar;
use crate::cli::quantity::{human_count, human_number, positive};
use crate::cli::simulate;
use crate::cli::source::Source;
use crate::devices::{self, Force, Name};
use crate::threads::rehearsal::Rehearsal;
use crate::threads::sculpting::Sculpting;
use crate::threads::touch::Toucher;
use crate::threads::{Session, Show};
use report::Felt;
use script::Script;
use tally::{Tally, write_trace};
use tool::Tool;

/// Time from step to step of the simulation, s.
const STEP: f64 = 1.0 / 30.0;
/// What may be touched is known so far about the hand, mm of the device.
const REACH: f64 = 15.0;
/// Nodes of what may be touched of an object: as many as are made anew in a step of the simulation. With all that snapshots allow, carving a scan of thin
/// parts took steps of 160 ms where these take 19.
const NODES: usize = 60_000;
/// Longest time from tick to tick, s.
const TICK: f64 = 1e-3;
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
    let named: Name = args
        .device
        .parse()
        .map_err(|why| Failure::usage(format!("--device {}: {why}", args.device)))?;
    let is_real = !matches!(named, Name::Simulated(_));
    if !is_real && !script.has_targets() {
        let why = "there is no target; write one [[target]] with time and at, or more";
        return Err(about(why.into()));
    }
    let tool = args.tool.points(&cancel)?;
    if tool.is_some() && args.contact == ContactMode::Vcp {
        let why = "--contact vcp: is for the ball; leave it out, or --tool";
        return Err(Failure::usage(why));
    }
    let output = args.output.as_ref();
    let output = output.map(|path| Output::check("-o", path, &["csv"], None, &[&source]));
    let output = output.transpose()?;
    let usual = if is_real { REAL } else { script.end() + REST };
    let seconds = args.seconds.unwrap_or(usual);
    let mut notes = Vec::new();
    let document = open(&args.document, &mut notes)?;
    let name = chosen(document.state(), args.object.as_deref())?.to_string();
    let (held, workspace) = match &named {
        Name::Simulated(preset) => {
            let mechanics = preset.mechanics();
            let workspace = workspace(document.state(), &name, mechanics.reach, args.scale)?;
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
            let workspace = workspace(document.state(), &name, reach, args.scale)?;
            (Held::Real(Box::new(device)), workspace)
        }
    };
    let servo = servo(args, tool.as_ref(), held.abilities(), workspace)?;
    notes.extend(servo.granted().note());
    let unresolved = Arc::default();
    let show = show(
        args,
        tool.as_ref(),
        document.state(),
        &name,
        &workspace,
        &unresolved,
    )?;
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
fn servo(
    args: &Args,
    tool: Option<&PointTool>,
    abilities: &Abilities,
    workspace: Workspace,
) -> Outcome<Servo> {
    let scale = workspace.scale;
    let options = ServoOptions {
        stiffness: args.stiffness,
        period: abilities.period.min(TICK),
        workspace,
        gates: GateOptions {
            force: args.force.unwrap_or(f64::INFINITY),
            ..GateOptions::default()
        },
        ..ServoOptions::default()
    };
    let radius = args.radius * scale;
    let servo = Servo::new(abilities, options, |stiffness, damping| {
        if let Some(tool) = tool {
            return tool::renderer(tool, stiffness * scale, damping * scale, scale);
        }
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

/// What may be touched, and the worst that was too thin for it.
fn show(
    args: &Args,
    tool: Option<&PointTool>,
    state: &State,
    name: &str,
    workspace: &Workspace,
    unresolved: &Arc<Mutex<Option<Unresolved>>>,
) -> Outcome<Show> {
    let object = object(state, name)?;
    if object.meta.iso.is_none() {
        let why = format!("object {name:?} names no surface; fit it with an iso-value");
        return Err(Failure::input(why));
    }
    let placed = state.placement(name).map_err(failure)?;
    let lattice = object.field.lattice();
    let cell = (placed * lattice.world_from_lattice).matrix3;
    let knots = cell.x_axis.length() / f64::from(1_u32 << object.detail().min(31));
    let scale = workspace.scale;
    let demand = match tool {
        Some(tool) => tool::demand(tool, scale),
        None => {
            let usual = Demand::of_ball(args.radius * scale);
            Demand {
                reach: (REACH * scale).max(4.0 * usual.radius),
                ..usual
            }
        }
    };
    let mut toucher = Toucher::new(Demand {
        detail: knots,
        most_nodes: NODES,
        ..demand
    });
    let unresolved = Arc::clone(unresolved);
    Ok(Box::new(move |state, at| {
        let snapshot = toucher.show(state, at);
        // Nobody else looks before the end.
        if let (Some(now), Ok(mut worst)) = (snapshot.unresolved(), unresolved.lock()) {
            let before = worst.filter(|before| (before.missed, before.thin) > (now.missed, now.thin));
            *worst = before.or(Some(now));
        }
        snapshot
    }))
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
