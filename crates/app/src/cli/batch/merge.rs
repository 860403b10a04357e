//! The shards of a batch, joined: as if one machine had done all of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::super::failure::{Failure, Outcome};
use super::manifest::{self, Entry, Found, Manifest, Run};
use super::report;
use super::shard::{self, Shard};
use super::totals::Totals;

/// Joins what is in `directory`: shards, or the manifest of a whole batch, whose summary is then written anew.
pub fn run(directory: &Path, is_json: bool, has_report: bool) -> Outcome {
    let start = Instant::now();
    let shards = shards(directory)?;
    let whole = shard::manifest(directory, None);
    if shards.is_empty() && !whole.exists() {
        return Err(Failure::input(format!(
            "--merge {}: there is no manifest of a batch; give the directory that was named by -o",
            directory.display()
        )));
    }
    let (mut runs, mut entries) = (Vec::new(), BTreeMap::new());
    let paths = if shards.is_empty() {
        vec![whole.clone()]
    } else {
        shards.iter().map(|(_, path)| path.clone()).collect()
    };
    for path in paths {
        let found = Found::read(&path)?;
        let Some(run) = found.run else {
            return Err(Failure::input(format!(
                "{}: holds no run of a batch; do this shard again by --resume",
                path.display()
            )));
        };
        // Inputs of an earlier run that this one has no more are no part of it.
        let own = run.inputs.iter().filter_map(|(name, _)| found.entries.get(name));
        entries.extend(own.map(|e| (e.name.clone(), e.clone())));
        runs.push(run);
    }
    let notes = check(directory, &shards, &runs)?;
    let mut totals = Totals::new(&runs, &entries, start.elapsed().as_secs_f64());
    // Shards that are not there have inputs too, of which nothing is known but how many they are.
    let missing = runs[0].total.saturating_sub(totals.inputs);
    totals.inputs += missing;
    totals.pending += missing;
    totals.notes = notes;
    if !shards.is_empty() && missing == 0 {
        join(&whole, &runs, &totals, &entries)?;
    }
    totals.write(directory, &entries)?;
    if has_report {
        report::write(directory, &totals, &entries)?;
    }
    totals.tell(directory, is_json)
}

/// The manifests of shards in a directory, in order.
fn shards(directory: &Path) -> Outcome<Vec<(Shard, PathBuf)>> {
    let listed = directory
        .read_dir()
        .map_err(|e| Failure::input(format!("--merge {}: {e}; check the path", directory.display())))?;
    let mut found: Vec<(Shard, PathBuf)> = (listed.flatten())
        .filter_map(|e| Some((shard::of_manifest(e.file_name().to_str()?)?, e.path())))
        .collect();
    found.sort_by_key(|(s, _)| (s.count, s.index));
    Ok(found)
}

/// Refuses what is no one batch; tells what is missing.
fn check(directory: &Path, shards: &[(Shard, PathBuf)], runs: &[Run]) -> Outcome<Vec<String>> {
    let fail = |what: &str| {
        Err(Failure::input(format!(
            "--merge {}: the manifests there differ in {what}, so they are of different batches; keep each batch in a \
             directory of its own",
            directory.display()
        )))
    };
    let Some((first, _)) = shards.first() else {
        return Ok(Vec::new());
    };
    if shards.iter().any(|(s, _)| s.count != first.count) {
        return fail("the number of shards");
    }
    if runs.iter().any(|r| r.parameters != runs[0].parameters) {
        return fail("their options");
    }
    if runs.iter().any(|r| r.program != runs[0].program) {
        return fail("the version of the program");
    }
    if runs.iter().any(|r| r.total != runs[0].total) {
        return fail("the number of inputs");
    }
    let missing: Vec<String> = (1..=first.count)
        .filter(|i| shards.iter().all(|(s, _)| s.index != *i))
        .map(|i| format!("{i}/{}", first.count))
        .collect();
    Ok(if missing.is_empty() {
        Vec::new()
    } else {
        vec![format!("shards not there: {}", missing.join(", "))]
    })
}

/// Writes the manifest of the whole.
fn join(path: &Path, runs: &[Run], totals: &Totals, entries: &BTreeMap<String, Entry>) -> Outcome {
    let (held, _) = Manifest::open(path)?;
    let mut run = runs[0].clone();
    (run.shard, run.inputs) = (None, totals.order().to_vec());
    manifest::replace(path, &run, entries)?;
    drop(held);
    Ok(())
}
