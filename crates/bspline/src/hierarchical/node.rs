use std::fmt;
use std::sync::{Arc, OnceLock};

use super::Lattice;
use super::brick::{BRICK, BrickKey, Corrections, HALO_LEN};
use super::totals::min_max;
use crate::Real;

/// A node of the tree of bricks: the functions of one brick, what evaluation reads of its cells, and a summary of all
/// that lies below it.
///
/// Nodes of levels `0, 1, …` are bricks; those of negative levels lead up to one root. A node never changes: another
/// version of the field has another node in its place and shares what is below.
#[derive(Clone)]
pub(crate) struct Node<T> {
    /// Level, `>= 0` for bricks; a node above level 0 is `-level` halvings above it.
    pub level: i8,
    /// Place among the nodes of its level.
    pub key: BrickKey,
    /// `C_ℓ` = prolonged `C_{ℓ-1}` + corrections, functions `8b-1 ..= 8b+9` on each axis. None above level 0, and where
    /// a brick lies behind the box's last cell and only holds functions that reach into it.
    pub totals: Option<Arc<[T; HALO_LEN]>>,
    /// Active functions of the brick itself.
    pub corrections: Option<Arc<Corrections<T>>>,
    /// Least and largest coefficient that the evaluation of any point of the node reads, here or below.
    pub hull: [T; 2],
    /// Least and largest of the totals, if some of the node's points are evaluated from them.
    own_hull: Option<[T; 2]>,
    /// Active functions here and below.
    pub count: u64,
    /// Bricks with totals here and below.
    pub brick_count: u64,
    /// Levels down to the finest with an active function here or below: 0 if there is none, 1 if that is level 0.
    pub level_count: u8,
    /// Bound of the Hessian over the node's cells, here or below, once somebody has asked.
    pub bend: OnceLock<f64>,
    /// Names the functions here and below, once somebody has asked.
    pub digest: OnceLock<[u8; 32]>,
    /// Octant `4x + 2y + z`.
    pub children: Children<T>,
}

pub(crate) type Children<T> = [Option<Arc<Node<T>>>; 8];

impl<T> fmt::Debug for Node<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "level {} {:?}: {} functions",
            self.level, self.key.0, self.count
        )
    }
}

impl<T: Real> Node<T> {
    /// A node with its summary, gathered from its own totals and its children; `old` is what stood there before.
    pub fn new(
        old: Option<&Self>,
        (level, key): (i8, BrickKey),
        totals: Option<Arc<[T; HALO_LEN]>>,
        corrections: Option<Arc<Corrections<T>>>,
        children: Children<T>,
    ) -> Self {
        let own_count = corrections.as_ref().map_or(0, |c| c.count() as u64);
        let mut node = Self {
            level,
            key,
            hull: [T::infinity(), T::neg_infinity()],
            own_hull: None,
            count: own_count,
            brick_count: u64::from(totals.is_some()),
            level_count: if own_count > 0 { level as u8 + 1 } else { 0 },
            bend: OnceLock::new(),
            digest: OnceLock::new(),
            totals,
            corrections,
            children,
        };
        let mut is_covered = true;
        for child in &node.children {
            is_covered &= child.as_ref().is_some_and(|c| c.holds_cells());
            let Some(child) = child else { continue };
            node.count += child.count;
            node.brick_count += child.brick_count;
            node.level_count = node.level_count.max(child.level_count);
            node.hull = [node.hull[0].min(child.hull[0]), node.hull[1].max(child.hull[1])];
        }
        // A child that is missing leaves its cells to this brick.
        if let Some(totals) = node.totals.as_ref().filter(|_| !is_covered) {
            // Totals that are shared need not be read again: of a node on the way to a change they are far from the cache.
            let is_old = |old: &&Self| old.totals.as_ref().is_some_and(|t| Arc::ptr_eq(t, totals));
            let known = old.filter(is_old).and_then(|old| old.own_hull);
            let own = known.unwrap_or_else(|| min_max(totals.as_slice()));
            node.own_hull = Some(own);
            node.hull = [node.hull[0].min(own[0]), node.hull[1].max(own[1])];
        }
        node
    }

    /// Whether any of the box's cells lie in the node.
    pub fn holds_cells(&self) -> bool {
        self.brick_count > 0
    }

    /// The child with the cells of an octant, if it has its own totals or leads to some.
    #[inline]
    pub fn child(&self, octant: usize) -> Option<&Self> {
        self.children[octant].as_deref().filter(|c| c.holds_cells())
    }

    pub fn has_children(&self) -> bool {
        (0..8).any(|o| self.child(o).is_some())
    }

    /// Width in cells of level 0.
    #[inline]
    pub fn width(&self) -> f64 {
        BRICK as f64 * power_of_two(-self.level)
    }

    /// Cells of the node's level along a cell of level 0; of bricks.
    #[inline]
    pub fn scale(&self) -> f64 {
        power_of_two(self.level)
    }

    /// Totals of a brick.
    #[inline]
    pub fn own_totals(&self) -> &[T; HALO_LEN] {
        self.totals.as_deref().expect("cells of the box have totals")
    }

    /// The node at a place below this one or at its own.
    pub fn find(&self, level: i8, key: BrickKey) -> Option<&Self> {
        let mut node = self;
        while node.level < level {
            let shift = (level - node.level - 1) as usize;
            node = node.children[octant(key.0, shift)].as_deref()?;
        }
        (node.key == key).then_some(node)
    }

    /// Calls `visit` for the node and, where that says so, for all below it.
    pub fn walk<'a>(&'a self, visit: &mut impl FnMut(&'a Self) -> bool) {
        if visit(self) {
            self.children.iter().flatten().for_each(|c| c.walk(visit));
        }
    }
}

/// `2^n` by its bits; `powi` is a call.
#[inline]
fn power_of_two(n: i8) -> f64 {
    const BIAS: i64 = 1023;
    f64::from_bits(((BIAS + i64::from(n)) as u64) << (f64::MANTISSA_DIGITS - 1))
}

/// The octant of `shift` halvings above a place in which it lies.
#[inline]
pub(super) fn octant(at: [u32; 3], shift: usize) -> usize {
    let o = at.map(|c| (c >> shift & 1) as usize);
    4 * o[0] + 2 * o[1] + o[2]
}

/// Halvings from the root to level 0: the root spans all functions of the lattice, whose last may stand in a brick
/// behind the last cell.
pub(super) fn crown(lattice: &Lattice) -> i8 {
    let most = u64::from(lattice.cells.into_iter().max().expect("three axes"));
    let bricks = (most + 2) / BRICK as u64 + 1;
    bricks.next_power_of_two().trailing_zeros() as i8
}

/// Whether a place has cells of the box in it.
pub(super) fn meets_cells(lattice: &Lattice, (level, key): (i8, BrickKey)) -> bool {
    let [above, below] = [-level, level].map(|shift| shift.max(0) as u32);
    let start = |a: usize| (u64::from(key.0[a]) * BRICK as u64) << above;
    (0..3).all(|a| start(a) < u64::from(lattice.cells[a]) << below)
}

/// Whether it is a brick with cells of the box.
pub(super) fn covers_cells(lattice: &Lattice, (level, key): (i8, BrickKey)) -> bool {
    level >= 0 && meets_cells(lattice, (level, key))
}
