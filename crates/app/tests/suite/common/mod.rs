//! Runs the program as a user would, in a directory of its own.
pub mod wrong_values;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use bspline::polygonize::Mesh;
use glam::DVec3;
use serde_json::Value;
use tempfile::TempDir;

/// What a run of the program left behind.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    /// The JSON object on the last line of stdout.
    pub fn json(&self) -> Value {
        assert_eq!(self.code, 0, "{}", self.stderr);
        let last = self.stdout.lines().last().expect("a line on stdout");
        serde_json::from_str(last).unwrap_or_else(|e| panic!("{e}: {last}"))
    }
}

impl From<Output> for Run {
    fn from(o: Output) -> Self {
        Self {
            code: o.status.code().expect("the program ends by itself"),
            stdout: String::from_utf8(o.stdout).expect("text on stdout"),
            stderr: String::from_utf8(o.stderr).expect("text on stderr"),
        }
    }
}

/// A scratch directory and the program in it.
pub struct Bench {
    pub directory: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self {
            directory: tempfile::tempdir().unwrap(),
        }
    }

    pub fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isoclay"));
        // No test opens a window.
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        command.current_dir(&self.directory);
        command
    }

    /// Runs the program with arguments that are split at blanks.
    pub fn run(&self, arguments: &str) -> Run {
        self.command()
            .args(arguments.split_whitespace())
            .output()
            .unwrap()
            .into()
    }

    /// Runs the program with `input` on its standard input; what it says, and the bytes on its standard output.
    pub fn pipe(&self, arguments: &str, input: &[u8]) -> (Run, Vec<u8>) {
        let mut child = self
            .command()
            .args(arguments.split_whitespace())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let input = input.to_vec();
        // A program that refuses its arguments does not read.
        let writer = std::thread::spawn(move || stdin.write_all(&input));
        let mut out = child.wait_with_output().unwrap();
        let _ = writer.join().unwrap();
        let bytes = std::mem::take(&mut out.stdout);
        (out.into(), bytes)
    }

    pub fn json(&self, arguments: &str) -> Value {
        self.run(&format!("{arguments} --json")).json()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    /// Names of all files, sorted.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(&self.directory)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

/// `x y z nx ny nz` lines of `count` points on a sphere, on a spiral.
pub fn sphere_text(center: [f64; 3], radius: f64, count: usize) -> String {
    let line = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (a, r) = (2.399963229728653 * i as f64, (1.0 - z * z).sqrt());
        let n = [r * a.cos(), r * a.sin(), z];
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| center[k] + radius * n[k]);
        format!("{x} {y} {z} {} {} {}\n", n[0], n[1], n[2])
    };
    (0..count).map(line).collect()
}

/// A file of the repository's `data`.
pub fn data(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    root.join("data").join(name).to_str().unwrap().to_string()
}

/// A number of a JSON object.
pub fn number(object: &Value, key: &str) -> f64 {
    object[key]
        .as_f64()
        .unwrap_or_else(|| panic!("no number {key} in {object}"))
}

/// Reads the binary PLY that `isoclay mesh` writes, by nothing but the format's own rules.
pub fn read_mesh(path: &Path) -> Mesh {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(header.contains("binary_little_endian"));
    let count = |element: &str| -> usize {
        let line = header
            .lines()
            .find(|l| l.starts_with(&format!("element {element} ")))
            .unwrap();
        line.rsplit(' ').next().unwrap().parse().unwrap()
    };
    let (vertices, faces) = (count("vertex"), count("face"));
    let (points, triangles) = bytes[end..].split_at(12 * vertices);
    assert_eq!(
        triangles.len(),
        13 * faces,
        "three corners a face and nothing more"
    );
    let f = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap()));
    let u = |b: &[u8]| u32::from_le_bytes(b.try_into().unwrap());
    Mesh {
        positions: points
            .chunks(12)
            .map(|c| DVec3::new(f(&c[..4]), f(&c[4..8]), f(&c[8..])))
            .collect(),
        normals: Vec::new(),
        triangles: triangles
            .chunks(13)
            .map(|c| [u(&c[1..5]), u(&c[5..9]), u(&c[9..])])
            .collect(),
    }
}
