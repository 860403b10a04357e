//! What the hand touches with.

use std::path::Path;
use std::str::FromStr;

use fitting::Cancel;
use glam::DVec3;
use tools::haptics::{PointTool, Sampling};

use crate::cli::failure::{Failure, Outcome};
use crate::cli::input::limits;
use crate::cli::source::{POINTS, Source};

/// What the hand touches with, as it is written. Lengths are mm of the device.
#[derive(Clone, Debug, PartialEq)]
pub enum Tool {
    /// A ball that does not turn, of `--radius`.
    Ball,
    /// A tool of many points, by name and sizes.
    Shaped(&'static Form, Vec<f64>),
    /// The vertices of a file.
    Points(String),
}

/// A tool that has a name.
#[derive(Debug, PartialEq)]
pub struct Form {
    name: &'static str,
    /// One that it may be, with what its sizes are.
    sizes: &'static str,
    count: usize,
}

const FORMS: [Form; 6] = [
    Form::new("sphere", "sphere:5 (radius)", 1),
    Form::new("cylinder", "cylinder:4x12 (radius, length)", 2),
    Form::new("box", "box:10x10x10", 3),
    Form::new("plate", "plate:20x30x1 (width, length, thickness)", 3),
    Form::new("spatula", "spatula:10x30x1 (width, length, thickness)", 3),
    Form::new("knife", "knife:12x30x2 (height, length, back)", 3),
];

impl Form {
    const fn new(name: &'static str, sizes: &'static str, count: usize) -> Self {
        Self { name, sizes, count }
    }
}

fn known() -> String {
    let forms: Vec<_> = FORMS.iter().map(|form| form.sizes).collect();
    format!("write ball, {} or points:FILE", forms.join(", "))
}

impl FromStr for Tool {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        if text == "ball" {
            return Ok(Self::Ball);
        }
        if name == "points" && !rest.is_empty() {
            return Ok(Self::Points(rest.into()));
        }
        let form = FORMS.iter().find(|form| form.name == name).ok_or_else(known)?;
        let sizes: Option<Vec<f64>> = rest.split('x').map(|size| size.parse().ok()).collect();
        sizes
            .filter(|sizes| sizes.len() == form.count)
            .map(|sizes| Self::Shaped(form, sizes))
            .ok_or_else(|| format!("write it with its sizes in mm, as {}", form.sizes))
    }
}

impl Tool {
    /// The tool of many points; nothing for the ball.
    pub fn points(&self, cancel: &Cancel) -> Outcome<Option<PointTool>> {
        let s = Sampling::default();
        let made = match self {
            Self::Ball => return Ok(None),
            Self::Shaped(form, sizes) => match (form.name, &sizes[..]) {
                ("sphere", [r]) => PointTool::sphere(*r, s),
                ("cylinder", [r, l]) => PointTool::cylinder(*r, *l, s),
                ("box", [x, y, z]) => PointTool::block(DVec3::new(*x, *y, *z), s),
                ("plate", [w, l, t]) => PointTool::plate(*w, *l, *t, s),
                ("spatula", [w, l, t]) => PointTool::spatula(*w, *l, *t, s),
                ("knife", [h, l, b]) => PointTool::knife(*h, *l, *b, s),
                _ => unreachable!("forms have as many sizes as they say"),
            },
            Self::Points(file) => {
                let source = Source::open(Path::new(file), None, POINTS, cancel)?.under("--tool");
                let cloud = formats::points::read(source.path(), &limits(None));
                PointTool::scattered(&cloud.map_err(|e| source.reading(e))?.positions, s)
            }
        };
        made.map(Some)
            .map_err(|why| Failure::usage(format!("--tool: {why}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_is_read_as_it_is_shown() {
        for form in &FORMS {
            let shown = form.sizes.split(' ').next().expect("a form");
            let tool: Tool = shown.parse().expect("what is shown is right");
            let made = tool.points(&Cancel::default()).expect("sizes").expect("points");
            assert!(made.points().len() <= 80 && made.extent() < 20.0, "{shown}");
            assert!(
                format!("{shown}x1")
                    .parse::<Tool>()
                    .unwrap_err()
                    .contains(form.sizes)
            );
        }
        assert_eq!("ball".parse(), Ok(Tool::Ball));
        assert_eq!("points:a:b.ply".parse(), Ok(Tool::Points("a:b.ply".into())));
        for wrong in ["plough", "points:", "plate", "ball:2"] {
            assert!(wrong.parse::<Tool>().is_err(), "{wrong}");
        }
    }
}
