//! The panels round the scene, which are moved by their upper rim or their tab, laid one before the other, closed and opened again.

mod titles;

use std::collections::BTreeSet;

use egui::{
    Color32, CursorIcon, Frame, Rect, Response, Role, Sense, Stroke, Ui, Visuals, WidgetInfo, WidgetText,
    vec2,
};
use egui_tiles::{
    Behavior, Container, Linear, LinearDir, ResizeState, Tile, TileId, Tiles, Tree, UiResponse,
};

use self::titles::{ASIDE, Titles, titles};
use super::layout::{Layout, Panel};
use super::modeler::Modeler;
use crate::panels;

/// Height of the rim by which a panel is taken: what panels leave empty there.
const RIM: f32 = 8.0;

/// Share of what was dropped somewhere.
const NEW: f32 = 1.0;
/// Width of a panel that was dropped beside the scene, points.
const WIDTH: f32 = 210.0;

/// What is to be done to the layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rearrange {
    /// All panels are where they were at first.
    AsAtFirst,
    /// Left and right change.
    Mirror,
}

/// The panels, where they are.
pub struct Docks {
    tree: Tree<Panel>,
    /// Those that were open in the picture before.
    open: BTreeSet<Panel>,
}

impl Docks {
    /// As they were kept; as at first where that is nonsense.
    pub fn new(kept: Option<&Layout>) -> Self {
        let layout = kept
            .filter(|layout| layout.is_whole())
            .cloned()
            .unwrap_or_default();
        Self {
            tree: layout.tree(),
            open: BTreeSet::new(),
        }
    }

    /// Where they are; nothing where that is as at first.
    pub fn layout(&self) -> Option<Layout> {
        let now = Layout::of(&self.tree);
        (now != Layout::default()).then_some(now)
    }

    fn rearrange(&mut self, how: Rearrange) {
        match how {
            Rearrange::AsAtFirst => *self = Self::new(None),
            Rearrange::Mirror => {
                let root = self.tree.root().and_then(|root| self.tree.tiles.get_mut(root));
                if let Some(Tile::Container(Container::Linear(line))) = root {
                    line.children.reverse();
                }
            }
        }
    }

    /// Those that are closed keep their place; one that is opened comes to the front.
    fn open_and_close(&mut self, open: BTreeSet<Panel>) {
        let of = |tile: &Tile<Panel>| match tile {
            Tile::Pane(panel) => Some(*panel),
            Tile::Container(_) => None,
        };
        let all: Vec<_> = self
            .tree
            .tiles
            .iter()
            .filter_map(|(id, tile)| Some((*id, of(tile)?)))
            .collect();
        for (id, panel) in all {
            self.tree.set_visible(id, open.contains(&panel));
        }
        for new in open.difference(&self.open).filter(|_| !self.open.is_empty()) {
            self.tree.make_active(|_, tile| of(tile) == Some(*new));
        }
        self.open = open;
    }

    /// What was dropped between others gets a share as theirs: shares are points here, and the tiles know only that it is one of them.
    fn give_room(&mut self) {
        let root = self.tree.root();
        for (id, tile) in self.tree.tiles.iter_mut() {
            let Tile::Container(Container::Linear(line)) = tile else {
                continue;
            };
            let is_new = |line: &Linear, id: TileId| line.shares[id] <= NEW;
            let known = line.children.iter().filter(|id| !is_new(line, **id));
            let known: Vec<f32> = known.map(|id| line.shares[*id]).collect();
            let is_window = root == Some(*id) && line.dir == LinearDir::Horizontal;
            let share = match known.len() {
                _ if is_window => WIDTH,
                0 => continue,
                count => known.iter().sum::<f32>() / count as f32,
            };
            for id in line.children.clone() {
                if is_new(line, id) {
                    line.shares.set_share(id, share);
                }
            }
        }
    }

    /// In a row that is the window's, panels beside the scene stay as wide as they are, and the scene has the rest.
    fn fill(&mut self, width: f32) {
        let Some(root) = self.tree.root() else { return };
        let tiles = &self.tree.tiles;
        let Some(Tile::Container(Container::Linear(line))) = tiles.get(root) else {
            return;
        };
        let mut line: Linear = line.clone();
        let (middle, sides): (Vec<_>, Vec<_>) = line.children.iter().partition(|id| has_scene(tiles, **id));
        let ([middle], LinearDir::Horizontal) = (&middle[..], line.dir) else {
            return;
        };
        let sides = sides.into_iter().filter(|id| tiles.is_visible_in_layout(*id));
        let beside: f32 = sides.map(|id| line.shares[id]).sum();
        line.shares.set_share(*middle, (width - beside).max(0.25 * width));
        self.tree.tiles.insert(root, Tile::Container(line.into()));
    }
}

fn has_scene(tiles: &Tiles<Panel>, id: TileId) -> bool {
    match tiles.get(id) {
        Some(Tile::Pane(panel)) => *panel == Panel::Scene,
        Some(Tile::Container(all)) => all.children().any(|id| has_scene(tiles, *id)),
        None => false,
    }
}

impl Modeler {
    /// The scene, and the panels round it.
    pub(super) fn docks(&mut self, ui: &mut Ui) {
        let mut docks = std::mem::replace(&mut self.docks, Docks::new(None));
        if let Some(how) = self.bench.rearranges.take() {
            docks.rearrange(how);
        }
        let open = Panel::ALL.into_iter().filter(|panel| self.bench.is_open(*panel));
        docks.open_and_close(open.collect());
        docks.give_room();
        docks.fill(ui.available_width());
        let bars = docks
            .tree
            .tiles
            .iter()
            .filter(|(_, tile)| has_bar(&docks.tree.tiles, tile));
        let bars = bars.map(|(id, _)| id.0).collect();
        let fronts = docks.tree.tiles.tiles().filter_map(|tile| match tile {
            Tile::Container(Container::Tabs(tabs)) => tabs.active.map(|id| id.0),
            _ => None,
        });
        let mut shown = Shown {
            modeler: self,
            bars,
            fronts: fronts.collect(),
            titles: titles(ui, &docks.tree),
        };
        docks.tree.ui(&mut shown, ui);
        // While something is dragged it is nowhere to be kept.
        if !ui.input(|i| i.pointer.any_down()) {
            self.layout = docks.layout();
        }
        self.docks = docks;
    }
}

/// Whether tabs are to be seen: not for one panel alone.
fn has_bar(tiles: &Tiles<Panel>, tile: &Tile<Panel>) -> bool {
    match tile {
        Tile::Container(Container::Tabs(tabs)) => {
            let open = tabs.children.iter().filter(|id| tiles.is_visible_in_layout(**id));
            open.count() > 1
        }
        _ => false,
    }
}

/// The window as tiles show it.
struct Shown<'a> {
    modeler: &'a mut Modeler,
    /// Of tabs.
    bars: BTreeSet<u64>,
    /// Those before all others.
    fronts: BTreeSet<u64>,
    /// Titles that are shortened.
    titles: Titles,
}

impl Shown<'_> {
    fn panel(&mut self, ui: &mut Ui, panel: Panel) {
        let bench = &mut self.modeler.bench;
        let scroll = || egui::ScrollArea::vertical().auto_shrink(false);
        match panel {
            Panel::Scene => match bench.sheet {
                Some(_) => self.modeler.views(ui),
                None => panels::start(ui, bench),
            },
            Panel::Tools => panels::tools(ui, bench),
            Panel::Objects => panels::document(ui, bench),
            Panel::Simulation => drop(scroll().show(ui, |ui| panels::simulation(ui, bench))),
            Panel::Performance => drop(scroll().show(ui, |ui| panels::performance(ui, bench))),
            Panel::Log => panels::log(ui, bench),
        }
    }
}

/// The rim by which a panel is taken, which has what can be done to it under the right button.
fn rim(ui: &Ui, whole: Rect, panel: Panel, close: &mut bool) -> UiResponse {
    let rect = Rect::from_min_size(whole.min, vec2(whole.width(), RIM));
    let rim = ui.interact(rect, ui.scope_id().with("rim"), Sense::click_and_drag());
    rim.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Move {}", panel.name())));
    let color = match rim.hovered() {
        true => ui.visuals().strong_text_color(),
        false => ui.visuals().weak_text_color().gamma_multiply(0.5),
    };
    for n in [-1.0, 0.0, 1.0] {
        let at = rect.center() + vec2(6.0 * n, 0.0);
        ui.painter().circle_filled(at, 1.2, color);
    }
    rim.context_menu(|ui| {
        if ui.button("Close").clicked() {
            *close = true;
        }
    });
    let rim = rim.on_hover_cursor(CursorIcon::Grab);
    let rim = rim.on_hover_text(format!(
        "Drag to move {}; the right button closes it",
        panel.name()
    ));
    match rim.drag_started() {
        true => UiResponse::DragStarted,
        false => UiResponse::None,
    }
}

impl Behavior<Panel> for Shown<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _: TileId, panel: &mut Panel) -> UiResponse {
        let whole = ui.max_rect();
        if *panel == Panel::Scene {
            self.panel(ui, *panel);
            return UiResponse::None;
        }
        Frame::side_top_panel(ui.style()).show(ui, |ui| {
            ui.set_min_size(ui.available_size());
            ui.set_clip_rect(whole.intersect(ui.clip_rect()));
            if ![Panel::Tools, Panel::Objects].contains(panel) {
                ui.add_space(6.0);
            }
            self.panel(ui, *panel);
        });
        let mut close = false;
        let taken = rim(ui, whole, *panel, &mut close);
        if close {
            self.modeler.bench.close_panel(*panel);
        }
        taken
    }

    fn tab_title_for_pane(&mut self, panel: &Panel) -> WidgetText {
        panel.name().into()
    }

    fn tab_title_for_tile(&mut self, tiles: &Tiles<Panel>, id: TileId) -> WidgetText {
        match (self.titles.get(&id.0), tiles.get(id)) {
            (Some(title), _) => title.as_str().into(),
            (None, Some(Tile::Pane(panel))) => self.tab_title_for_pane(panel),
            (None, Some(Tile::Container(container))) => format!("{:?}", container.kind()).into(),
            (None, None) => WidgetText::default(),
        }
    }

    fn on_tab_button(&mut self, tiles: &mut Tiles<Panel>, id: TileId, button: Response) -> Response {
        let Some(panel) = tiles.get_pane(&id).filter(|_| self.titles.contains_key(&id.0)) else {
            return button;
        };
        let is_front = self.fronts.contains(&id.0);
        button.widget_info(|| WidgetInfo::selected(Role::Button, true, is_front, panel.name()));
        button.on_hover_text(panel.name())
    }

    fn tab_title_spacing(&self, _: &Visuals) -> f32 {
        ASIDE
    }

    fn is_tab_closable(&self, tiles: &Tiles<Panel>, id: TileId) -> bool {
        // The one in front alone has a cross: there is no room for more.
        let is_panel = tiles.get_pane(&id).is_some_and(|panel| *panel != Panel::Scene);
        is_panel && self.fronts.contains(&id.0)
    }

    fn on_tab_close(&mut self, tiles: &mut Tiles<Panel>, id: TileId) -> bool {
        if let Some(panel) = tiles.get_pane(&id) {
            self.modeler.bench.close_panel(*panel);
        }
        // It keeps its place, for when it is opened again.
        false
    }

    fn is_tab_bar_visible(&self, id: TileId, _: &egui_tiles::Tabs) -> bool {
        self.bars.contains(&id.0)
    }

    fn is_tile_draggable(&self, tiles: &Tiles<Panel>, id: TileId) -> bool {
        tiles.get_pane(&id) != Some(&Panel::Scene)
    }

    fn cycle_tabs_with_keyboard(&self) -> bool {
        // Ctrl-Tab arranges objects.
        false
    }

    fn gap_width(&self, _: &egui::Style) -> f32 {
        0.0
    }

    fn min_size(&self) -> f32 {
        96.0
    }

    fn resize_stroke(&self, style: &egui::Style, state: ResizeState) -> Stroke {
        let widgets = &style.visuals.widgets;
        match state {
            ResizeState::Idle => widgets.noninteractive.bg_stroke,
            ResizeState::Hovering => widgets.hovered.fg_stroke,
            ResizeState::Dragging => widgets.active.fg_stroke,
        }
    }

    fn tab_bar_color(&self, visuals: &Visuals) -> Color32 {
        visuals.extreme_bg_color
    }
}
