use std::error::Error;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// A line of a chart.
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// `x`, `y` and a word beside the point, in the order in which they are joined if they are.
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
    /// Points lower than this share of the highest are named in the legend instead of drawn; [`DEPTH`] unless small
    /// values matter.
    pub depth: f64,
    /// What is drawn; points whose coordinates are not above 0 are left out.
    pub series: Vec<Series>,
    /// Whether lines join the points of a series: from one to the next some quantity grows.
    pub is_joined: bool,
}

type PlotContext<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Width of a chart.
const WIDTH: i32 = 960;
/// Where the legend begins, from the left.
const LEFT: i32 = 100;
/// Height of a line of the legend.
const ROW: i32 = 24;
/// Points lower than this share of the highest press all others together.
pub const DEPTH: f64 = 1e-5;

/// Colours that the colour-blind tell apart \[Okabe08\].
const COLORS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 120, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 160, 233),
    RGBColor(90, 90, 90),
    RGBColor(146, 73, 0),
    RGBColor(73, 0, 146),
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

    /// Logarithms of the points that can be drawn: those of positive, finite coordinates that are not too low.
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
        self.depth * all.filter(|y| y.is_finite()).fold(0.0, f64::max)
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
            format!("{}, not drawn: {}", series.name, figures.join(", "))
        }
    }

    fn draw(&self, text: &mut String) -> Result<(), Box<dyn Error + '_>> {
        let legend = self.legend_places();
        let depth = legend.last().map_or(0, |p| p.1) + ROW;
        let root = SVGBackend::with_string(text, (WIDTH as u32, 600 + depth as u32)).into_drawing_area();
        root.fill(&WHITE)?;
        let (above, below) = root.split_vertically(600);
        let all: Vec<_> = self.series.iter().flat_map(|s| self.logarithms(s)).collect();
        let (x, y) = (padded(all.iter().map(|p| p.0)), padded(all.iter().map(|p| p.1)));
        let mut chart = ChartBuilder::on(&above)
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
            if self.is_joined {
                chart.draw_series(LineSeries::new(line.iter().copied(), color.stroke_width(2)))?;
            }
            // A series of one point would hide under the others.
            let radius = if line.len() == 1 { 7 } else { 4 };
            for (x, y, label) in points {
                let at = chart.backend_coord(&(x, y));
                draw_marker(&above, i, at, radius)?;
                words.push((at, label, color));
            }
        }
        write_words(&above, &words)?;
        self.draw_legend(&below, &legend)?;
        root.present()?;
        Ok(())
    }

    /// Corners of the entries of the legend, set like words on lines.
    fn legend_places(&self) -> Vec<(i32, i32)> {
        let (mut x, mut y) = (LEFT, 8);
        let mut places = Vec::new();
        for series in &self.series {
            let width = 60 + 7 * self.legend(series).chars().count() as i32;
            if x > LEFT && x + width > 950 {
                (x, y) = (LEFT, y + ROW);
            }
            places.push((x, y));
            x += width;
        }
        places
    }

    /// The names under the chart, where they hide nothing.
    fn draw_legend(
        &self,
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        places: &[(i32, i32)],
    ) -> Result<(), String> {
        for (i, (series, &(x, y))) in self.series.iter().zip(places).enumerate() {
            let color = COLORS[i % COLORS.len()];
            let name = Text::new(self.legend(series), (x + 34, y - 7), ("sans-serif", 14));
            let drawn = area
                .draw(&PathElement::new([(x, y), (x + 24, y)], color.stroke_width(3)))
                .map_err(|e| e.to_string())
                .and_then(|()| draw_marker(area, i, (x + 12, y), 4))
                .and_then(|()| area.draw(&name).map_err(|e| e.to_string()));
            drawn?;
        }
        Ok(())
    }

    /// Grid lines and labels at round numbers.
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

/// The sign of series `i` at a pixel: of as many as there are colours a disk, of as many more a triangle, then a cross.
fn draw_marker(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    i: usize,
    at: (i32, i32),
    radius: i32,
) -> Result<(), String> {
    let color = COLORS[i % COLORS.len()];
    let drawn = match i / COLORS.len() {
        0 => area.draw(&Circle::new(at, radius, color.filled())),
        1 => area.draw(&TriangleMarker::new(at, radius + 2, color.filled())),
        _ => area.draw(&Cross::new(at, radius + 1, color.stroke_width(3))),
    };
    drawn.map_err(|e| e.to_string())
}

/// Writes the words beside their points where they hide neither a point nor another word; where no side is free,
/// a point goes without.
fn write_words(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
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
        if let Some(place) = free
            .into_iter()
            .find(|p| p[2] < WIDTH && taken.iter().all(|t| !touch(p, t)))
        {
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

/// Logarithms of round numbers inside `range`, the more to a power of ten the fewer of these there are.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let steps: &[f64] = match range.end - range.start {
        width if width > 4.0 => &[1.0],
        width if width > 1.2 => &[1.0, 2.0, 5.0],
        _ => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
    };
    (range.start.floor() as i32..=range.end.ceil() as i32)
        .flat_map(|power| steps.iter().map(move |s| s.log10() + f64::from(power)))
        .filter(|t| range.contains(t))
        .collect()
}

/// Two digits, with an exponent where the zeros would be many.
fn plain(logarithm: f64) -> String {
    let short = format!("{:.1e}", 10f64.powf(logarithm));
    let value: f64 = short.parse().expect("a number just written");
    if (1e-3..1e5).contains(&value) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chart_has_titles_legend_labels_and_every_point_that_can_be_drawn() {
        let mut chart = Chart {
            title: "Error against time".into(),
            x_title: "processor time / s".into(),
            y_title: "rms / mm".into(),
            depth: DEPTH,
            series: vec![Series {
                name: "tolerance, f32".into(),
                points: vec![
                    (0.1, 1e-3, "1%".into()),
                    (0.5, 1e-4, "0.1%".into()),
                    (0.0, 1e-3, "never".into()),
                    (0.2, 1e-12, "f64".into()),
                ],
            }],
            is_joined: true,
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
        assert!(svg.contains("not drawn: f64: 1e-12 at 0.20"));
        chart.is_joined = false;
        let lines = |svg: &str| svg.matches("<polyline").count();
        assert_eq!(lines(&chart.svg().unwrap()) + 1, lines(&svg));
        // The marker of the legend and the two points.
        assert_eq!(svg.matches("<circle").count(), 3);
    }

    #[test]
    fn series_of_one_colour_have_other_signs() {
        let series = |i: usize| Series {
            name: format!("series {i}"),
            points: vec![(1.0, 1.0 + i as f64, String::new()), (2.0, 2.0, String::new())],
        };
        let chart = |count: usize| Chart {
            title: String::new(),
            x_title: String::new(),
            y_title: String::new(),
            depth: DEPTH,
            series: (0..count).map(series).collect(),
            is_joined: true,
        };
        let disks = |count: usize| chart(count).svg().unwrap().matches("<circle").count();
        let triangles = |count: usize| chart(count).svg().unwrap().matches("<polygon").count();
        assert_eq!([8, 16, 17].map(disks), [24; 3]);
        assert_eq!([8, 16, 17].map(triangles), [0, 24, 24]);
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let labels: Vec<String> = ticks(&(-1.1..0.8)).into_iter().map(plain).collect();
        assert_eq!(labels, ["0.1", "0.2", "0.5", "1", "2", "5"]);
        assert_eq!(
            [-6.0, 1.5e-4f64.log10(), 1500f64.log10()].map(plain),
            ["1e-6", "1.5e-4", "1500"]
        );
    }
}
