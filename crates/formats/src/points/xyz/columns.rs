//! What the columns of a file are, and how its lines are cut into them.

use std::borrow::Cow;

/// How the words of a line stand apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Apart {
    /// Whether commas are part of the numbers, as in `1,5;2,5;3`.
    has_decimal_commas: bool,
}

impl Apart {
    /// Commas are decimal where the line falls into three words and more without them, and each word has one within at most. Between blanks alone
    /// no word with one may have a point too: `0.5,1.5 2.5,3.5` are four numbers.
    pub fn of(text: &[u8]) -> Self {
        let has_decimal_commas = memchr::memchr(b',', text).is_some() && {
            let between_blanks = memchr::memchr2(b';', b'\t', text).is_none();
            let is_number = |word: &[u8]| match memchr::memchr(b',', word) {
                None => true,
                Some(at) => {
                    let (whole, rest) = (&word[..at], &word[at + 1..]);
                    let is_point = between_blanks && word.contains(&b'.');
                    !whole.is_empty() && !rest.is_empty() && !rest.contains(&b',') && !is_point
                }
            };
            let all = || cut(text, false);
            all().count() >= 3 && all().all(is_number)
        };
        Self { has_decimal_commas }
    }

    pub fn has_decimal_commas(self) -> bool {
        self.has_decimal_commas
    }

    /// The words of a line.
    pub fn words(self, text: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
        cut(text, !self.has_decimal_commas)
    }

    /// A word as numbers are written elsewhere.
    pub fn pointed(self, word: &[u8]) -> Cow<'_, [u8]> {
        match self.has_decimal_commas && word.contains(&b',') {
            true => word.iter().map(|c| if *c == b',' { b'.' } else { *c }).collect(),
            false => Cow::Borrowed(word),
        }
    }
}

/// The words of a text, without quotation marks about them.
pub fn cut(text: &[u8], at_commas: bool) -> impl Iterator<Item = &[u8]> + Clone {
    text.split(move |c| matches!(c, b' ' | b'\t' | b';') || at_commas && *c == b',')
        .filter(|w| !w.is_empty())
        .map(unquoted)
}

fn unquoted(word: &[u8]) -> &[u8] {
    let inner = word.strip_prefix(b"\"").and_then(|w| w.strip_suffix(b"\""));
    inner.unwrap_or(word)
}

/// The names of columns, empty ones among them where separators tell that there is one; blanks may be part of those between other separators.
pub fn names(text: &[u8]) -> Vec<String> {
    let separated = text.split(|c| matches!(c, b',' | b';' | b'\t'));
    let separated: Vec<String> = separated.map(|w| name(unquoted(w.trim_ascii()))).collect();
    if Columns::named(&separated).is_some() {
        return separated;
    }
    // A unit that stands alone belongs to the word before it.
    cut(text, true)
        .filter(|w| !(w.starts_with(b"[") || w.starts_with(b"(")))
        .map(name)
        .collect()
}

/// A name without the unit behind it, as in `x [m]`.
fn name(word: &[u8]) -> String {
    let word = String::from_utf8_lossy(word);
    let word = word.trim();
    let unit = word.strip_suffix(']').and_then(|w| w.rsplit_once('['));
    let unit = unit.or(word.strip_suffix(')').and_then(|w| w.rsplit_once('(')));
    match unit {
        Some((name, unit)) if !name.is_empty() && unit.chars().all(char::is_alphabetic) => name.trim_end(),
        _ => word,
    }
    .into()
}

/// Where position and normal stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Columns {
    pub position: [usize; 3],
    /// None where nothing says so: those after the position may be a normal.
    pub normal: Option<[usize; 3]>,
}

/// What the axes of a position are called.
const POSITIONS: [[&str; 3]; 5] = [
    ["x", "y", "z"],
    ["easting", "northing", "elevation"],
    ["easting", "northing", "height"],
    ["easting", "northing", "altitude"],
    ["easting", "northing", "z"],
];

/// What the axes of a normal are called.
const NORMALS: [[&str; 3]; 5] = [
    ["nx", "ny", "nz"],
    ["normal_x", "normal_y", "normal_z"],
    ["normalx", "normaly", "normalz"],
    ["normal[0]", "normal[1]", "normal[2]"],
    ["i", "j", "k"],
];

impl Columns {
    /// By the names of all columns; none unless they tell those of a position.
    pub fn named(names: &[String]) -> Option<Self> {
        let of = |axes: [&str; 3]| -> Option<[usize; 3]> {
            let mut found = [0; 3];
            for (axis, found) in axes.iter().zip(&mut found) {
                let mut all = names
                    .iter()
                    .enumerate()
                    .filter(|(_, n)| n.eq_ignore_ascii_case(axis));
                match (all.next(), all.next()) {
                    (Some((n, _)), None) => *found = n,
                    _ => return None,
                }
            }
            Some(found)
        };
        Some(Self {
            position: POSITIONS.into_iter().find_map(of)?,
            normal: NORMALS.into_iter().find_map(of),
        })
    }

    /// Number of a column in a row of position and normal, if it is one of them.
    pub fn slot(&self, column: usize) -> Option<usize> {
        let normal = self.normal.unwrap_or([usize::MAX; 3]);
        self.position.iter().chain(&normal).position(|c| *c == column)
    }
}
