//! Where the panels are, as it is written in a directory: rows, columns and tabs, however the window draws them.

use std::collections::BTreeSet;

use egui_tiles::{Container, Linear, LinearDir, Tabs, Tile, TileId, Tiles, Tree};
use serde::{Deserialize, Serialize};

/// What has a place in the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Panel {
    /// What is worked on; always there.
    Scene,
    /// The palette, and how the tool in hand is set.
    Tools,
    /// The objects, what they are made of, and the history.
    Objects,
    /// Scenes to be played.
    Simulation,
    /// What the work costs.
    Performance,
    /// What was told.
    Log,
}

impl Panel {
    /// All.
    pub const ALL: [Self; 6] = [
        Self::Scene,
        Self::Tools,
        Self::Objects,
        Self::Simulation,
        Self::Performance,
        Self::Log,
    ];

    /// On its tab.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "Scene",
            Self::Tools => "Tools",
            Self::Objects => "Objects",
            Self::Simulation => "Simulation",
            Self::Performance => "Performance",
            Self::Log => "Log",
        }
    }
}

/// A part of the window; numbers are shares of the room, in points as the window was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// One panel.
    Panel(Panel),
    /// One beside the other.
    Row(Vec<(Self, f32)>),
    /// One below the other.
    Column(Vec<(Self, f32)>),
    /// One before the other; the number is that of the one in front.
    Tabs(Vec<Self>, usize),
}

/// Share of what holds the scene in a row: it has what the others leave.
const REST: f32 = 875.0;

impl Default for Layout {
    /// Tools on the left, objects on the right; what is opened comes before the objects, or below the scene.
    fn default() -> Self {
        let panel = |panel| Self::Panel(panel);
        let middle = Self::Column(vec![(panel(Panel::Scene), 580.0), (panel(Panel::Log), 160.0)]);
        let right = [Panel::Objects, Panel::Simulation, Panel::Performance].map(panel);
        let right = Self::Tabs(right.to_vec(), 0);
        Self::Row(vec![(panel(Panel::Tools), 195.0), (middle, REST), (right, 210.0)])
    }
}

impl Layout {
    /// Whether every panel has one place, and nothing else has.
    pub fn is_whole(&self) -> bool {
        let mut seen = BTreeSet::new();
        let is_once = self.count(&mut seen);
        is_once && seen.len() == Panel::ALL.len()
    }

    /// Whether the scene is in it.
    fn has_scene(&self) -> bool {
        match self {
            Self::Panel(panel) => *panel == Panel::Scene,
            Self::Row(parts) | Self::Column(parts) => parts.iter().any(|(part, _)| part.has_scene()),
            Self::Tabs(parts, _) => parts.iter().any(Self::has_scene),
        }
    }

    fn count(&self, seen: &mut BTreeSet<Panel>) -> bool {
        let is_share = |share: f32| share.is_finite() && share >= 0.0;
        match self {
            Self::Panel(panel) => seen.insert(*panel),
            Self::Row(parts) | Self::Column(parts) => parts
                .iter()
                .all(|(part, share)| is_share(*share) && part.count(seen)),
            Self::Tabs(parts, _) => parts.iter().all(|part| part.count(seen)),
        }
    }

    /// As the window draws it.
    pub fn tree(&self) -> Tree<Panel> {
        let mut tiles = Tiles::default();
        let root = self.put(&mut tiles);
        Tree::new(egui::Id::unique("panels"), root, tiles)
    }

    fn put(&self, tiles: &mut Tiles<Panel>) -> TileId {
        let line = |dir: LinearDir, parts: &[(Self, f32)], tiles: &mut Tiles<Panel>| {
            let ids: Vec<TileId> = parts.iter().map(|(part, _)| part.put(tiles)).collect();
            let mut line = Linear::new(dir, ids.clone());
            for (id, (_, share)) in ids.into_iter().zip(parts) {
                line.shares.set_share(id, *share);
            }
            tiles.insert_container(line)
        };
        match self {
            Self::Panel(panel) => tiles.insert_pane(*panel),
            Self::Row(parts) => line(LinearDir::Horizontal, parts, tiles),
            Self::Column(parts) => line(LinearDir::Vertical, parts, tiles),
            Self::Tabs(parts, front) => {
                let ids: Vec<TileId> = parts.iter().map(|part| part.put(tiles)).collect();
                let front = ids.get(*front).or(ids.first()).copied();
                let mut tabs = Tabs::new(ids);
                tabs.active = front;
                tiles.insert_container(tabs)
            }
        }
    }

    /// Of what the window draws; as at first if that holds nothing.
    pub fn of(tree: &Tree<Panel>) -> Self {
        let found = tree.root().and_then(|root| Self::found(&tree.tiles, root));
        let mut layout = found.filter(Self::is_whole).unwrap_or_default();
        if let Self::Row(parts) = &mut layout
            && let Some((_, share)) = parts.iter_mut().find(|(part, _)| part.has_scene())
        {
            *share = REST;
        }
        layout
    }

    fn found(tiles: &Tiles<Panel>, id: TileId) -> Option<Self> {
        let all =
            |ids: &[TileId]| -> Vec<Self> { ids.iter().filter_map(|id| Self::found(tiles, *id)).collect() };
        Some(match tiles.get(id)? {
            Tile::Pane(panel) => Self::Panel(*panel),
            Tile::Container(Container::Tabs(tabs)) => {
                let front = tabs.children.iter().position(|id| Some(*id) == tabs.active);
                Self::Tabs(all(&tabs.children), front.unwrap_or(0))
            }
            Tile::Container(Container::Linear(line)) => {
                let shares = line.children.iter().map(|id| line.shares[*id].round());
                let parts = all(&line.children).into_iter().zip(shares).collect();
                match line.dir {
                    LinearDir::Horizontal => Self::Row(parts),
                    LinearDir::Vertical => Self::Column(parts),
                }
            }
            // Nobody makes one.
            Tile::Container(Container::Grid(grid)) => {
                let children: Vec<TileId> = grid.children().copied().collect();
                Self::Tabs(all(&children), 0)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_come_back_as_they_were_written() {
        let first = Layout::default();
        assert!(first.is_whole());
        assert_eq!(Layout::of(&first.tree()), first);
        let text = serde_json::to_string(&first).unwrap();
        assert_eq!(serde_json::from_str::<Layout>(&text).unwrap(), first);
    }

    #[test]
    fn layouts_without_a_panel_or_with_one_twice_are_none() {
        let scene = Layout::Panel(Panel::Scene);
        assert!(!scene.is_whole());
        let twice = Layout::Row(vec![(Layout::default(), 1.0), (scene, 1.0)]);
        assert!(!twice.is_whole());
        let wide = Layout::Column(vec![(Layout::default(), f32::NAN)]);
        assert!(!wide.is_whole());
        assert_eq!(Layout::of(&twice.tree()), Layout::default());
    }
}
