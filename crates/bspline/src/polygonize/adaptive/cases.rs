//! What the signs at the corners of a cell say of the surface in it.

use std::sync::LazyLock;

use crate::polygonize::table::{edge_between, face_segments, loops};

/// Crossed edges of a case, bit `4a + r` as in the table of marching cubes, and how they hang together.
#[derive(Clone, Copy, Default)]
pub(super) struct Case {
    pub edges: u16,
    pub loops: u8,
    /// Faces with two inside corners across the diagonal, bit `2·axis + side`.
    pub ambiguous: u8,
}

static CASES: LazyLock<[Case; 256]> = LazyLock::new(|| {
    std::array::from_fn(|case| {
        let edges = (0..8usize).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit)));
        let crossed = edges.filter(|&(a, b)| a != b && (case >> a ^ case >> b) & 1 == 1);
        Case {
            edges: crossed.fold(0, |m, (a, b)| m | 1 << edge_between(a, b)),
            loops: loops(case).len() as u8,
            ambiguous: (0..6).fold(0, |m, f| m | u8::from(face_segments(case, f).len() > 1) << f),
        }
    })
});

/// The case of that number.
#[inline(always)]
pub(super) fn case(number: usize) -> Case {
    CASES[number]
}

/// Whether a cell may hold more than one simple sheet.
#[inline(always)]
pub(super) fn is_complex(number: usize) -> bool {
    let case = CASES[number];
    case.loops > 1 || case.ambiguous != 0
}
