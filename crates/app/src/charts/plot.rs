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

    /// Logarithms of the points that can be drawn.
    fn logarithms(series: &Series) -> Vec<(f64, f64, &str)> {
        let drawn = series
            .points
            .iter()
            .filter(|(x, y, _)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite());
        drawn
            .map(|(x, y, label)| (x.log10(), y.log10(), label.as_str()))
            .collect()
    }

    fn draw(&self, text: &mut String) -> Result<(), Box<dyn Error + '_>> {
        let root = SVGBackend::with_string(text, (960, 640)).into_drawing_area();
        root.fill(&WHITE)?;
        let all: Vec<_> = self.series.iter().flat_map(Self::logarithms).collect();
        let (x, y) = (padded(all.iter().map(|p| p.0)), padded(all.iter().map(|p| p.1)));
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 22))
            .margin(16)
            .x_label_area_size(52)
            .y_label_area_size(84)
            .build_cartesian_2d(x.clone(), y.clone())?;
        self.draw_axes(&mut chart, &x, &y)?;
        for (i, series) in self.series.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let points = Self::logarithms(series);
            let line: Vec<(f64, f64)> = points.iter().map(|p| (p.0, p.1)).collect();
            chart
                .draw_series(LineSeries::new(line.iter().copied(), color.stroke_width(2)))?
                .label(&series.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 24, y)], color.stroke_width(3)));
            chart.draw_series(line.iter().map(|&p| Circle::new(p, 4, color.filled())))?;
            // Words of neighbouring series on different sides of their points, so that they cross less.
            let side = if i % 2 == 0 { (7, -14) } else { (7, 6) };
            chart.draw_series(points.iter().map(|&(x, y, label)| {
                EmptyElement::at((x, y))
                    + Text::new(
                        label.to_string(),
                        side,
                        ("sans-serif", 12).into_font().color(&color),
                    )
            }))?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.9))
            .border_style(BLACK.mix(0.3))
            .label_font(("sans-serif", 14))
            .draw()?;
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
        assert_eq!(svg.matches("<circle").count(), 2);
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let labels: Vec<String> = ticks(&(-1.1..0.8)).into_iter().map(plain).collect();
        assert_eq!(labels, ["0.1", "0.2", "0.5", "1", "2", "5"]);
        assert_eq!(plain(-6.0), "1e-6");
    }
}
