//! Many inputs at once: each in processes of its own, so that none takes another with it, and with a manifest, so that
//! nothing is done twice.

mod board;
pub mod child;
mod choice;
mod digest;
mod gather;
mod glob;
mod job;
mod manifest;
mod merge;
mod name;
mod report;
mod shard;
mod totals;

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use fitting::Cancel;
use formats::atomic::PassingDirectory;

use super::ceiling::share;
use super::failure::{Failure, OrFail, Outcome};
use super::interrupt;
use super::quantity::{Memory, duration, human_bytes, threads};
use board::Board;
use choice::Choice;
use gather::{Gathered, Item};
use job::Plan;
use manifest::{Entry, Manifest, Run};
use shard::Shard;
use totals::Totals;

/// Arguments of `isoclay batch`.
#[derive(clap::Args)]
pub struct Args {
    /// Clouds, meshes and volumes, folders of them, patterns such as 'scans/**/*.ply'. The folder of a DICOM series or of
    /// TIFF slices is one input
    #[arg(required_unless_present = "merge")]
    inputs: Vec<PathBuf>,
    /// Directory for fields, meshes, pictures, manifest and report; made if missing
    #[arg(short, long, value_name = "DIR", required_unless_present = "merge")]
    output: Option<PathBuf>,
    #[command(flatten)]
    choice: Choice,
    /// Inputs to work on at the same time [default: one a core]
    #[arg(long, value_name = "N", value_parser = threads)]
    jobs: Option<NonZeroUsize>,
    /// Threads of each [default: so many that all cores have work]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Memory that all of it may hold, shared out among the jobs, such as 8GiB
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Time for each input, such as 90s, 10m or 2h; then it is ended and has failed
    #[arg(long, value_name = "TIME", value_parser = duration, default_value = "2h")]
    time_limit: Duration,
    /// Go on with what an earlier run in this directory left undone
    #[arg(long)]
    resume: bool,
    /// Do one of N shares of the inputs, the first is 1: each machine its own, with the same inputs and options
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// No pictures and no report.html
    #[arg(long)]
    no_report: bool,
    /// Join the manifests of the shards in this directory, and write summary and report from them
    #[arg(long, value_name = "DIR", conflicts_with_all = [
        "inputs", "output", "shard", "resume", "jobs", "threads", "time_limit", "tolerance", "volume_tolerance", "coefficients",
        "max_depth", "unoriented", "robust", "shape", "unit", "precision", "mesh",
    ])]
    merge: Option<PathBuf>,
    /// Print a JSON object for each input that has ended, and one for the whole
    #[arg(long)]
    pub json: bool,
}

/// Does a batch, or joins the shards of one.
pub fn run(args: &Args) -> Outcome {
    match (&args.merge, &args.output) {
        (Some(directory), _) => merge::run(directory, args.json, !args.no_report),
        (None, Some(directory)) => fit_all(args, directory),
        (None, None) => Err(Failure::usage("-o: is missing; name a directory for the results")),
    }
}

fn fit_all(args: &Args, directory: &Path) -> Outcome {
    let start = Instant::now();
    let cancel = interrupt::cancel();
    let gathered = gather(args, directory, &cancel)?;
    let total = gathered.items.len();
    let items: Vec<Item> = (gathered.items.into_iter().enumerate())
        .filter(|(place, _)| args.shard.is_none_or(|s| s.holds(*place)))
        .map(|(_, item)| item)
        .collect();

    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let jobs = (args.jobs.map_or(cores, NonZeroUsize::get)).clamp(1, items.len().max(1));
    let threads = args.threads.map_or((cores / jobs).max(1), NonZeroUsize::get);
    let memory = args.memory.map(|m| share_of(m, jobs)).transpose()?;
    let has_pictures = !args.no_report;
    let mut parameters = args.choice.record();
    parameters.insert("pictures".into(), has_pictures.into());
    if let Some(Memory(bytes)) = memory {
        // A fit that is short of memory ends coarser.
        parameters.insert("memory_each".into(), bytes.into());
    }

    job::make_directory(directory)?;
    let path = shard::manifest(directory, args.shard);
    let (mut manifest, found) = Manifest::open(&path)?;
    if !args.resume && found.run.is_some() {
        return Err(Failure::usage(format!(
            "-o {}: holds a batch already; go on with it by --resume, or name another directory",
            directory.display()
        )));
    }
    let inputs = (items.iter())
        .map(|i| (i.name.clone(), i.path.display().to_string()))
        .collect();
    let run = Run::new(parameters, args.shard, total, inputs);
    manifest.begin(&found, &run)?;

    // What an earlier run was killed over lies beside; it was of this share alone, which nobody else works on.
    let work = directory.join(
        args.shard
            .map_or(".work".into(), |s| format!(".work-{}-of-{}", s.index, s.count)),
    );
    let _ = std::fs::remove_dir_all(&work);
    let whole = ["summary.json", "summary.csv", "report.html"].map(|name| directory.join(name));
    let own = if args.shard.is_none() { &whole[..] } else { &[] };
    for target in own.iter().chain([&path]) {
        formats::atomic::clear_left(target).or_limit()?;
    }
    let made = formats::atomic::MadeDirectory::new(&work).or_limit()?;
    let scratch = PassingDirectory::new(Some(&work)).or_limit()?;
    let plan = Plan {
        choice: &args.choice,
        parameters: &run.parameters,
        directory,
        work: scratch.path(),
        threads,
        memory,
        time_limit: Some(args.time_limit),
        has_pictures,
        cancel: &cancel,
    };
    let board = Board::new(items.iter(), jobs, args.json);
    let done = work_off(&plan, &items, jobs, &board, &found.entries, Mutex::new(manifest));
    board.clear();
    let (entries, kept, manifest) = done?;
    drop((scratch, made));
    if cancel.is_cancelled() {
        return Err(Failure::limit(format!(
            "the work was cancelled after {} of {} inputs; the same command with --resume goes on",
            entries.len(),
            items.len()
        )));
    }
    manifest::replace(&path, &run, &entries)?;
    drop(manifest);
    let mut totals = Totals::new(
        std::slice::from_ref(&run),
        &entries,
        start.elapsed().as_secs_f64(),
    );
    totals.kept = kept;
    totals.skipped = gathered.skipped.iter().map(|p| p.display().to_string()).collect();
    if args.shard.is_none() {
        totals.write(directory, &entries)?;
        if has_pictures {
            report::write(directory, &totals, &entries)?;
        }
    }
    totals.tell(directory, args.json)
}

/// The inputs, looked at before anything is made.
fn gather(args: &Args, directory: &Path, cancel: &Cancel) -> Outcome<Gathered> {
    let is_one =
        |a: &Path, b: &Path| matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b);
    for input in &args.inputs {
        if input == Path::new("-") {
            return Err(Failure::usage(
                "-: a batch reads files, and standard input has no name; isoclay fit reads it",
            ));
        }
        if is_one(input, directory) {
            return Err(Failure::usage(format!(
                "-o {}: is the folder that is read; name another directory",
                directory.display()
            )));
        }
    }
    let gathered = Gathered::new(&args.inputs, directory, cancel)?;
    let is_trouble = |i: &Item| i.trouble.is_some();
    if let Some(first) = gathered
        .items
        .first()
        .filter(|_| gathered.items.iter().all(is_trouble))
    {
        return Err(Failure::input(format!(
            "{}: {}",
            first.path.display(),
            first.trouble.as_deref().unwrap_or_default()
        )));
    }
    Ok(gathered)
}

fn share_of(memory: Memory, jobs: usize) -> Outcome<Memory> {
    share(memory, jobs).ok_or_else(|| {
        Failure::usage(format!(
            "--memory {}: is too little for {jobs} jobs at a time; raise it, or lower --jobs",
            human_bytes(memory.0)
        ))
    })
}

/// All inputs, on so many threads; what came of them, by the names of outputs, and how many were done before.
fn work_off(
    plan: &Plan,
    items: &[Item],
    jobs: usize,
    board: &Board,
    found: &BTreeMap<String, Entry>,
    manifest: Mutex<Manifest>,
) -> Outcome<(BTreeMap<String, Entry>, usize, Mutex<Manifest>)> {
    let next = AtomicUsize::new(0);
    let kept = AtomicUsize::new(0);
    let done = Mutex::new(BTreeMap::new());
    let trouble = Mutex::new(None);
    let work = |job: usize| {
        while !plan.cancel.is_cancelled() && locked(&trouble).is_none() {
            let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) else {
                return;
            };
            let show = |stage: &str, fraction: f64| board.show(job, item, stage, fraction);
            let (entry, is_kept) = match isolated(plan, item, found.get(&item.name), &show) {
                Ok(Some(ended)) => ended,
                Ok(None) => return,
                Err(e) => {
                    locked(&trouble).get_or_insert(e);
                    return;
                }
            };
            if !is_kept && let Err(e) = locked(&manifest).add(&entry) {
                locked(&trouble).get_or_insert(e);
                return;
            }
            kept.fetch_add(usize::from(is_kept), Ordering::Relaxed);
            board.ended(job, item, &entry, is_kept);
            locked(&done).insert(item.name.clone(), entry);
        }
    };
    std::thread::scope(|scope| {
        for job in 0..jobs {
            scope.spawn(move || work(job));
        }
    });
    match trouble.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(e) => Err(e),
        None => Ok((
            done.into_inner().unwrap_or_else(PoisonError::into_inner),
            kept.into_inner(),
            manifest,
        )),
    }
}

fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An input that not even an error of this program itself gets past.
fn isolated(
    plan: &Plan,
    item: &Item,
    found: Option<&Entry>,
    show: &dyn Fn(&str, f64),
) -> Outcome<Option<(Entry, bool)>> {
    match catch_unwind(AssertUnwindSafe(|| plan.one(item, found, show))) {
        Ok(done) => done,
        Err(_) => {
            let broken = Item {
                trouble: Some("the program itself is at fault; please report it with this file".into()),
                ..item.clone()
            };
            plan.one(&broken, None, show)
        }
    }
}
