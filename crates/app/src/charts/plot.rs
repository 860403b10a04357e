use std::error::Error;
use std::ops::Range;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// A line of a chart.
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// `x`, `y` and a word beside the point, in the order in which they are joined.
    pub points: Vec<(f64, f64, String)>,
}

/// A chart with logarithmic axes.
pub struct Chart {
    /// Above the chart.
    pub title: String,
    /// Quantity and unit of the horizontal axis.
    pub x_title: String,
    /// Quantity and unit of the vertical axis.
    pub y_title: String,
    /// What is drawn; points whose coordinates are not above 0 are left out.
    pub series: Vec<Series>,
}

type PlotContext<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Points lower than this share of the highest are named in the legend instead of drawn.
const DEPTH: f64 = 1e-5;

/// Colours that the colour-blind tell apart (Okabe & Ito 2008).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 120, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 160, 233),
    RGBColor(90, 90, 90),
];

impl Chart {
    /// The chart as SVG text.
    ///
    /// # Errors
    /// If the drawing library refuses, with its words.
    pub fn svg(&self) -> Result<String, String> {
        let mut text = String::new();
        self.draw(&mut text).map_err(|e| e.to_string())?;
        Ok(text)
    }

    /// Logarithms of the points that can be drawn: those of positive, finite coordinates that are not lower than
    /// [`DEPTH`] of the highest, which would press all others together.
    fn logarithms<'a>(&self, series: &'a Series) -> Vec<(f64, f64, &'a str)> {
        let floor = self.floor();
        series
            .points
            .iter()
            .filter(|(x, y, _)| *x > 0.0 && *y > floor && x.is_finite() && y.is_finite())
            .map(|(x, y, label)| (x.log10(), y.log10(), label.as_str()))
            .collect()
    }

    fn floor(&self) -> f64 {
        let all = self.series.iter().flat_map(|s| &s.points).map(|p| p.1);
        DEPTH * all.filter(|y| y.is_finite()).fold(0.0, f64::max)
    }

    /// Name of a series, with the figures of its points that lie below the chart.
    fn legend(&self, series: &Series) -> String {
        let floor = self.floor();
        let below = series
            .points
            .iter()
            .filter(|p| p.0 > 0.0 && p.1 > 0.0 && p.1 <= floor);
        let figures: Vec<String> = below
            .map(|(x, y, label)| format!("{label}: {y:.0e} at {x:.2}"))
            .collect();
        if figures.is_empty() {
            series.name.clone()
        } else {
            format!("{} (below the chart: {})", series.name, figures.join(", "))
        }
    }

    fn draw(&self, text: &mut String) -> Result<(), Box<dyn Error + '_>> {
        let root = SVGBackend::with_string(text, (960, 640)).into_drawing_area();
        root.fill(&WHITE)?;
        let all: Vec<_> = self.series.iter().flat_map(|s| self.logarithms(s)).collect();
        let (x, y) = (padded(all.iter().map(|p| p.0)), padded(all.iter().map(|p| p.1)));
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 22))
            .margin(16)
            .x_label_area_size(52)
            .y_label_area_size(84)
            .build_cartesian_2d(x.clone(), y.clone())?;
        self.draw_axes(&mut chart, &x, &y)?;
        let mut words = Vec::new();
        for (i, series) in self.series.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let points = self.logarithms(series);
            let line: Vec<(f64, f64)> = points.iter().map(|p| (p.0, p.1)).collect();
            chart
                .draw_series(LineSeries::new(line.iter().copied(), color.stroke_width(2)))?
                .label(self.legend(series))
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 24, y)], color.stroke_width(3)));
            chart.draw_series(line.iter().map(|&p| Circle::new(p, 4, color.filled())))?;
            for (x, y, label) in points {
                let at = chart.backend_coord(&(x, y));
                words.push((at, label, color));
            }
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.9))
            .border_style(BLACK.mix(0.3))
            .label_font(("sans-serif", 14))
            .draw()?;
        write_words(&root, &words)?;
        root.present()?;
        Ok(())
    }

    /// Grid lines and labels at 1, 2 and 5 times the powers of ten.
    fn draw_axes(
        &self,
        chart: &mut PlotContext<'_, '_>,
        x: &Range<f64>,
        y: &Range<f64>,
    ) -> Result<(), Box<dyn Error + '_>> {
        chart
            .configure_mesh()
            .disable_mesh()
            .x_labels(0)
            .y_labels(0)
            .x_desc(&self.x_title)
            .y_desc(&self.y_title)
            .axis_desc_style(("sans-serif", 16))
            .draw()
            .map_err(|e| e.to_string())?;
        let font = ("sans-serif", 13).into_font().color(&BLACK.mix(0.8));
        let grid = BLACK.mix(0.12);
        for tick in ticks(x) {
            chart
                .draw_series([PathElement::new([(tick, y.start), (tick, y.end)], grid)])
                .map_err(|e| e.to_string())?;
            let label = Text::new(plain(tick), (-10, 8), font.clone());
            chart
                .draw_series([EmptyElement::at((tick, y.start)) + label])
                .map_err(|e| e.to_string())?;
        }
        for tick in ticks(y) {
            chart
                .draw_series([PathElement::new([(x.start, tick), (x.end, tick)], grid)])
                .map_err(|e| e.to_string())?;
            let label = Text::new(plain(tick), (-54, -7), font.clone());
            chart
                .draw_series([EmptyElement::at((x.start, tick)) + label])
                .map_err(|e| e.to_string())?;
        }
        Ok(())
    }
}

/// Writes the words beside their points where they hide neither a point nor another word; where no side is free,
/// a point goes without.
fn write_words(
    root: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    words: &[((i32, i32), &str, RGBColor)],
) -> Result<(), String> {
    const HEIGHT: i32 = 13;
    type Bounds = [i32; 4];
    let touch = |a: &Bounds, b: &Bounds| a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
    let mut taken: Vec<Bounds> = words
        .iter()
        .map(|((x, y), ..)| [x - 4, y - 4, x + 4, y + 4])
        .collect();
    for ((x, y), word, color) in words {
        let width = 7 * word.chars().count() as i32;
        let sides = [
            (x + 6, y - HEIGHT - 1),
            (x + 6, y + 2),
            (x - 6 - width, y - HEIGHT - 1),
            (x - 6 - width, y + 2),
            (x - width / 2, y - HEIGHT - 6),
            (x - width / 2, y + 7),
        ];
        let free = sides.into_iter().map(|(x, y)| [x, y, x + width, y + HEIGHT]);
        if let Some(place) = free.into_iter().find(|p| taken.iter().all(|t| !touch(p, t))) {
            let font = ("sans-serif", 12).into_font().color(color);
            root.draw(&Text::new(word.to_string(), (place[0], place[1]), font))
                .map_err(|e| e.to_string())?;
            taken.push(place);
        }
    }
    Ok(())
}

/// The range of `values` and a little more; at least a factor of 3.
fn padded(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    if lo > hi {
        return 0.0..1.0;
    }
    let pad = (0.08 * (hi - lo)).max(0.25 - 0.5 * (hi - lo)).max(0.05);
    lo - pad..hi + pad
}

/// Logarithms of 1, 2 and 5 times the powers of ten inside `range`; of the powers alone if that is plenty.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let steps: &[f64] = if range.end - range.start > 4.0 {
        &[1.0]
    } else {
        &[1.0, 2.0, 5.0]
    };
    (range.start.floor() as i32..=range.end.ceil() as i32)
        .flat_map(|power| steps.iter().map(move |s| s.log10() + f64::from(power)))
        .filter(|t| range.contains(t))
        .collect()
}

fn plain(logarithm: f64) -> String {
    let value = 10f64.powf(logarithm);
    if (1e-3..1e5).contains(&value) {
        let decimals = (-(logarithm + 1e-9).floor()).max(0.0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chart_has_titles_legend_labels_and_every_point_that_can_be_drawn() {
        let chart = Chart {
            title: "Error against time".into(),
            x_title: "processor time / s".into(),
            y_title: "rms / mm".into(),
            series: vec![Series {
                name: "tolerance, f32".into(),
                points: vec![
                    (0.1, 1e-3, "1%".into()),
                    (0.5, 1e-4, "0.1%".into()),
                    (0.0, 1.0, "never".into()),
                ],
            }],
        };
        let svg = chart.svg().unwrap();
        for word in [
            "Error against time",
            "processor time / s",
            "rms / mm",
            "tolerance, f32",
            "0.1%",
        ] {
            assert!(svg.contains(word), "{word} is missing");
        }
        assert!(!svg.contains("never"));
        assert!(svg.contains("below the chart: f64: 1e-12 at 0.20"));
        assert_eq!(svg.matches("<circle").count(), 2);
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let labels: Vec<String> = ticks(&(-1.1..0.8)).into_iter().map(plain).collect();
        assert_eq!(labels, ["0.1", "0.2", "0.5", "1", "2", "5"]);
        assert_eq!(plain(-6.0), "1e-6");
    }
}
