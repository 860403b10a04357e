//! The description of the scans: where it tells what edits change.

use std::ops::Range;

use glam::DVec3;
use roxmltree::{Document, Node};

use crate::Fault;

/// What the description says of one scan, by places in its text.
pub struct Scan {
    /// Where the points stand in the file.
    pub at: u64,
    at_text: Range<usize>,
    count_text: Range<usize>,
    /// Of each attribute its least and greatest value, where it is a decimal and they are told.
    limits: Vec<[Option<(Range<usize>, f64)>; 2]>,
    /// Least and greatest cartesian coordinates, with their names.
    bounds: Vec<(Range<usize>, &'static str, usize, bool)>,
    /// What is left out of a scan with edits, as nothing has to be told: the bounds of its directions.
    spherical: Option<Range<usize>>,
    /// Points are named by number.
    pub has_groups: bool,
}

const BOUNDS: [(&str, usize, bool); 6] = [
    ("xMinimum", 0, false),
    ("xMaximum", 0, true),
    ("yMinimum", 1, false),
    ("yMaximum", 1, true),
    ("zMinimum", 2, false),
    ("zMaximum", 2, true),
];

/// The scans, in their order in the file.
pub fn scans(text: &str) -> Result<Vec<Scan>, Fault> {
    let damaged = |what: String| Fault::Damaged { what };
    let document =
        Document::parse(text).map_err(|e| damaged(format!("the description of the scans: {e}")))?;
    let data = document.descendants().find(|n| n.has_tag_name("data3D"));
    let scans = data.into_iter().flat_map(|data| data.children());
    scans
        .filter(|n| n.has_tag_name("vectorChild") && n.attribute("type") == Some("Structure"))
        .map(|n| Scan::of(&n).ok_or_else(|| damaged("the description of a scan names no points".into())))
        .collect()
}

impl Scan {
    fn of(scan: &Node<'_, '_>) -> Option<Self> {
        let child = |name| scan.children().find(|n| n.has_tag_name(name));
        let points = scan
            .children()
            .find(|n| n.has_tag_name("points") && n.attribute("type") == Some("CompressedVector"))?;
        let attribute = |name| points.attribute_node(name);
        let prototype = points.children().find(|n| n.has_tag_name("prototype"))?;
        let limits = prototype.children().filter(Node::is_element).map(|n| {
            ["minimum", "maximum"].map(|name| {
                let limit = n.attribute_node(name)?;
                let is_decimal = n.attribute("type") == Some("Float");
                Some((limit.range_value(), limit.value().parse().ok()?)).filter(|_| is_decimal)
            })
        });
        let bounds = child("cartesianBounds").into_iter().flat_map(|b| {
            BOUNDS.into_iter().filter_map(move |(name, axis, is_most)| {
                let found = b.children().find(|n| n.has_tag_name(name))?;
                let is_decimal = found.attribute("type") == Some("Float");
                is_decimal.then(|| (found.range(), name, axis, is_most))
            })
        });
        Some(Self {
            at: attribute("fileOffset")?.value().parse().ok()?,
            at_text: attribute("fileOffset")?.range_value(),
            count_text: attribute("recordCount")?.range_value(),
            limits: limits.collect(),
            bounds: bounds.collect(),
            spherical: child("sphericalBounds").map(|n| n.range()),
            has_groups: child("pointGroupingSchemes").is_some(),
        })
    }

    /// What it says of the edited scan: where its points stand now and how many, least and greatest values of each attribute, and
    /// of the coordinates.
    pub fn told(
        &self,
        at: u64,
        count: u64,
        values: &[[f64; 2]],
        [low, high]: [DVec3; 2],
    ) -> Vec<(Range<usize>, String)> {
        let mut told = vec![
            (self.at_text.clone(), at.to_string()),
            (self.count_text.clone(), count.to_string()),
        ];
        for (limits, [least, most]) in self.limits.iter().zip(values) {
            let [low, high] = limits;
            let wider = [
                low.as_ref().filter(|l| *least < l.1).map(|l| (&l.0, least)),
                high.as_ref().filter(|l| *most > l.1).map(|l| (&l.0, most)),
            ];
            told.extend(
                wider
                    .into_iter()
                    .flatten()
                    .map(|(text, v)| (text.clone(), format!("{v:?}"))),
            );
        }
        if low.is_finite() && high.is_finite() {
            told.extend(self.bounds.iter().map(|(text, name, axis, is_most)| {
                let value = if *is_most { high } else { low }[*axis];
                (text.clone(), format!("<{name} type=\"Float\">{value:?}</{name}>"))
            }));
        }
        told.extend(self.spherical.iter().map(|text| (text.clone(), String::new())));
        told
    }
}

/// A text with other words at places that do not overlap.
pub fn with(text: &str, mut words: Vec<(Range<usize>, String)>) -> String {
    words.sort_by_key(|(place, _)| place.start);
    let mut out = String::with_capacity(text.len() + 64);
    let mut at = 0;
    for (place, word) in words {
        out += &text[at..place.start];
        out += &word;
        at = place.end;
    }
    out + &text[at..]
}
