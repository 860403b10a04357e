//! What the window takes to show: a dab of a tool, a picture while something moves, a whole one.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bspline::Field;
use document::{Live, Object, State};
use fitting::Control;
use formats::field::FieldMeta;
use glam::{DAffine3, DVec2, DVec3};
use serde_json::{Map, Value};
use tools::live::Pose;

use super::ball::{Ball, CELLS, median, middle};
use super::{Chart, Series};
use crate::view::{
    BUDGET, Budget, Camera, Canvas, Card, LINE, Look, Mode, Paper, Patch, SKY, Shape, Show, Solid,
};
use crate::window::tool::{Kind, Settings, Start, Tool};

/// Cells of the balls, and their finest levels; the third has a million coefficients.
const BALLS: [(u32, u32); 4] = [(CELLS, 2), (CELLS, 3), (41, 3), (CELLS, 4)];
/// Pixels of a whole picture; a rough one has fewer along each side.
const SIZE: [u32; 2] = [1280, 720];
/// Dabs of which the median is taken, and steps of each stroke.
const DABS: usize = 8;
const STEPS: usize = 3;
/// Radius of a dab over the ball's diagonal.
const RADIUS: f64 = 1.0 / 40.0;
/// Time over which steps of the simulation are counted.
const COUNTED: Duration = Duration::from_secs(3);

/// Costs of one ball's pictures: medians, under the names that the chart gives them.
pub struct WindowCosts {
    coefficients: usize,
    costs: Vec<(&'static str, f64)>,
}

impl WindowCosts {
    /// All figures by name.
    pub fn json(&self) -> Value {
        let rounded = |x: f64| Value::from((x * 1e3).round() / 1e3);
        let costs = self.costs.iter();
        let mut all = Map::from_iter([("coefficients".to_string(), self.coefficients.into())]);
        all.extend(costs.map(|(name, cost)| ((*name).to_string(), rounded(*cost))));
        all.into()
    }
}

/// Measures balls of several sizes on a card; `go_on` is told of each before it is made. None if it says to stop.
///
/// # Errors
/// What the card, the mesher or a tool has against a ball.
pub fn window_costs(
    card: &Card,
    mut go_on: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<Option<Vec<WindowCosts>>, String> {
    let mut all = Vec::new();
    for (n, (cells, depth)) in BALLS.into_iter().enumerate() {
        if go_on(n as f64 / BALLS.len() as f64).is_break() {
            return Ok(None);
        }
        all.push(measure(card, &Ball::of(cells, depth))?);
    }
    Ok(Some(all))
}

fn measure(card: &Card, ball: &Ball) -> Result<WindowCosts, String> {
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    let object = Object::of(ball.field.clone().into(), meta);
    let state = State::new()
        .with("ball", object.clone())
        .map_err(|e| e.to_string())?;
    let within = object.field.world_box();
    let origin = within.center();
    let mut canvas = Canvas::new(&card.device, &card.queue, SKY, BUDGET);
    let start = Instant::now();
    let mut shape =
        Shape::new(&object, 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).map_err(|e| e.to_string())?;
    let patches = shape.all("ball", origin);
    let meshed = start.elapsed().as_secs_f64() * 1e3;
    let size = shape.bounding_box().ok_or("the ball has no surface")?.size();
    canvas.begin(origin, 0.5 * size.length());
    patches.iter().for_each(|patch| canvas.put(patch));
    let mut look = Look {
        camera: Camera::onto(origin, 0.5 * size.length(), DVec3::Y),
        cut: None,
        paint: true,
        mode: Mode::Mesh,
        density: [0.0, 1.0],
        paper: Paper::Dark,
        show: Show::default(),
        line: LINE,
    };
    let mut by = |mode: Mode, canvas: &mut Canvas, is_rough: bool| {
        look.camera.orbit(DVec2::new(0.01, 0.0));
        look.mode = mode;
        let pixels = SIZE.map(f64::from);
        let share = if is_rough {
            canvas.rough_share(mode, pixels[0] * pixels[1])
        } else {
            1.0
        };
        canvas.draw_all(
            &look,
            pixels.map(|n| (n * f64::from(share)).round() as u32),
            is_rough,
        );
        card.finish();
    };
    // The first of each is made ready, too.
    let mut times = |mode: Mode, count: usize, canvas: &mut Canvas| {
        [true, false].map(|is_rough| {
            by(mode, canvas, is_rough);
            median(count, |_| by(mode, canvas, is_rough)) / 1e3
        })
    };
    let [rough, whole] = times(Mode::Mesh, 20, &mut canvas);
    let without_triangles = if canvas.can_cast() {
        canvas.put_solid(
            "ball",
            Solid::of(&object, 0.0, DAffine3::IDENTITY).ok_or("the ball has no levels")?,
        );
        [Mode::Rays, Mode::Volume].map(|mode| times(mode, 5, &mut canvas))
    } else {
        [[f64::NAN; 2]; 2]
    };
    let [[rays_rough, rays], [volume_rough, volume]] = without_triangles;
    let mut picture = |canvas: &mut Canvas, is_rough: bool| by(Mode::Mesh, canvas, is_rough);
    let mut relit = || {
        canvas.put(&patches[0]);
        picture(&mut canvas, false);
    };
    let whole_after_edit = median(5, |_| relit()) / 1e3;
    let [dab, meshing, triangles] = dabs(card, ball, &state, &mut shape, &mut canvas)?;
    let alone = steps(ball, &state)?;
    let beside = {
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    picture(&mut canvas, true);
                }
            });
            let beside = steps(ball, &state);
            stop.store(true, Ordering::Relaxed);
            beside
        })?
    };
    Ok(WindowCosts {
        coefficients: ball.field.coefficient_count(),
        costs: vec![
            ("meshing_ms", meshed),
            ("step_ms", 1e3 / alone),
            ("dab_ms", dab),
            ("dab_meshing_ms", meshing),
            ("dab_triangles", triangles),
            ("rough_picture_ms", rough),
            ("whole_picture_ms", whole),
            ("whole_picture_after_edit_ms", whole_after_edit),
            ("rough_rays_ms", rays_rough),
            ("whole_rays_ms", rays),
            ("rough_volume_ms", volume_rough),
            ("whole_volume_ms", volume),
            ("simulation_share_beside_pictures", beside / alone),
        ],
    })
}

/// Milliseconds from a dab's field to its triangles on the card, those of them that meshing takes, and the triangles.
fn dabs(
    card: &Card,
    ball: &Ball,
    state: &State,
    shape: &mut Shape,
    canvas: &mut Canvas,
) -> Result<[f64; 3], String> {
    let (mut times, mut meshing, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for n in 0..DABS {
        let mut stroke = Stroke::begin(ball, state, n)?;
        for step in 0..STEPS {
            let now = stroke.step(step)?;
            let object = now.object("ball").map_err(|e| e.to_string())?;
            let start = Instant::now();
            let patches = follow(shape, object)?;
            meshing.push(start.elapsed().as_secs_f64() * 1e3);
            patches.iter().for_each(|patch| canvas.put(patch));
            card.queue.submit([]);
            card.finish();
            times.push(start.elapsed().as_secs_f64() * 1e3);
            let count: usize = patches.iter().map(|p| p.indices.len() / 3).sum();
            triangles.push(count as f64);
        }
        // The next begins on a whole ball.
        let object = state.object("ball").map_err(|e| e.to_string())?;
        follow(shape, object)?.iter().for_each(|patch| canvas.put(patch));
    }
    Ok([times, meshing, triangles].map(middle))
}

fn follow(shape: &mut Shape, object: &Object) -> Result<Vec<Patch>, String> {
    let origin = object.field.world_box().center();
    shape
        .follow_stroke("ball", object, origin)
        .map_err(|e| e.to_string())
}

/// Steps a second of strokes by themselves.
fn steps(ball: &Ball, state: &State) -> Result<f64, String> {
    let (start, mut count) = (Instant::now(), 0);
    for n in 0.. {
        let mut stroke = Stroke::begin(ball, state, n)?;
        for step in 0..STEPS {
            stroke.step(step)?;
            count += 1;
            if start.elapsed() > COUNTED {
                return Ok(f64::from(count) / start.elapsed().as_secs_f64());
            }
        }
    }
    unreachable!("numbers do not end")
}

/// A stroke that lays clay on.
struct Stroke {
    live: Live,
    tool: Tool,
    at: DVec3,
    normal: DVec3,
}

impl Stroke {
    fn begin(ball: &Ball, state: &State, n: usize) -> Result<Self, String> {
        let at = ball.scattered(n);
        let normal = -ball.field.value_gradient(at).1.normalize();
        let tool = Tool {
            kind: Kind::Add,
            radius: RADIUS * ball.diagonal(),
            strength: 0.5,
            inverted: false,
            settings: Settings::default(),
        };
        let live = Live::begin(state, "ball", tool.stroke(&Start::at(at))).map_err(|e| e.to_string())?;
        Ok(Self {
            live,
            tool,
            at,
            normal,
        })
    }

    fn step(&mut self, n: usize) -> Result<State, String> {
        let aside = 0.2 * self.tool.radius * n as f64 * self.normal.any_orthonormal_vector();
        let pose = Pose::at(self.tool.middle(self.at + aside, self.normal));
        let stepped = self.live.step(pose, &mut Control::default());
        let looked = stepped.and_then(|_| self.live.look());
        looked.map(|(state, _)| state).map_err(|e| e.to_string())
    }
}

impl Chart {
    /// Times against the size of the field.
    pub fn of_window(all: &[WindowCosts]) -> Self {
        let names = all.first().into_iter().flat_map(|first| &first.costs);
        let times = names
            .enumerate()
            .filter_map(|(i, (name, _))| Some((i, name.strip_suffix("_ms")?)));
        let series = times.map(|(i, name)| Series {
            name: name.replace('_', " "),
            points: all
                .iter()
                .map(|c| (c.coefficients as f64, c.costs[i].1, String::new()))
                .collect(),
        });
        Self {
            title: "the window: times of what it shows against the size of the field".into(),
            x_title: "coefficients of the field".into(),
            y_title: "time, ms".into(),
            depth: 1e-3,
            series: series.collect(),
            is_joined: true,
        }
    }
}
