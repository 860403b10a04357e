//! Other programs, run by a small script of Python: that is where most of them live.

use std::fmt;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::str::FromStr;

use serde_json::{Map, Value};

use super::super::failure::{OrFail, Outcome};
use super::super::own;
use super::subject::{Kind, Subject};

/// The script and what it shares with others.
const SCRIPTS: [(&str, &str); 2] = [
    ("peer.py", include_str!("../../../../../benches/peers/peer.py")),
    (
        "common.py",
        include_str!("../../../../../benches/peers/common.py"),
    ),
];

/// Programs: name, what it takes, and how to get it.
const KNOWN: [(&str, Kind, &str); 6] = [
    (
        "PoissonRecon",
        Kind::Cloud,
        "build it from github.com/mkazhdan/PoissonRecon and put it on the PATH",
    ),
    (
        "SSDRecon",
        Kind::Cloud,
        "build it from github.com/mkazhdan/PoissonRecon and put it on the PATH",
    ),
    ("Open3D", Kind::Cloud, "pip install open3d"),
    ("MeshLab", Kind::Cloud, "pip install pymeshlab"),
    ("APSS", Kind::Cloud, "pip install pymeshlab"),
    ("SciPy", Kind::Volume, "pip install scipy"),
];

/// Another program with its setting.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peer {
    known: usize,
    /// As its own documentation calls it.
    pub setting: String,
}

impl Peer {
    fn name(&self) -> &'static str {
        KNOWN[self.known].0
    }

    /// Whether it works on such inputs.
    pub fn takes(&self, kind: Kind) -> bool {
        KNOWN[self.known].1 == kind
    }
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.name(), self.setting)
    }
}

impl FromStr for Peer {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let (name, setting) = s.split_once(':').unwrap_or((s, ""));
        let known = KNOWN.iter().position(|k| k.0.eq_ignore_ascii_case(name));
        let Some(known) = known else {
            let names: Vec<&str> = KNOWN.iter().map(|k| k.0).collect();
            return Err(format!("write NAME:SETTING, NAME one of {}", names.join(", ")));
        };
        let number: Option<f64> = setting.parse().ok();
        let is_good = match KNOWN[known].0 {
            "SciPy" => setting == "interpolate" || number.is_some_and(|n| (1.0..=64.0).contains(&n)),
            "APSS" => number.is_some_and(|n| (8.0..=4096.0).contains(&n) && n.fract() == 0.0),
            _ => number.is_some_and(|n| (1.0..=16.0).contains(&n) && n.fract() == 0.0),
        };
        let usual = match KNOWN[known].0 {
            "SciPy" => "interpolate or voxels from knot to knot, 1 to 64, as in SciPy:1.6",
            "APSS" => "cells along the box, 8 to 4096, as in APSS:128",
            _ => "a depth from 1 to 16, as in Open3D:8",
        };
        if !is_good {
            return Err(format!("{} needs {usual}", KNOWN[known].0));
        }
        Ok(Self {
            known,
            setting: setting.into(),
        })
    }
}

/// Python, and what it can run.
pub struct Python {
    program: PathBuf,
    script: PathBuf,
    /// Versions by name; of what is missing why.
    installed: Map<String, Value>,
    trouble: Option<String>,
}

impl Python {
    /// Asks a Python what it has. One that is not there has nothing.
    pub fn new(program: PathBuf, scratch: &Path) -> Outcome<Self> {
        for (name, text) in SCRIPTS {
            fs::write(scratch.join(name), text).or_limit()?;
        }
        let script = scratch.join("peer.py");
        let asked = own::output(Command::new(&program).arg(&script).arg("installed"));
        let (installed, trouble) = match asked {
            Ok(out) if out.status.success() => (last_object(&out.stdout).unwrap_or_default(), None),
            Ok(out) => (Map::new(), Some(last_line(&out.stderr))),
            Err(e) => (Map::new(), Some(e.to_string())),
        };
        let trouble = trouble.map(|why| format!("{}: {why}; name another by --python", program.display()));
        Ok(Self {
            program,
            script,
            installed,
            trouble,
        })
    }

    /// Whether a program is there.
    pub fn has(&self, peer: &Peer) -> bool {
        self.installed.contains_key(peer.name())
    }

    /// Why it is not, and what helps.
    pub fn missing(&self, peer: &Peer) -> Option<String> {
        let is_missing = !self.has(peer);
        is_missing.then(|| match &self.trouble {
            Some(why) => why.clone(),
            None => format!("{} is not installed: {}", peer.name(), KNOWN[peer.known].2),
        })
    }

    /// Its name with its version, if it tells one.
    pub fn named(&self, peer: &Peer) -> String {
        match self.installed.get(peer.name()).and_then(Value::as_str) {
            Some(version) if !version.is_empty() => format!("{} {version}", peer.name()),
            _ => peer.name().into(),
        }
    }

    /// One run: what it tells, or why there is nothing.
    pub fn run(
        &self,
        peer: &Peer,
        subject: &Subject,
        threads: NonZeroUsize,
    ) -> Outcome<Result<Map<String, Value>, String>> {
        let result = subject.result();
        // What an earlier run left is nobody's result.
        let _ = fs::remove_file(&result);
        let mut command = Command::new(&self.program);
        command.arg(&self.script).arg(peer.name()).arg(&peer.setting);
        command.arg(&subject.given).arg(&result).arg(threads.to_string());
        let out = own::output(&mut command).or_limit()?;
        Ok(match last_object(&out.stdout) {
            // Some crash while they tidy up, after all is done.
            Some(told) => Ok(told),
            None => Err(format!("{} ({})", last_line(&out.stderr), out.status)),
        })
    }
}

fn last_line(printed: &[u8]) -> String {
    let text = String::from_utf8_lossy(printed);
    text.lines()
        .map(str::trim)
        .rfind(|l| !l.is_empty())
        .unwrap_or("it says nothing")
        .to_string()
}

fn last_object(printed: &[u8]) -> Option<Map<String, Value>> {
    let text = String::from_utf8_lossy(printed);
    text.lines()
        .rev()
        .find_map(|line| match serde_json::from_str(line) {
            Ok(Value::Object(object)) => Some(object),
            _ => None,
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_are_named_with_settings_that_they_take() {
        for good in [
            "PoissonRecon:8",
            "open3d:9",
            "APSS:128",
            "scipy:interpolate",
            "SciPy:1.6",
        ] {
            let peer: Peer = good.parse().unwrap();
            assert!(peer.to_string().eq_ignore_ascii_case(good));
        }
        for bad in [
            "",
            "Open3D",
            "Open3D:8.5",
            "Open3D:17",
            "APSS:2",
            "SciPy:0.5",
            "SciPy:nearest",
            "Blender:3",
        ] {
            assert!(bad.parse::<Peer>().is_err(), "{bad}");
        }
    }

    #[test]
    fn what_crashes_after_its_result_has_one() {
        let printed = b"warming up\n{\"cpu\": 1}\nSegmentation fault\n";
        assert_eq!(last_object(printed).unwrap()["cpu"], 1);
        assert_eq!(last_object(b"nothing\n"), None);
        assert_eq!(last_line(b"a\n b \n\n"), "b");
    }
}
