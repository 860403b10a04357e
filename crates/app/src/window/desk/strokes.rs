//! What is done to the document: strokes of a hand, strokes at once, steps back and forth.

use std::time::Instant;

use document::{Command, CommandError, Document, Live};
use fitting::Control;
use glam::DVec3;
use tools::live::Pose;
use tools::session::Stroke;

use super::{Desk, InHand, LOOK};
use crate::view::Ray;
use crate::window::orders::{Acting, News};
use crate::window::tool::{Tool, Use};

impl Desk {
    pub(super) fn begin(&mut self, tool: Tool, ray: &Ray, press: Option<f64>) -> Result<(), String> {
        self.end();
        if tool.acts_at_once() {
            return self.begin_drawing(tool, ray);
        }
        let limits = self.limits.clone();
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some((start, _)) = open.start(ray) else {
            return Ok(());
        };
        let tool = open.own_tool(tool);
        let stroke = limits.on(tool.stroke(&start));
        let live = Live::begin(open.state(), &open.chosen, stroke).map_err(|e| e.to_string())?;
        let hold = (tool.kind.by() == Use::Grip).then_some([start.at, -start.along]);
        open.live = Some(InHand { live, tool, hold });
        self.step(pose(&tool, start.at, start.normal, press))
    }

    pub(super) fn along(&mut self, ray: &Ray, press: Option<f64>) -> Result<(), String> {
        self.draw_on(ray);
        let Some(open) = &self.open else { return Ok(()) };
        let Some(hand) = &open.live else { return Ok(()) };
        let at = match hand.hold {
            Some(plane) => {
                let at = open.own_ray(ray).and_then(|own| in_plane(&own, plane));
                at.map(Pose::at)
            }
            None => open
                .under(ray)
                .map(|(at, normal, _)| pose(&hand.tool, at, normal, press)),
        };
        at.map_or(Ok(()), |pose| self.step(pose))
    }

    /// One step of the stroke in the hand.
    fn step(&mut self, pose: Pose) -> Result<(), String> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some(hand) = &mut open.live else { return Ok(()) };
        let start = Instant::now();
        let done = hand.live.step(pose, &mut Control::default());
        let seen = done.and_then(|force| Ok((hand.live.look()?.0, force)));
        let _ = self.news.send(News::Step(start.elapsed().as_secs_f64()));
        match seen {
            Ok((state, force)) => {
                let placed = state.placement(&open.chosen).unwrap_or_default();
                let acting = Acting::of(&hand.live, pose.at, force, placed);
                open.shown = state;
                if acting.is_some() {
                    self.tell(News::Acting(acting));
                }
                Ok(())
            }
            Err(why) => {
                open.live = None;
                open.shown = open.state().clone();
                Err(format!("the stroke was left out: {why}"))
            }
        }
    }

    pub(in crate::window) fn end(&mut self) {
        self.untry();
        let Some(hand) = self.open.as_mut().and_then(|open| open.live.take()) else {
            return;
        };
        // The coarser surface follows before a whole picture is lit by it, which is before the edit is on the disk.
        self.show();
        let Some(open) = &mut self.open else { return };
        let Some(document) = &mut open.document else {
            return;
        };
        let acted = hand.live.moving().is_some();
        let ended = hand.live.end(document, &mut Control::default());
        open.shown = document.state().clone();
        if acted {
            self.tell(News::Acting(None));
        }
        match ended {
            Ok((_, notes)) => notes.into_iter().for_each(|note| self.tell(News::Note(note))),
            Err(CommandError::Document(why)) => {
                self.tell(News::Failed(format!("the edit is not on the disk: {why}")));
            }
            Err(why) => self.tell(News::Failed(format!("the stroke was left out: {why}"))),
        }
        self.lay_sheet();
    }

    pub(super) fn drop_stroke(&mut self) -> Result<(), String> {
        if let Some(open) = &mut self.open {
            open.live = None;
            open.drawn = None;
            open.shown = open.state().clone();
        }
        self.tell(News::Acting(None));
        Ok(())
    }

    /// Does a stroke on the chosen object that needs no hand.
    pub(super) fn apply(&mut self, stroke: Stroke) -> Result<(), String> {
        let Some(object) = self.open.as_ref().map(|open| open.chosen.clone()) else {
            return Ok(());
        };
        self.apply_all(vec![Command::Stroke {
            object,
            stroke: Box::new(stroke),
        }])
    }

    /// Does commands in their order, each an edit, until one cannot be done.
    pub(super) fn apply_all(&mut self, commands: Vec<Command>) -> Result<(), String> {
        self.end();
        for command in commands {
            self.apply_one(&command)?;
        }
        Ok(())
    }

    fn apply_one(&mut self, command: &Command) -> Result<(), String> {
        let Some(open) = &self.open else { return Ok(()) };
        let state = open.state().clone();
        let title = command.title();
        let (what, news, wake) = (title.clone(), self.news.clone(), self.wake.clone());
        let mut control = Control {
            cancel: self.begin_long(),
            on_progress: Box::new(move |at| {
                let _ = news.send(News::Busy(Some((format!("{what}: {}", at.stage), at.fraction))));
                wake(LOOK);
            }),
            ..Control::default()
        };
        let told = &self.news;
        let done = command.apply_watched(&state, &mut control, &mut |step| {
            // The progress that follows wakes the window.
            let _ = told.send(News::Moved(*step));
        });
        self.tell(News::Busy(None));
        let (next, notes) = done.map_err(|e| e.to_string())?;
        if let (Some(open), Command::Rename { object, to }) = (&mut self.open, command)
            && open.chosen == *object
        {
            open.chosen.clone_from(to);
        }
        self.turn_back(|document| document.commit(&title, command.to_value(), next).map(drop))?;
        notes.into_iter().for_each(|note| self.tell(News::Note(note)));
        Ok(())
    }

    pub(super) fn turn_back(
        &mut self,
        turn: impl FnOnce(&mut Document) -> Result<(), document::DocumentError>,
    ) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some(document) = &mut open.document else {
            return Ok(());
        };
        let turned = turn(document).map_err(|e| e.to_string());
        open.shown = document.state().clone();
        open.choose_what_is_there();
        self.lay_sheet();
        turned
    }
}

/// Where a tool is when a hand has it at a place of the surface, and presses so. What a solid does less it is less deep.
fn pose(tool: &Tool, at: DVec3, normal: DVec3, press: Option<f64>) -> Pose {
    let press = press.unwrap_or(1.0);
    Pose {
        press,
        ..Pose::at(tool.pressed(press).middle(at, normal))
    }
}

/// Where a line meets the plane through a place across a direction, in front of its eye.
pub(super) fn in_plane(ray: &Ray, [at, toward_eye]: [DVec3; 2]) -> Option<DVec3> {
    let fall = ray.along.dot(toward_eye);
    let far = (at - ray.from).dot(toward_eye) / fall;
    (fall.abs() > 1e-6 && far > 0.0).then(|| ray.from + far * ray.along)
}
