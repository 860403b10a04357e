use super::plot::DEPTH;
use super::{Chart, Series};

/// How well one method oriented one cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Oriented {
    /// Name of the cloud.
    pub cloud: String,
    /// Name of the method.
    pub method: String,
    /// Points whose true normal is known.
    pub points: usize,
    /// Of these, how many got a normal that points inward, or none.
    pub wrong: usize,
    /// User and system seconds.
    pub cpu_seconds: f64,
}

impl Oriented {
    /// First line of a CSV.
    pub const COLUMNS: &str = "cloud,method,points,wrong,cpu_seconds";

    /// Reads a run a line; the first line names the columns.
    pub fn read_csv(text: &str) -> Result<Vec<Self>, String> {
        let line = |(i, line): (usize, &str)| {
            let bad = || format!("line {}: {line:?} is not {}", i + 1, Self::COLUMNS);
            let [cloud, method, points, wrong, cpu_seconds] =
                <[&str; 5]>::try_from(line.split(',').collect::<Vec<_>>()).map_err(|_| bad())?;
            Ok(Self {
                cloud: cloud.into(),
                method: method.into(),
                points: points.parse().map_err(|_| bad())?,
                wrong: wrong.parse().map_err(|_| bad())?,
                cpu_seconds: cpu_seconds.parse().map_err(|_| bad())?,
            })
        };
        text.lines().enumerate().skip(1).map(line).collect()
    }

    /// Its line of CSV.
    pub fn csv(&self) -> String {
        format!(
            "{},{},{},{},{:.2}",
            self.cloud, self.method, self.points, self.wrong, self.cpu_seconds
        )
    }
}

impl Chart {
    /// Share of wrong normals against time, a series a method in the order of their first run.
    ///
    /// No wrong normal is drawn as half of one.
    pub fn of_orientation(runs: &[Oriented]) -> Self {
        let mut series: Vec<Series> = Vec::new();
        for run in runs {
            if !series.iter().any(|s| s.name == run.method) {
                series.push(Series {
                    name: run.method.clone(),
                    points: Vec::new(),
                });
            }
            let line = series
                .iter_mut()
                .find(|s| s.name == run.method)
                .expect("just made");
            let share = 100.0 * (run.wrong as f64).max(0.5) / run.points.max(1) as f64;
            line.points.push((run.cpu_seconds, share, run.cloud.clone()));
        }
        Self {
            title: "orientation of clouds without normals".into(),
            x_title: "processor time, s".into(),
            y_title: "normals pointing inward, % (none: drawn as half a point)".into(),
            depth: DEPTH,
            series,
            is_joined: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_comes_back_and_a_broken_line_is_named() {
        let run = Oriented {
            cloud: "bunny-clean".into(),
            method: "spanning tree".into(),
            points: 34834,
            wrong: 3,
            cpu_seconds: 1.25,
        };
        let text = format!("cloud,method,points,wrong,cpu_seconds\n{}\n", run.csv());
        assert_eq!(Oriented::read_csv(&text), Ok(vec![run]));
        assert!(Oriented::read_csv("head\na,b,1\n").is_err_and(|e| e.contains("line 2")));
    }
}
