//! What is done to the document: strokes of a hand, strokes at once, steps back and forth.

use document::{Command, CommandError, Document, Live};
use fitting::Control;
use glam::DVec3;
use tools::live::Pose;
use tools::session::Stroke;

use super::{Desk, InHand};
use crate::view::Ray;
use crate::window::orders::{Acting, News};
use crate::window::tool::Tool;

impl Desk {
    pub(super) fn begin(&mut self, tool: Tool, ray: &Ray) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some((at, normal, own)) = open.under(ray) else {
            return Ok(());
        };
        let stroke = tool.stroke(at);
        let live = Live::begin(open.state(), &open.chosen, stroke).map_err(|e| e.to_string())?;
        let hold = tool.takes_hold().then_some([at, -own.along]);
        open.live = Some(InHand { live, tool, hold });
        self.step(tool.middle(at, normal))
    }

    pub(super) fn along(&mut self, ray: &Ray) -> Result<(), String> {
        let Some(open) = &self.open else { return Ok(()) };
        let Some(hand) = &open.live else { return Ok(()) };
        let at = match hand.hold {
            Some([at, toward_eye]) => open.own_ray(ray).and_then(|own| {
                let fall = own.along.dot(toward_eye);
                let far = (at - own.from).dot(toward_eye) / fall;
                (fall.abs() > 1e-6 && far > 0.0).then(|| own.from + far * own.along)
            }),
            None => open
                .under(ray)
                .map(|(at, normal, _)| hand.tool.middle(at, normal)),
        };
        at.map_or(Ok(()), |at| self.step(at))
    }

    /// One step of the stroke in the hand.
    fn step(&mut self, at: DVec3) -> Result<(), String> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some(hand) = &mut open.live else { return Ok(()) };
        let done = hand.live.step(Pose::at(at), &mut Control::default());
        let seen = done.and_then(|force| Ok((hand.live.look()?.0, force)));
        match seen {
            Ok((state, force)) => {
                let placed = state.placement(&open.chosen).unwrap_or_default();
                let acting = Acting::of(&hand.live, at, force, placed);
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
        let Some(open) = &mut self.open else { return };
        let (Some(hand), Some(document)) = (open.live.take(), &mut open.document) else {
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
            open.shown = open.state().clone();
        }
        self.tell(News::Acting(None));
        Ok(())
    }

    /// Does a stroke that needs no hand.
    pub(super) fn apply(&mut self, stroke: Stroke) -> Result<(), String> {
        self.end();
        let Some(open) = &self.open else { return Ok(()) };
        let (state, object) = (open.state().clone(), open.chosen.clone());
        let command = Command::Stroke {
            object,
            stroke: Box::new(stroke),
        };
        let title = command.title();
        let (what, news, wake) = (title.clone(), self.news.clone(), self.wake.clone());
        let mut control = Control {
            cancel: self.begin_long(),
            on_progress: Box::new(move |at| {
                let _ = news.send(News::Busy(Some((format!("{what}: {}", at.stage), at.fraction))));
                wake();
            }),
            ..Control::default()
        };
        let done = command.apply(&state, &mut control);
        self.tell(News::Busy(None));
        let (next, notes) = done.map_err(|e| e.to_string())?;
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
        self.lay_sheet();
        turned
    }
}
