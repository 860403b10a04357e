//! Tools that act at once on what was drawn, and what they would leave, shown before a click.

use bspline::Aabb;
use document::{Command, Preview};
use fitting::Control;

use super::strokes::in_plane;
use super::{Clip, Desk, Open};
use crate::panels;
use crate::view::{Ray, leave};
use crate::window::orders::{News, Thing};
use crate::window::tool::{Drawn, Kind, Start, Tool, Use, surface_within};

/// Places of a line lie at least this apart, in radii of the tool.
const APART: f64 = 0.25;

impl Desk {
    pub(super) fn begin_drawing(&mut self, tool: Tool, ray: &Ray) -> Result<(), String> {
        let Some(drawn) = self.drawn_at(ray) else {
            return Ok(());
        };
        if let Some(open) = &mut self.open {
            open.drawn = Some((open.own_tool(tool), drawn));
        }
        Ok(())
    }

    /// What begins where a line meets the chosen object.
    fn drawn_at(&self, ray: &Ray) -> Option<Drawn> {
        let open = self.open.as_ref()?;
        let (start, whole) = open.start(ray)?;
        let mut drawn = Drawn::new(start, whole);
        let thing = Thing::of(open.state(), &open.chosen);
        drawn.name = thing.map_or(drawn.name, |thing| panels::next_hold(&thing, "pin"));
        drawn.free = open.free_name("part");
        drawn.part = open.part();
        Some(drawn)
    }

    pub(super) fn draw_on(&mut self, ray: &Ray) {
        let Some(open) = &self.open else { return };
        let Some((tool, drawn)) = &open.drawn else { return };
        let on_surface = open.under(ray).map(|(at, ..)| at);
        let plane = [drawn.start.at, -drawn.start.along];
        let to = open.own_ray(ray).and_then(|own| in_plane(&own, plane));
        let (to, apart) = (to.unwrap_or(drawn.to), APART * tool.radius);
        if let Some((_, drawn)) = self.open.as_mut().and_then(|open| open.drawn.as_mut()) {
            drawn.go_on(on_surface, to, apart);
        }
    }

    /// The button came up: the tool acts on what was drawn.
    pub(super) fn end_drawing(&mut self) -> Result<(), String> {
        let Some((tool, mut drawn)) = self.open.as_mut().and_then(|open| open.drawn.take()) else {
            return Ok(());
        };
        let Some(chosen) = self.open.as_ref().map(|open| open.chosen.clone()) else {
            return Ok(());
        };
        // The window has it already.
        if tool.kind == Kind::Lasso {
            return Ok(());
        }
        let clip = |from: &str| Clip {
            from: from.into(),
            region: tool.region(drawn.start.at),
        };
        if tool.kind == Kind::Copy {
            let told = format!("a box of {chosen} is copied; paste it by a click");
            if let Some(open) = &mut self.open {
                open.clip = Some(clip(&chosen));
            }
            self.tell(News::Note(told));
            return Ok(());
        }
        if let (Kind::PinBox, Some(open)) = (tool.kind, &self.open)
            && let Some(thing) = Thing::of(open.state(), &open.chosen)
        {
            drawn.name = panels::next_hold(&thing, "box");
            drawn.line = surface_within(&*thing.field, thing.iso, &tool.region(drawn.start.at))?;
        }
        let stroke = self.limits.on(tool.made(&drawn)?);
        self.apply(stroke)?;
        if tool.kind == Kind::Cut {
            self.tell(News::Hide(drawn.free.clone()));
            if let Some(open) = &mut self.open {
                open.clip = Some(clip(&drawn.free));
            }
        }
        Ok(())
    }

    /// Shows what a click would leave where a line meets the chosen object.
    pub(super) fn show_tried(&mut self) {
        let Some((tool, ray)) = self.tried.take() else {
            return;
        };
        let Some(drawn) = self.drawn_at(&ray) else {
            return self.untry();
        };
        let limits = self.limits.clone();
        let Some(open) = &mut self.open else { return };
        // What is held looks as it did.
        let leaves_all = tool.kind.by() != Use::Click || tool.kind == Kind::PinBox;
        if open.live.is_some() || open.drawn.is_some() || leaves_all {
            return;
        }
        // What cannot be done is told when it is asked for.
        let shown = open.own_tool(tool).made(&drawn).ok().and_then(|stroke| {
            let command = Command::Stroke {
                object: open.chosen.clone(),
                stroke: Box::new(limits.on(stroke)),
            };
            Preview::of(open.state(), command, &mut Control::default()).ok()
        });
        open.shown = shown.map_or_else(|| open.state().clone(), |preview| preview.state().clone());
        open.is_tried = true;
    }

    /// What would be left is no longer shown.
    pub(super) fn untry(&mut self) {
        self.tried = None;
        if let Some(open) = &mut self.open
            && std::mem::take(&mut open.is_tried)
        {
            open.shown = open.state().clone();
        }
    }
}

impl Open {
    /// Where a line meets the chosen object, and the box of that.
    pub(super) fn start(&self, ray: &Ray) -> Option<(Start, Aabb)> {
        let (at, normal, own) = self.under(ray)?;
        let object = self.state().object(&self.chosen).ok()?;
        let whole = object.field.world_box();
        let beyond = leave(object.field.as_field(), object.iso()?, &whole, at, own.along);
        let start = Start {
            at,
            normal,
            along: own.along,
            beyond,
        };
        Some((start, whole))
    }

    /// A tool with its radius in lengths of the chosen object.
    pub(super) fn own_tool(&self, tool: Tool) -> Tool {
        let placed = self.state().placement(&self.chosen);
        let stretch = placed.map_or(1.0, |placed| placed.matrix3.determinant().abs().cbrt());
        Tool {
            radius: tool.radius / stretch,
            ..tool
        }
    }

    /// What was copied, as it lies to the chosen object.
    fn part(&self) -> Option<(String, Aabb)> {
        let clip = self.clip.as_ref()?;
        let state = self.state();
        let (there, here) = (
            state.placement(&clip.from).ok()?,
            state.placement(&self.chosen).ok()?,
        );
        let region = match there == here {
            true => clip.region,
            false => clip.region.transformed(&(here.inverse() * there)),
        };
        Some((clip.from.clone(), region))
    }

    /// A name that no object has.
    pub(super) fn free_name(&self, stem: &str) -> String {
        let objects = self.state().objects();
        let names = (1..).map(|n| format!("{stem} {n}"));
        let free = names.into_iter().find(|name| !objects.contains_key(name));
        free.expect("there is always another number")
    }

    /// Another object is chosen where the one that was is no more.
    pub(super) fn choose_what_is_there(&mut self) {
        if !self.shown.objects().contains_key(&self.chosen)
            && let Some(first) = self.shown.objects().keys().next()
        {
            self.chosen = first.clone();
        }
    }
}
