//! Everything that a key, a menu or the command palette can do, in one table.

use egui::{Context, Key, KeyboardShortcut, Modifiers};
use glam::DVec3;

use super::Bench;
use super::adjust::What;
use super::arrange::Change;
use super::docks::Rearrange;
use super::kept::{Sides, Theme};
use super::layout::Panel;
use super::orders::Order;
use super::tool::Kind;
use crate::panels;
use crate::view::Pair;

/// Something that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Action {
    /// One of the program's own.
    Do(Name),
    /// Takes a tool of the palette.
    Take(Kind),
}

macro_rules! actions {
    ($($name:ident: $group:literal, $id:literal, $text:literal, $key:expr;)*) => {
        /// What the program does itself.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "each is told by its text below")]
        pub enum Name { $($name,)* }

        impl Name {
            const ALL: &[Self] = &[$(Self::$name),*];

            fn about(self) -> (&'static str, &'static str, &'static str, Option<KeyboardShortcut>) {
                match self { $(Self::$name => ($group, $id, $text, $key),)* }
            }
        }
    };
}

const fn plain(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::NONE, key))
}

const fn ctrl(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::COMMAND, key))
}

const fn shift(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::SHIFT, key))
}

const fn ctrl_shift(key: Key) -> Option<KeyboardShortcut> {
    let both = Modifiers {
        shift: true,
        ..Modifiers::COMMAND
    };
    Some(KeyboardShortcut::new(both, key))
}

actions! {
    Open: "File", "open", "Open…", ctrl(Key::O);
    Preview: "File", "open-part", "Preview and open…", ctrl_shift(Key::O);
    NewClay: "File", "new-clay", "New block of clay", ctrl(Key::N);
    Save: "File", "save", "Save as…", ctrl(Key::S);
    SaveScript: "File", "save-script", "Save script…", None;
    RunScript: "File", "run-script", "Run script…", None;
    Export: "File", "export", "Export…", ctrl(Key::E);
    Quit: "File", "quit", "Quit", ctrl(Key::Q);
    Undo: "Edit", "undo", "Undo", ctrl(Key::Z);
    Redo: "Edit", "redo", "Redo", ctrl_shift(Key::Z);
    Duplicate: "Edit", "duplicate", "Duplicate the object", shift(Key::D);
    Remove: "Edit", "remove", "Remove the object", plain(Key::Delete);
    Arrange: "Edit", "arrange", "Arrange objects", ctrl(Key::Tab);
    Shift: "Edit", "arrange-move", "Move the object", plain(Key::G);
    Turn: "Edit", "arrange-turn", "Turn the object", plain(Key::R);
    Scale: "Edit", "arrange-scale", "Scale the object", plain(Key::S);
    Commands: "Edit", "commands", "Command palette…", plain(Key::F3);
    Shortcuts: "Edit", "shortcuts", "Shortcuts…", None;
    Front: "View", "front", "Front", plain(Key::Num1);
    Right: "View", "right", "Right", plain(Key::Num3);
    Top: "View", "top", "Top", plain(Key::Num7);
    All: "View", "all", "All", plain(Key::Home);
    Perspective: "View", "perspective", "Perspective", plain(Key::Num5);
    NextMode: "View", "next-mode", "Mesh, rays, volume", plain(Key::V);
    NoStereo: "View", "stereo-off", "Stereo off", None;
    SideBySide: "View", "stereo-side-by-side", "Stereo side by side", None;
    Anaglyph: "View", "stereo-anaglyph", "Stereo for red and cyan glasses", None;
    Paint: "View", "paint", "Painted stiffness", None;
    Hide: "View", "hide", "Hide the object", ctrl(Key::H);
    Alone: "View", "alone", "Show this object alone", None;
    ShowAll: "View", "show-all", "Show all objects", ctrl_shift(Key::H);
    Wireframe: "View", "wireframe", "Wireframe", None;
    Floor: "View", "floor", "Floor and axes", None;
    Second: "View", "second-surface", "Second surface", None;
    Points: "View", "input-points", "Input points", None;
    Picture: "View", "picture", "Picture…", None;
    Slices: "View", "slices", "Slices", None;
    FourViews: "View", "four-views", "Four views", None;
    Clip: "View", "clip", "Clipping plane", None;
    Touch: "View", "touch", "Touch", None;
    Measure: "View", "measure", "Measure", plain(Key::M);
    Simulation: "View", "simulation", "Simulation", None;
    Performance: "View", "performance", "Performance", None;
    Log: "View", "log", "Log", None;
    Tools: "View", "tool-panel", "Tool panel", None;
    Objects: "View", "object-panel", "Object panel", None;
    Sides: "View", "sides", "Panels change sides", None;
    AsAtFirst: "View", "layout-as-at-first", "Layout as at first", None;
    Panels: "View", "panels", "Side panels", plain(Key::F9);
    Dark: "View", "dark", "Dark", None;
    Light: "View", "light", "Light", None;
    AsSystem: "View", "as-the-system", "Light or dark as the system", None;
    Pins: "Tool", "pins", "Pin points", plain(Key::N);
    Smaller: "Tool", "smaller", "Smaller tool", plain(Key::OpenBracket);
    Larger: "Tool", "larger", "Larger tool", plain(Key::CloseBracket);
    Radius: "Tool", "radius", "Radius by the mouse", plain(Key::F);
    Strength: "Tool", "strength", "Strength by the mouse", shift(Key::F);
}

impl Action {
    /// All, by their groups.
    pub fn all() -> impl Iterator<Item = Self> {
        let tools = Kind::ALL.iter().map(|kind| Self::Take(*kind));
        Name::ALL.iter().map(|name| Self::Do(*name)).chain(tools)
    }

    /// Where menus have it.
    pub fn group(self) -> &'static str {
        match self {
            Self::Do(name) => name.about().0,
            Self::Take(_) => "Take a tool",
        }
    }

    /// By which files know it.
    pub fn id(self) -> String {
        match self {
            Self::Do(name) => name.about().1.into(),
            Self::Take(kind) => format!("tool-{}", kind.name().to_lowercase().replace(' ', "-")),
        }
    }

    /// As people read it.
    pub fn text(self) -> &'static str {
        match self {
            Self::Do(name) => name.about().2,
            Self::Take(kind) => kind.name(),
        }
    }

    /// The keys that it has if nobody says others.
    pub fn usual(self) -> Option<KeyboardShortcut> {
        match self {
            Self::Do(name) => name.about().3,
            Self::Take(kind) => kind.key().and_then(plain),
        }
    }

    /// Whether its keys count only while objects are arranged, or only while they are sculpted; always if missing.
    pub fn while_arranging(self) -> Option<bool> {
        match self {
            Self::Do(Name::Shift | Name::Turn | Name::Scale) => Some(true),
            Self::Do(Name::Radius | Name::Strength | Name::Smaller | Name::Larger | Name::Pins)
            | Self::Take(_) => Some(false),
            Self::Do(_) => None,
        }
    }

    /// Whether one key cannot serve both.
    pub fn meets(self, other: Self) -> bool {
        let [a, b] = [self, other].map(Self::while_arranging);
        self != other && (a.is_none() || b.is_none() || a == b)
    }

    /// Whether it can be done now.
    pub fn is_possible(self, bench: &Bench) -> bool {
        let Self::Do(name) = self else { return true };
        let sheet = bench.sheet.as_ref();
        match name {
            Name::Open | Name::Preview | Name::NewClay | Name::Quit | Name::Commands | Name::Shortcuts => {
                true
            }
            Name::Log | Name::Performance | Name::Dark | Name::Light | Name::AsSystem => true,
            Name::Undo => sheet.is_some_and(|s| s.done > 0),
            Name::Redo => sheet.is_some_and(|s| s.done < s.history.len()),
            Name::Remove => sheet.is_some_and(|s| s.objects.len() > 1),
            Name::NextMode => bench.can_cast,
            _ => sheet.is_some(),
        }
    }

    /// Whether it is a thing that is on now, for those that are on or off.
    pub fn is_on(self, bench: &Bench) -> Option<bool> {
        let Self::Do(name) = self else { return None };
        Some(match name {
            Name::Perspective => bench.look.camera.perspective,
            Name::NoStereo => bench.look.show.stereo.pair == Pair::Off,
            Name::SideBySide => bench.look.show.stereo.pair == Pair::Beside,
            Name::Anaglyph => bench.look.show.stereo.pair == Pair::Anaglyph,
            Name::Paint => bench.look.paint,
            Name::Wireframe => bench.look.show.wireframe,
            Name::Floor => bench.look.show.floor,
            Name::Second => bench.look.show.second,
            Name::Points => bench.look.show.points,
            Name::Slices => bench.slices.is_some(),
            Name::FourViews => bench.slices.as_ref().is_some_and(|slices| slices.is_four_up),
            Name::Clip => bench.look.cut.is_some(),
            Name::Touch => bench.touch.is_some(),
            Name::Measure => bench.measure.is_some(),
            Name::Simulation => bench.simulation.is_open,
            Name::Performance => bench.performance.is_open,
            Name::Log => bench.shows_log,
            Name::Pins => bench.pins,
            Name::Arrange => bench.arranging,
            Name::Panels => bench.sides.are_shown,
            Name::Tools => bench.is_open(Panel::Tools),
            Name::Objects => bench.is_open(Panel::Objects),
            _ => return None,
        })
    }

    /// Does it, as far as it is possible now.
    pub fn run(self, bench: &mut Bench, context: &Context) {
        if !self.is_possible(bench) {
            return;
        }
        match self {
            Self::Take(kind) => bench.take(kind),
            Self::Do(name) => name.run(bench, context),
        }
    }
}

impl Name {
    fn run(self, bench: &mut Bench, context: &Context) {
        let sheet = bench.sheet.clone();
        let up = bench.look.camera.up;
        match self {
            Self::Open => bench.asks = Some(panels::PathBox::open()),
            Self::Preview => bench.asks = Some(panels::PathBox::open_part()),
            Self::NewClay => bench.order(Order::Clay),
            Self::Save => bench.asks = sheet.map(|s| panels::PathBox::save(&s)),
            Self::SaveScript => bench.asks = sheet.map(|s| panels::PathBox::save_script(&s)),
            Self::RunScript => bench.asks = Some(panels::PathBox::run_script()),
            Self::Export => bench.asks = sheet.map(|s| panels::PathBox::export(&s)),
            Self::Quit => context.send_viewport_cmd(egui::ViewportCommand::Close),
            Self::Undo => bench.order(Order::Undo(1)),
            Self::Redo => bench.order(Order::Redo(1)),
            Self::Duplicate => bench.duplicate(),
            Self::Remove => bench.remove(),
            Self::Arrange => bench.arranging ^= true,
            Self::Shift => bench.arranges = Some(Change::Shift),
            Self::Turn => bench.arranges = Some(Change::Turn),
            Self::Scale => bench.arranges = Some(Change::Scale),
            Self::Commands => bench.commands = Some(panels::Commands::default()),
            Self::Shortcuts => bench.shortcuts = Some(panels::Shortcuts::default()),
            Self::Front => {
                let front = if up == DVec3::Z { -DVec3::Y } else { DVec3::Z };
                bench.look.camera.look_from(front);
            }
            Self::Right => bench.look.camera.look_from(DVec3::X),
            Self::Top => bench.look.camera.look_from(up),
            Self::All => bench.frame_all(),
            Self::Perspective => bench.look.camera.perspective ^= true,
            Self::NextMode => bench.look.mode = panels::next_mode(bench.look.mode),
            Self::NoStereo => bench.look.show.stereo.pair = Pair::Off,
            Self::SideBySide => bench.look.show.stereo.pair = Pair::Beside,
            Self::Anaglyph => bench.look.show.stereo.pair = Pair::Anaglyph,
            Self::Dark => Theme::Dark.give(context),
            Self::Light => Theme::Light.give(context),
            Self::AsSystem => Theme::System.give(context),
            Self::Paint => bench.look.paint ^= true,
            Self::Hide => bench.hide_chosen(),
            Self::Alone => bench.hide_others(),
            Self::ShowAll => bench.hidden.clear(),
            Self::Wireframe => bench.look.show.wireframe ^= true,
            Self::Floor => bench.look.show.floor ^= true,
            Self::Picture => bench.shot.is_open = true,
            Self::Second => bench.look.show.second ^= true,
            Self::Points => bench.look.show.points ^= true,
            Self::FourViews => {
                bench.slices.get_or_insert_with(panels::Slices::new).is_four_up ^= true;
            }
            Self::Slices => {
                bench.slices = match bench.slices {
                    Some(_) => None,
                    None => Some(panels::Slices::new()),
                }
            }
            Self::Clip => {
                let toward_eye = bench.look.camera.axes()[2];
                bench.look.cut = match bench.look.cut {
                    Some(_) => None,
                    None => Some((bench.scene.0, toward_eye)),
                }
            }
            Self::Touch => {
                bench.touch = match bench.touch {
                    Some(_) => None,
                    None => Some(panels::TouchWish::new()),
                };
                if bench.held.is_some() {
                    bench.order(Order::LetGo);
                }
            }
            Self::Measure => {
                bench.measure = match bench.measure {
                    Some(_) => None,
                    None => Some(Default::default()),
                }
            }
            Self::Simulation => bench.simulation.is_open ^= true,
            Self::Performance => bench.performance.is_open ^= true,
            Self::Log => bench.shows_log ^= true,
            Self::Tools => bench.sides = bench.sides.toggled(|sides| &mut sides.has_tools),
            Self::Objects => bench.sides = bench.sides.toggled(|sides| &mut sides.has_objects),
            Self::Sides => bench.rearranges = Some(Rearrange::Mirror),
            Self::AsAtFirst => {
                bench.rearranges = Some(Rearrange::AsAtFirst);
                bench.sides = Sides::default();
            }
            Self::Panels => bench.sides.are_shown ^= true,
            Self::Pins => bench.pins ^= true,
            Self::Smaller => bench.tool.radius = (bench.tool.radius / 1.15).max(panels::RADII[0]),
            Self::Larger => bench.tool.radius = (bench.tool.radius * 1.15).min(panels::RADII[1]),
            Self::Radius => bench.adjusts = Some(What::Radius),
            Self::Strength => bench.adjusts = Some(What::Strength),
        }
    }
}
