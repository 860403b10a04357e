//! XYZ in: a point a line, columns apart by blanks, commas or semicolons.

use glam::DVec3;

use super::columns::{Apart, Columns, cut, names};
use crate::error::excerpt;
use crate::limits::{Budget, Counted};
use crate::points::cloud::PointCloud;
use crate::points::normals;
use crate::raw::RawShape;
use crate::text::{Lines, integer, number};
use crate::{Fault, ReadLimits};

/// How far the length of a stored normal may be from 1 to be taken for a normal and not, say, a colour.
/// Three printed decimals leave an error below 0.001; 0.05 also takes two.
const UNIT_LENGTH_SLACK: f64 = 0.05;

/// Reads the text of an XYZ file: three columns, or six and more with the normal in columns 4 to 6.
///
/// Empty lines and those that start with `#` or `//` are skipped; so is a first line that holds one whole number
/// (the count). Where the first line, or a comment before it, names all columns, x, y and z among them, position and normal are where these names are
/// (`nx`, `normal_x`, `i` and so on). Elsewhere columns 4 to 6 are normals if all have length 1 or 0, or, in a file of
/// just six columns, if any of their numbers is negative; otherwise (colours, say) they are skipped, with a note.
/// Commas are decimal where blanks, tabs or semicolons stand between the columns: `1,5;2,5;3`.
///
/// # Errors
/// A [`Fault`] with the line for a word that is no number or a line with another number of columns.
pub fn parse_xyz(bytes: &[u8], limits: &ReadLimits) -> Result<PointCloud, Fault> {
    let mut budget = Budget::new(limits);
    normals::finish(parse(bytes, &mut budget)?, &mut budget)
}

pub(in crate::points) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    Ok(parse_columns(bytes, budget)?.0)
}

/// What a file holds, and in which columns.
pub(in crate::points) fn parse_columns(
    bytes: &[u8],
    budget: &mut Budget,
) -> Result<(RawShape, Columns), Fault> {
    let mut notes = Vec::new();
    let mut positions = Counted::new("points");
    let mut normals = Counted::new("normals");
    let mut columns = 0;
    let mut promised = None;
    let mut names: Vec<String> = Vec::new();
    let mut by_name = None;
    let mut comma = None;
    // Line of the first triple that is no unit vector.
    let mut not_unit = None;
    let mut has_negative = false;
    let mut is_first = true;
    let mut lines = Lines::new(bytes);
    while let Some(text) = lines.next() {
        let text = text.trim_ascii();
        let line = lines.line;
        match Line::of(text, &mut is_first) {
            Line::Point => {}
            Line::Nothing => {
                // A comment may name the columns.
                let told = names_in(text);
                if columns == 0 && Columns::named(&told).is_some() {
                    names = told;
                }
                continue;
            }
            Line::Count(n) => {
                promised = Some(n);
                continue;
            }
            Line::Names => {
                names = names_in(text);
                if Columns::named(&names).is_none() {
                    notes.push(format!(
                        "line {line}: column names {} were skipped",
                        excerpt(text)
                    ));
                }
                continue;
            }
        }
        let apart = Apart::of(text);
        if apart.has_decimal_commas() {
            comma = comma.or(Some(line));
        }
        if columns == 0 {
            columns = apart.words(text).count();
            if names.len() != columns {
                names.retain(|name| !name.is_empty());
            }
            by_name = Columns::named(&names).filter(|_| names.len() == columns);
        }
        let mut row = [0.0; 6];
        let mut found = 0;
        for word in apart.words(text) {
            let slot = match &by_name {
                Some(columns) => columns.slot(found),
                None => Some(found).filter(|n| *n < 6),
            };
            if let Some(slot) = slot {
                row[slot] = number(&apart.pointed(word), line)?;
            }
            found += 1;
        }
        if found != columns || matches!(found, 0..3) {
            return Err(Fault::line(
                line,
                format!("{found} columns, {} expected", columns.max(3)),
                "every line holds x y z, or x y z nx ny nz",
            ));
        }
        positions.push(DVec3::new(row[0], row[1], row[2]), budget)?;
        let may_be_normal = match &by_name {
            Some(columns) => columns.normal.is_some(),
            None => columns == 6 || columns > 6 && not_unit.is_none(),
        };
        if may_be_normal {
            let n = DVec3::new(row[3], row[4], row[5]);
            let length = n.length();
            if length > 0.0 && length.is_finite() && (length - 1.0).abs() > UNIT_LENGTH_SLACK {
                not_unit = not_unit.or(Some(line));
            }
            has_negative |= n.min_element() < 0.0;
            normals.push(n, budget)?;
        }
    }
    let found = positions.items.len();
    if found == 0 {
        return Err(Fault::Value {
            what: "the number of points",
            value: "0".into(),
            remedy: "a file of points holds a line x y z for each",
        });
    }
    if let Some(n) = promised.filter(|n| *n != found as i64) {
        notes.push(format!(
            "the first line promises {n} points, {found} are there; all were read"
        ));
    }
    // Colours are never negative, but a lidar intensity may be: it stands in files of seven columns.
    let looks_stored = columns >= 6 && (not_unit.is_none() || columns == 6 && has_negative);
    let taken = by_name.unwrap_or(Columns {
        position: [0, 1, 2],
        normal: looks_stored.then_some([3, 4, 5]),
    });
    let stored = taken.normal.is_some();
    if let Some(line) = comma {
        notes.push(format!(
            "line {line}: commas within numbers were read as decimal points"
        ));
    }
    match (columns, not_unit) {
        _ if by_name.is_some() => {}
        (4 | 5, _) => notes.push(format!("{columns} columns: those after the third were skipped")),
        (6.., Some(line)) if !stored => notes.push(format!(
            "columns 4 to 6 are no unit normals (line {line}); skipped as colours or the like"
        )),
        _ => {}
    }
    let name = |i: usize| match names.get(i) {
        Some(name) if names.len() == columns && !name.is_empty() => name.clone(),
        _ => format!("column {}", i + 1),
    };
    let left_out = (0..columns).filter(|column| taken.slot(*column).is_none());
    let shape = RawShape {
        left_out_attributes: left_out.map(name).collect(),
        positions: positions.items,
        normals: stored.then_some(normals.items),
        notes,
        ..Default::default()
    };
    Ok((shape, taken))
}

/// The names in a line of them, or in a comment.
fn names_in(text: &[u8]) -> Vec<String> {
    let marks = text.iter().take_while(|c| matches!(c, b'#' | b'/')).count();
    names(&text[marks..])
}

/// What a line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::points) enum Line {
    /// Empty, or a comment.
    Nothing,
    /// The first one, with the number of points.
    Count(i64),
    /// The first one, with the names of the columns.
    Names,
    Point,
}

impl Line {
    /// What the text of a line is, without blanks about it; `is_first` until one was no comment.
    pub fn of(text: &[u8], is_first: &mut bool) -> Self {
        if text.is_empty() || text.starts_with(b"#") || text.starts_with(b"//") {
            return Self::Nothing;
        }
        match (std::mem::take(is_first), integer(text)) {
            (true, Some(n)) => Self::Count(n),
            (true, None) if is_column_names(text) => Self::Names,
            _ => Self::Point,
        }
    }
}

/// Whether a line holds words only, as `X,Y,Z` does.
fn is_column_names(text: &[u8]) -> bool {
    let is_plain = text
        .iter()
        .all(|c| c.is_ascii_graphic() || matches!(c, b' ' | b'\t'));
    let mut words = cut(text, true).filter(|w| !w.is_empty());
    let is_name =
        |w: &[u8]| w.iter().any(u8::is_ascii_alphabetic) && fast_float2::parse::<f64, _>(w).is_err();
    is_plain && words.clone().count() >= 3 && words.all(is_name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PointCloud, Fault> {
        parse_xyz(text.as_bytes(), &ReadLimits::default())
    }

    #[test]
    fn blanks_commas_comments_count_and_names_are_all_read() {
        for text in [
            "1 2 3\n4 5 6\n",
            "\u{feff}1,2,3\r\n4, 5, 6\r\n",
            "# made by hand\n2\n1\t2\t3\n// between\n\n4 5 6",
            "X;Y;Z\n1;2;3\n4;5;6\n",
            "1 2 3 255 0 7\n4 5 6 1 1 1\n",
            "1 2 3 .5\n4 5 6 .5\n",
        ] {
            let c = read(text).unwrap();
            assert_eq!(
                c.positions,
                [DVec3::new(1., 2., 3.), DVec3::new(4., 5., 6.)],
                "{text:?}"
            );
            assert_eq!(c.normals, None, "{text:?}");
        }
    }

    #[test]
    fn six_columns_of_unit_length_are_normals_and_others_are_not() {
        let c = read("1 2 3 0 0 1\n4 5 6 0 0.6 0.8\n").unwrap();
        assert_eq!(c.normals.unwrap()[1], DVec3::new(0., 0.6, 0.8).normalize());
        let c = read("1 2 3 0 0 1\n4 5 6 12 0 0\n").unwrap();
        assert!(
            c.normals.is_none() && c.notes[0].contains("line 2"),
            "{:?}",
            c.notes
        );
        let c = read("1 2 3 0 0 -2\n4 5 6 12 0 0\n").unwrap();
        assert_eq!(
            c.normals.unwrap(),
            [DVec3::NEG_Z, DVec3::X],
            "of any length, as some programs write them"
        );
        let c = read("1 2 3 -812 90 7 9\n4 5 6 1 0 0 9\n").unwrap();
        assert!(
            c.normals.is_none() && c.notes[0].contains("line 1"),
            "{:?}",
            c.notes
        );
        let c = read("1 2 3 0 0 0\n4 5 6 0 0 0\n").unwrap();
        assert_eq!((c.zero_normals, c.normals.unwrap().len()), (2, 2));
    }

    #[test]
    fn columns_that_are_not_taken_are_named() {
        for (text, expected) in [
            ("1 2 3\n", &[][..]),
            ("1 2 3 0 0 1\n", &[]),
            ("1 2 3 0.5\n", &["column 4"]),
            ("x,y,z,nx,ny,nz,intensity\n1,2,3,0,0,1,9\n", &["intensity"]),
            ("x y z r g b\n1 2 3 9 8 7\n", &["r", "g", "b"]),
            ("x y z\n1 2 3 9\n", &["column 4"]),
        ] {
            assert_eq!(read(text).unwrap().left_out_attributes, expected, "{text}");
        }
    }

    #[test]
    fn columns_are_taken_by_their_names() {
        let at = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)];
        for (text, left_out) in [
            ("id,x,y,z\n7,1,2,3\n8,4,5,6\n", &["id"][..]),
            ("Y X Z\n2 1 3\n5 4 6\n", &[]),
            ("# GpsTime X Y Z\n2\n0.1 1 2 3\n0.2 4 5 6\n", &["GpsTime"]),
            ("x y z r g b\n1 2 3 1 0 0\n4 5 6 0 1 0\n", &["r", "g", "b"]),
            ("\"z\",\"y\",\"x\"\n3,2,1\n6,5,4\n", &[]),
            (
                "\"\",\"x\",\"y\",\"z\"\n\"1\",1,2,3\n\"2\",4,5,6\n",
                &["column 1"],
            ),
            (",x,y,z\n0,1,2,3\n1,4,5,6\n", &["column 1"]),
            ("z,y,x,\n3,2,1,\n6,5,4,\n", &[]),
            ("point id;x [m];y [m];z [m]\n7;1;2;3\n8;4;5;6\n", &["point id"]),
            ("z [m] x [m] y [m]\n3 1 2\n6 4 5\n", &[]),
            ("# z, x y\n3 1 2\n6 4 5\n", &[]),
            ("Northing,Easting,Elevation\n2,1,3\n5,4,6\n", &[]),
            ("\"1\",\"2\",\"3\"\n\"4\",\"5\",\"6\"\n", &[]),
        ] {
            let c = read(text).unwrap();
            assert_eq!((&c.positions[..], c.normals), (&at[..], None), "{text}");
            assert_eq!(c.left_out_attributes, left_out, "{text}");
            assert!(c.notes.is_empty(), "{text}: {:?}", c.notes);
        }
        for text in [
            "id;Nx;Ny;Nz;Z;Y;X\n0;0;0;-1;3;2;1\n1;0;0;-1;6;5;4\n",
            "//X Y Z R Nx Ny Nz\n2\n1 2 3 9 0 0 -1\n4 5 6 9 0 0 -1\n",
        ] {
            let c = read(text).unwrap();
            assert_eq!(c.positions, at, "{text}");
            assert_eq!(c.normals.unwrap(), [DVec3::NEG_Z; 2], "{text}");
        }
        // Names that do not tell, or not of all columns.
        for text in [
            "East North Up\n1 2 3\n4 5 6\n",
            "z y x w\n1 2 3\n4 5 6\n",
            "# x y y z\n1 2 3 4\n4 5 6 7\n",
        ] {
            assert_eq!(read(text).unwrap().positions, at, "{text}");
        }
    }

    #[test]
    fn commas_are_decimal_where_something_else_is_between_the_columns() {
        let at = [DVec3::new(1.5, -2.25, 3.0), DVec3::new(4.0, 5.0, 6.5)];
        for text in [
            "X;Y;Z\n1,5;-2,25;3\n4;5;6,5\n",
            "1,5\t-2,25\t3\n4\t5\t6,5\n",
            "1,5 -2,25 3,0\n4 5 6,5\n",
            "1,5; -2,25; 3,0; 7,5\n4; 5; 6,5; 0\n",
        ] {
            let c = read(text).unwrap();
            assert_eq!(c.positions, at, "{text}");
            assert!(
                c.notes.iter().any(|n| n.contains("decimal points")),
                "{:?}",
                c.notes
            );
        }
        for (text, columns) in [
            ("1, 2, 3\n", 3),
            ("1,2,3 4,5,6\n", 6),
            ("1,\t2,\t3\n", 3),
            ("0.5,1.5 2.5,3.5 1,2\n", 6),
            ("1,2,3,4,5,6\n", 6),
        ] {
            let c = read(text).unwrap();
            assert_eq!(3 + c.left_out_attributes.len(), columns, "{text}: {:?}", c.notes);
        }
        let error = read("1.234,5;0,5;2,25\n").unwrap_err().to_string();
        assert!(error.contains("not a number"), "{error}");
    }

    #[test]
    fn faults_name_the_line() {
        for (text, part) in [
            ("1 2 3\n4 5\n", "line 2: 2 columns, 3 expected"),
            ("1 2\n", "line 1: 2 columns"),
            ("1 2 3\n1 2 x\n", "line 2: \"x\" is not a number"),
            ("# nothing\n", "number of points is 0"),
            ("5\n", "number of points is 0"),
            ("nan nan nan\n", "0 of 1"),
        ] {
            let e = read(text).unwrap_err().to_string();
            assert!(e.contains(part), "{text:?}: {e}");
        }
    }

    #[test]
    fn a_wrong_count_is_noted_and_nan_points_are_counted() {
        let c = read("7\n1 2 3\nnan 0 0\n").unwrap();
        assert_eq!((c.positions.len(), c.invalid_dropped), (1, 1));
        assert!(c.notes[0].contains("promises 7"));
    }

    #[test]
    fn text_that_would_outgrow_the_ceiling_is_refused() {
        let text = "1 2 3\n".repeat(10_000);
        let e = parse_xyz(text.as_bytes(), &ReadLimits { max_bytes: 100_000 }).unwrap_err();
        assert!(matches!(e, Fault::Limit { limit: 100_000, .. }));
    }
}
