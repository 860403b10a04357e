//! The rows of \[Hua04 table 2\]: a point tool on a tensor-product patch with free ends, half full, on clamped knots.

use ::tools::study::{PatchPull, TABLE_2};

use super::{Add, Place, ToolLine, ToolRun, ToolsError, summary};

const STEPS: usize = 40;

/// Measures the rows, even and with a stiff half.
pub fn rows(run: &mut ToolRun, add: &mut Add) -> Result<(), ToolsError> {
    let rows = if run.quick { &TABLE_2[..3] } else { &TABLE_2[..] };
    for (n, m, printed) in rows {
        for painted in [false, true] {
            run.go_on(0.8)?;
            let mut pull = PatchPull::new(*n, *m, painted)?;
            let mut seconds = Vec::new();
            for _ in 0..STEPS {
                let start = (run.clock)();
                pull.step()?;
                seconds.push((run.clock)() - start);
            }
            let paint = if painted { ", painted" } else { "" };
            let (median, slow) = summary(seconds);
            let line = ToolLine {
                tool: format!("point, table 2 {n}/{m}{paint}"),
                paths: 1,
                drag_over_r: Some(PatchPull::DRAG),
                sampling_factor: Some(1.0),
                law: "clay, arrive".into(),
                arrival: Some(pull.arrival()),
                overshoot: Some(pull.overshoot()),
                steps_to_99: pull.steps_to_99(),
                loop_ms: median,
                slow_loop_ms: slow,
                printed_ms: Some(*printed),
                default: !painted,
                place: Place::Loop {
                    samples: m * m * m,
                    series: format!("table 2{paint}"),
                },
                ..ToolLine::default()
            };
            add(line, run);
        }
    }
    Ok(())
}
