//! What the chunks of a field file hold, by their names.

use super::chunk::Kind;

pub(super) const HEADER: Kind = *b"HEAD";
pub(super) const LEVEL: Kind = *b"CORR";
pub(super) const LEAVES: Kind = *b"LEAF";
pub(super) const SIGNS: Kind = *b"SIGN";
pub(super) const REPORT: Kind = *b"REPT";
pub(super) const NOTES: Kind = *b"NOTE";
pub(super) const PROVENANCE: Kind = *b"PROV";
pub(super) const END: Kind = *b"DONE";
pub(super) const KNOTS_HEADER: Kind = *b"SPLN";
pub(super) const KNOTS: Kind = *b"KNOT";
pub(super) const COEFFICIENTS: Kind = *b"COEF";
pub(super) const PAGES: Kind = *b"PAGE";
