use std::io::{self, Write};

use document::Solve;
use serde::Serialize;

use super::cost::{self, Cost};
use super::failure::{OrFail, Outcome};
use super::keep::LeftOut;
use super::mesh_check::MeshQuality;
use super::output::Output;
use super::quantity::{human_bytes, human_count, human_number};
use super::solves;

/// What a subcommand tells when it is done: one JSON object, or a table. Fields that do not apply stay `None` and
/// are left out.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(default)]
pub struct Summary {
    /// Points or voxels in the input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input_count: Option<usize>,
    /// Of these, how many served.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub used_count: Option<usize>,
    /// Unit of lengths (clouds) or the word `density` (volumes).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Active functions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coefficients: Option<usize>,
    /// Bytes that evaluation reads.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub totals_bytes: Option<usize>,
    /// Bricks over all levels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bricks: Option<usize>,
    /// Finest level with an active function.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<usize>,
    /// Tolerance aimed at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Smoothing weight used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothing: Option<f64>,
    /// Standard deviation of the noise, if any was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Root mean square error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms: Option<f64>,
    /// 95th percentile of the absolute errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p95: Option<f64>,
    /// Largest absolute error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// Sound bound on all residuals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
    /// Leaves of the fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves: Option<usize>,
    /// Leaves whose rms residual is above the tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves_over_tolerance: Option<usize>,
    /// Of a mesh: leaves above the tolerance at edges, which a smooth field can only round off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves_at_edges: Option<usize>,
    /// Leaves above the tolerance that were not split for lack of data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves_without_data: Option<usize>,
    /// How inside was told from outside, where the cloud had no normals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oriented_by: Option<String>,
    /// Points that no surface passes through.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outliers: Option<usize>,
    /// Points whose estimated normal may point the wrong way.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unsure_signs: Option<usize>,
    /// Leaves where that is so on the mean of their points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves_of_unsure_sign: Option<usize>,
    /// How the solver of a fit ended, solve by solve.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub solves: Vec<Solve>,
    /// Points that Newton's method could not bring to the surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unprojected: Option<usize>,
    /// Components of the solid or of its complement that hold no sample, larger than a cell of 1/128 of the box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unsupported_components: Option<usize>,
    /// 95th percentile of the distances from points of the zero set to the mesh that was fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub back_p95: Option<f64>,
    /// Largest of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub back_max: Option<f64>,
    /// Wrong signs at points of the box farther from the mesh than the tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wrong_signs: Option<usize>,
    /// Defects of the mesh that was fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub defects: Option<serde_json::Value>,
    /// Vertices of the mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertices: Option<usize>,
    /// Triangles of the mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangles: Option<usize>,
    /// What those mind who use the mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<MeshQuality>,
    /// What was left out of the mesh as small pieces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOut>,
    /// Cells of the meshing grid on each axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<[u32; 3]>,
    /// Wall seconds of the work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// User and system seconds of the process so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu_seconds: Option<f64>,
    /// Largest resident size of the process so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_rss_bytes: Option<u64>,
    /// Threads that shared the work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<usize>,
    /// SHA-256 of the field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field_sha256: Option<String>,
    /// File written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<String>,
    /// Repairs and doubts, each a sentence.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl Summary {
    /// Adds what the process has spent.
    pub fn with_cost(mut self, cost: &Cost) -> Self {
        self.seconds = Some(cost.seconds());
        self.cpu_seconds = Some(cost::cpu_seconds());
        self.peak_rss_bytes = cost::peak_rss_bytes();
        self.threads = Some(rayon::current_num_threads());
        self
    }

    /// Writes the object or the table to stdout.
    pub fn print(&self, json: bool) -> Outcome {
        print(&self.text(json), false)
    }

    /// Hands the output on, then writes the object or the table: to stderr where stdout holds the data.
    pub fn print_after(mut self, output: &Output, json: bool) -> Outcome {
        output.finish()?;
        self.output = Some(output.name());
        print(&self.text(json), output.is_stdout())
    }

    /// Writes the object or the table of what lies under a name already.
    pub fn print_of(mut self, output: String, json: bool) -> Outcome {
        self.output = Some(output);
        print(&self.text(json), false)
    }

    fn text(&self, json: bool) -> String {
        if json { self.json() } else { self.table() }
    }

    /// One line of JSON.
    pub fn json(&self) -> String {
        serde_json::to_string(self).expect("a struct of plain fields is always JSON")
    }

    fn table(&self) -> String {
        table(self.rows(), &self.notes)
    }

    /// What applies, for people.
    pub fn rows(&self) -> impl Iterator<Item = (&'static str, String)> + use<> {
        let unit = self.unit.as_deref().map(|u| format!(" {u}")).unwrap_or_default();
        let count = |n: usize| human_count(n);
        let size = |x: f64| format!("{}{unit}", human_number(x));
        let quality = self.quality.iter().flat_map(|q| q.rows()).collect::<Vec<_>>();
        let first = [
            ("input", self.input_count.map(count)),
            (
                "used",
                self.used_count
                    .filter(|n| Some(*n) != self.input_count)
                    .map(count),
            ),
            ("oriented by", self.oriented_by.clone()),
            ("  outliers", self.outliers.map(count)),
            ("  unsure signs", self.unsure_signs.map(count)),
            ("  leaves of unsure sign", self.leaves_of_unsure_sign.map(count)),
            ("tolerance", self.tolerance.map(size)),
            ("noise found", self.noise.map(size)),
            ("smoothing", self.smoothing.map(human_number)),
            ("error rms", self.rms.map(size)),
            ("error p95", self.p95.map(size)),
            ("error max", self.max.map(size)),
            ("bound on |residual|", self.bound.map(human_number)),
            (
                "unprojected points",
                self.unprojected.filter(|n| *n > 0).map(count),
            ),
            (
                "parts without samples",
                self.unsupported_components.filter(|n| *n > 0).map(count),
            ),
            ("back to the mesh p95", self.back_p95.map(size)),
            ("back to the mesh max", self.back_max.map(size)),
            ("wrong signs", self.wrong_signs.map(count)),
            ("leaves", self.leaves.map(count)),
            ("  over tolerance", self.leaves_over_tolerance.map(count)),
            ("  at edges of the mesh", self.leaves_at_edges.map(count)),
            ("  refused for lack of data", self.leaves_without_data.map(count)),
            ("solver", solves::row(&self.solves)),
            ("coefficients", self.coefficients.map(count)),
            ("bricks", self.bricks.map(count)),
            ("totals", self.totals_bytes.map(|b| human_bytes(b as u64))),
            ("finest level", self.depth.map(count)),
            ("vertices", self.vertices.map(count)),
            ("triangles", self.triangles.map(count)),
        ];
        let last = [
            ("cells", self.cells.map(|[x, y, z]| format!("{x} × {y} × {z}"))),
            ("time", self.seconds.map(|s| format!("{s:.2} s"))),
            ("processor time", self.cpu_seconds.map(|s| format!("{s:.2} s"))),
            ("peak memory", self.peak_rss_bytes.map(human_bytes)),
            ("threads", self.threads.map(count)),
            ("field sha256", self.field_sha256.clone()),
            ("written", self.output.clone()),
        ];
        (first.into_iter().chain(quality).chain(last)).filter_map(|(label, value)| Some((label, value?)))
    }
}

/// Writes lines to stdout, or to stderr where stdout is taken.
pub fn print(text: &str, is_taken: bool) -> Outcome {
    let mut out: Box<dyn Write> = if is_taken {
        Box::new(io::stderr().lock())
    } else {
        Box::new(io::stdout().lock())
    };
    writeln!(out, "{text}").and_then(|()| out.flush()).or_limit()
}

/// Two columns, then the notes.
pub fn table<'a>(rows: impl IntoIterator<Item = (&'a str, String)>, notes: &[String]) -> String {
    let rows: Vec<_> = rows.into_iter().collect();
    let width = rows.iter().map(|(label, _)| label.len()).max().unwrap_or(0);
    let mut lines: Vec<String> = rows
        .iter()
        .map(|(label, value)| format!("{label:width$}  {value}"))
        .collect();
    lines.extend(notes.iter().map(|n| format!("note: {n}")));
    lines.join("\n")
}

/// Lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_holds_what_applies_and_nothing_else() {
        let s = Summary {
            rms: Some(0.25),
            threads: Some(2),
            ..Default::default()
        };
        assert_eq!(s.json(), r#"{"rms":0.25,"threads":2}"#);
    }

    #[test]
    fn table_names_units_and_hides_what_does_not_apply() {
        let s = Summary {
            input_count: Some(34834),
            used_count: Some(34834),
            rms: Some(0.25),
            unit: Some("mm".into()),
            notes: vec!["2 points merged".into()],
            ..Default::default()
        };
        assert_eq!(
            s.table(),
            "input      34 834\nerror rms  0.2500 mm\nnote: 2 points merged"
        );
    }
}
