//! Titles of tabs, shortened where there is no room for all of them: a tab beyond the edge would be found by nobody.

use std::collections::BTreeMap;

use egui::{TextStyle, TextWrapMode, Ui, WidgetText};
use egui_tiles::{Container, Tile, TileId, Tree};

use super::Panel;

/// To the left and right of a title.
pub const ASIDE: f32 = 5.0;
/// A cross, and the room before it, as the tiles have them.
const CROSS: f32 = 16.0;
/// Letters that stay in any case.
const LEAST: usize = 2;

/// What tabs show, by the numbers of their tiles, where that is not the whole name.
pub type Titles = BTreeMap<u64, String>;

/// Titles of all tabs that have too little room by what the tiles had in the picture before.
pub fn titles(ui: &Ui, tree: &Tree<Panel>) -> Titles {
    let width = |text: &str| {
        let text = WidgetText::from(text);
        let galley = text.into_galley(ui, Some(TextWrapMode::Extend), f32::INFINITY, TextStyle::Button);
        galley.size().x
    };
    let mut titles = Titles::new();
    for (id, tile) in tree.tiles.iter() {
        let (Tile::Container(Container::Tabs(tabs)), Some(rect)) = (tile, tree.tiles.rect(*id)) else {
            continue;
        };
        let open = tabs
            .children
            .iter()
            .filter(|id| tree.tiles.is_visible_in_layout(**id));
        let panes: Vec<(TileId, &str)> = open
            .filter_map(|id| Some((*id, tree.tiles.get_pane(id)?.name())))
            .collect();
        let room = rect.width() - 2.0 * ASIDE * panes.len() as f32 - CROSS - 1.0;
        let names: Vec<&str> = panes.iter().map(|(_, name)| *name).collect();
        let shown = shortened(&names, room, width);
        let cut = panes
            .into_iter()
            .zip(shown)
            .filter(|((_, name), shown)| name != shown);
        titles.extend(cut.map(|((id, _), shown)| (id.0, shown)));
    }
    titles
}

/// Names that have so much room together: the longest are cut, to one width.
fn shortened(names: &[&str], room: f32, width: impl Fn(&str) -> f32) -> Vec<String> {
    let mut widths: Vec<f32> = names.iter().map(|name| width(name)).collect();
    widths.sort_by(f32::total_cmp);
    let (mut left, mut most) = (room, f32::INFINITY);
    for (n, one) in widths.iter().enumerate() {
        let each = left / (widths.len() - n) as f32;
        if *one > each {
            most = each;
            break;
        }
        left -= one;
    }
    names.iter().map(|name| cut(name, most, &width)).collect()
}

fn cut(name: &str, most: f32, width: impl Fn(&str) -> f32) -> String {
    if width(name) <= most {
        return name.into();
    }
    let letters: Vec<char> = name.chars().collect();
    let first = |count: usize| letters[..count].iter().chain(&['…']).collect::<String>();
    let fits = (LEAST..letters.len())
        .rev()
        .map(first)
        .find(|text| width(text) <= most);
    fits.unwrap_or_else(|| first(LEAST.min(letters.len())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where all letters are as wide.
    fn shown(names: &[&str], room: f32) -> Vec<String> {
        shortened(names, room, |text| text.chars().count() as f32)
    }

    #[test]
    fn the_longest_names_are_cut_to_one_width() {
        let names = ["Objects", "Simulation", "Performance"];
        assert_eq!(shown(&names, 28.0), names);
        assert_eq!(shown(&names, 27.0), ["Objects", "Simulation", "Performan…"]);
        assert_eq!(shown(&names, 24.0), ["Objects", "Simulat…", "Perform…"]);
        assert_eq!(shown(&names, 15.0), ["Obje…", "Simu…", "Perf…"]);
        // Less says nothing.
        assert_eq!(shown(&names, 3.0), ["Ob…", "Si…", "Pe…"]);
    }
}
