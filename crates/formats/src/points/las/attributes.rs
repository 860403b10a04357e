//! What a LAS point holds beside its place, by name.

use super::header::Header;

/// Name, first byte and number of bytes of what the point formats hold [ASPRS, LAS Specification 1.4-R15, tables 7 to 17].
type Part = (&'static str, usize, usize);

const OLD: [Part; 5] = [
    ("intensity", 12, 2),
    ("classification", 15, 1),
    ("scan_angle", 16, 1),
    ("user_data", 17, 1),
    ("point_source_id", 18, 2),
];
const NEW: [Part; 6] = [
    ("intensity", 12, 2),
    ("classification", 16, 1),
    ("user_data", 17, 1),
    ("scan_angle", 18, 2),
    ("point_source_id", 20, 2),
    ("gps_time", 22, 8),
];

/// What the points of a format hold beyond the least.
fn further(format: u8) -> &'static [Part] {
    match format {
        1 => &[("gps_time", 20, 8)],
        2 => &[("color", 20, 6)],
        3 => &[("gps_time", 20, 8), ("color", 28, 6)],
        4 => &[("gps_time", 20, 8), ("wave_packet", 28, 29)],
        5 => &[("gps_time", 20, 8), ("color", 28, 6), ("wave_packet", 34, 29)],
        7 => &[("color", 30, 6)],
        8 => &[("color", 30, 6), ("near_infrared", 36, 2)],
        9 => &[("wave_packet", 30, 29)],
        10 => &[
            ("color", 30, 6),
            ("near_infrared", 36, 2),
            ("wave_packet", 38, 29),
        ],
        _ => &[],
    }
}

/// The bits that any of the points of a file has set.
pub(super) struct Attributes(Vec<u8>);

impl Attributes {
    pub fn new(header: &Header) -> Self {
        Self(vec![0; header.record_bytes])
    }

    pub fn add(&mut self, point: &[u8]) {
        for (all, byte) in self.0.iter_mut().zip(point) {
            *all |= byte;
        }
    }

    /// Names of what is not zero in all points. Every writer fills what it has nothing for with zeros.
    pub fn names(&self, header: &Header) -> Vec<String> {
        let is_set = |at: usize, size: usize| self.0.iter().skip(at).take(size).any(|b| *b != 0);
        let is_old = header.format < 6;
        let mut names = Vec::new();
        // One return of one is what a point has that was not scanned so.
        let single = if is_old { 0b001_001 } else { 0x11 };
        if self.0.get(14).is_some_and(|b| b & !single != 0) {
            names.push("returns".to_owned());
        }
        let parts: &[Part] = if is_old { &OLD } else { &NEW };
        let set = parts.iter().chain(further(header.format));
        names.extend(set.filter(|p| is_set(p.1, p.2)).map(|p| p.0.to_owned()));
        let extra = header.extra_bytes();
        let extra = extra.into_iter().filter(|e| is_set(e.at, e.size));
        names.extend(extra.map(|e| e.name));
        names
    }
}
