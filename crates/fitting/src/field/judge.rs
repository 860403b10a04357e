//! Which knots a fit has to mind.

use bspline::vectorized;
use glam::DMat3;

use super::Aim;
use super::masks::{Mask, NONE, Rows, is_none, places};
use super::tiles::{TILE, TileKey, Tiles, Values};

/// Cells of a level on each side of the surface in which its distance counts.
const NEAR: f64 = 3.0;
/// Those in which a rest makes functions take part, with those one knot further: all that reach where [`NEAR`] counts.
const TAKEN: f64 = NEAR + 1.0;
/// Those in which the next level looks: half of what it takes, and what lies between the surface and a knot beside it.
const OPEN: f64 = 2.5;
/// What an interpolant may be off by between the knots, over what the quasi-interpolant leaves at them.
const BETWEEN: f64 = 2.0;

/// The aim on one level, in units in which its knots are one apart.
#[derive(Clone, Copy)]
pub(super) struct Judge {
    /// Value on the surface and the length that may be left there, if it counts.
    surface: Option<(f64, f64)>,
    /// What may be left anywhere.
    density: f64,
    /// `MᵀM` of the map from slopes by knots to slopes in the world.
    metric: DMat3,
    /// World lengths: of the level's cells, and of what a crease may be rounded by.
    cell: f64,
    rounding: f64,
    /// Whether everything in the box counts.
    is_first: bool,
}

/// What is left between the knots, where it matters and all functions may change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Left {
    /// Largest rest: a world length, or a density.
    pub worst: f64,
    /// Points that exceed the tolerance: at creases, or where the finest level does not suffice.
    pub over_tolerance: usize,
    /// Points at which the signs differ further from the surface than the tolerance and one finest interval.
    pub wrong_signs: usize,
}

impl Judge {
    /// `world_from_knot` takes slopes by knots to those in the world; `cell` and `finest` are the widths of a cell of the
    /// level and of the finest one.
    pub fn new(aim: Aim, world_from_knot: DMat3, cell: f64, finest: f64, is_first: bool) -> Self {
        let surface = aim.surface();
        let rounding = surface.map_or(0.0, |(_, tolerance)| tolerance + finest);
        Self {
            surface,
            density: aim.density().unwrap_or(f64::INFINITY),
            metric: world_from_knot.transpose() * world_from_knot,
            cell,
            rounding,
            is_first,
        }
    }

    /// Those of the knots `judged` of a tile that exceed the tolerance where it counts.
    pub fn exceeding(
        &self,
        tiles: &Tiles,
        tile: usize,
        judged: &Mask,
        target: &[Values],
        rest: &[Values],
    ) -> Mask {
        let rests = &rest[tile];
        // Where there is no rest nobody asks for slopes.
        let judged: &Mask = &std::array::from_fn(|x| {
            let plane = &rests[64 * x..64 * (x + 1)];
            let is_any = plane.iter().fold(false, |any, r| any | (*r != 0.0));
            if is_any { judged[x] } else { 0 }
        });
        if is_none(judged) {
            return NONE;
        }
        let density = self.density;
        match self.surface {
            None => mask(
                judged,
                #[inline(always)]
                |i| rests[i].abs() > density,
            ),
            Some((iso, tolerance)) => {
                let slopes = self.slopes_squared(tiles, tile, judged, target);
                let (tolerance, near) = (tolerance * tolerance, (TAKEN * self.cell).powi(2));
                let rounding = self.rounding * self.rounding;
                let target = &target[tile];
                mask(
                    judged,
                    #[inline(always)]
                    |i| {
                        let (t, r, s) = (target[i], rests[i], slopes[i]);
                        let height = (t - iso) * (t - iso);
                        let is_over = (r * r > tolerance * s) & (self.is_first | (height <= near * s));
                        is_over | (r.abs() > density) | is_wrong(t, r, iso, rounding * s)
                    },
                )
            }
        }
    }

    /// Whether something is asked for off the surface too.
    pub fn is_for_density(&self) -> bool {
        self.density.is_finite()
    }

    /// Those of the knots `asked` of a tile between which the interpolant of what its knots hold may be off, by `left`, what the quasi-interpolant
    /// leaves at the knots: a ninth of fourth differences.
    pub fn between(&self, asked: &Mask, left: &Values) -> Mask {
        Self::more_than(asked, left, self.density / BETWEEN)
    }

    /// Those of the knots `asked` of a tile at which more is left than may be anywhere.
    pub fn over(&self, asked: &Mask, left: &Values) -> Mask {
        Self::more_than(asked, left, self.density)
    }

    fn more_than(asked: &Mask, left: &Values, most: f64) -> Mask {
        mask(
            asked,
            #[inline(always)]
            |i| left[i].abs() > most,
        )
    }

    /// Those of the knots `asked` of a tile at which the surface is so near that the next level has to look if anything changes there.
    pub fn near(&self, tiles: &Tiles, tile: usize, asked: &Mask, target: &[Values], rest: &[Values]) -> Mask {
        let Some((iso, _)) = self.surface.filter(|_| !is_none(asked)) else {
            return NONE;
        };
        let slopes = self.slopes_squared(tiles, tile, asked, target);
        let (near, rounding) = ((OPEN * self.cell).powi(2), self.rounding * self.rounding);
        let (target, rest) = (&target[tile], &rest[tile]);
        mask(
            asked,
            #[inline(always)]
            |i| {
                let (t, r, s) = (target[i], rest[i], slopes[i]);
                ((t - iso) * (t - iso) <= near * s) | is_wrong(t, r, iso, rounding * s)
            },
        )
    }

    /// What is left at the knots `judged` of a tile.
    pub fn left(
        &self,
        tiles: &Tiles,
        tile: usize,
        judged: &Mask,
        target: &[Values],
        rest: &[Values],
    ) -> Left {
        let mut left = Left::default();
        let exceeding = self.exceeding(tiles, tile, judged, target, rest);
        let (slopes, iso) = match self.surface {
            Some((iso, _)) => (self.slopes_squared(tiles, tile, judged, target), iso),
            None => ([1.0; TILE * TILE * TILE], 0.0),
        };
        let (near, rounding) = ((NEAR * self.cell).powi(2), self.rounding * self.rounding);
        for i in places(judged) {
            let (t, r, s) = (target[tile][i], rest[tile][i], slopes[i]);
            let is_surface = self.surface.is_some();
            let is_wrong = is_surface && is_wrong(t, r, iso, rounding * s);
            let counts = !is_surface || is_wrong || (t - iso) * (t - iso) <= near * s;
            if counts && s > 0.0 {
                left.worst = left.worst.max((r * r / s).sqrt());
            }
            left.over_tolerance += usize::from(exceeding[i / 64] >> (i % 64) & 1 == 1);
            left.wrong_signs += usize::from(is_wrong);
        }
        left
    }

    /// Square of the target's slope in the world at the knots `asked` of a tile, from the neighbours that there are.
    fn slopes_squared(&self, tiles: &Tiles, tile: usize, asked: &Mask, target: &[Values]) -> Values {
        const WIDE: usize = TILE + 2;
        let rows = Rows::of(asked);
        let padded = tiles.padded(tile, &rows, target);
        let m = self.metric;
        let (xx, yy, zz) = (m.x_axis.x, m.y_axis.y, m.z_axis.z);
        let (xy, xz, yz) = (2.0 * m.x_axis.y, 2.0 * m.x_axis.z, 2.0 * m.y_axis.z);
        let mut out = [0.0; TILE * TILE * TILE];
        // Most tiles have all of their neighbours; to ask each knot for them costs as much as the slopes.
        let lines = || {
            (rows.x.start..rows.x.end + 2).flat_map(|x| (rows.y.start..rows.y.end + 2).map(move |y| (x, y)))
        };
        let is_whole = lines().all(|(x, y)| {
            let line = &padded[(x * WIDE + y) * WIDE..][..WIDE];
            line.iter().fold(true, |all, v| all & !v.is_nan())
        });
        vectorized(
            #[inline(always)]
            || {
                let xys = rows.x.clone().flat_map(|x| rows.y.clone().map(move |y| (x, y)));
                for (x, y) in xys {
                    let to = &mut out[(x * TILE + y) * TILE..][..TILE];
                    let own = ((x + 1) * WIDE + y + 1) * WIDE + 1;
                    let rows = [WIDE * WIDE, WIDE, 1].map(|step| {
                        let at = |start: usize| -> &[f64; TILE] {
                            padded[start..start + TILE].try_into().expect("eight values")
                        };
                        [at(own - step), at(own), at(own + step)]
                    });
                    for (z, to) in to.iter_mut().enumerate() {
                        let [x, y, z] = match is_whole {
                            true => rows.map(|[a, o, b]| 0.5 * ((o[z] - a[z]) + (b[z] - o[z]))),
                            false => rows.map(|[a, o, b]| difference(a[z], o[z], b[z])),
                        };
                        *to = x * (xx * x + xy * y + xz * z) + y * (yy * y + yz * z) + zz * z * z;
                    }
                }
            },
        );
        out
    }
}

/// Slope by knots; NaN stands for a neighbour that there is not.
#[inline(always)]
fn difference(before: f64, own: f64, behind: f64) -> f64 {
    let (back, ahead) = (own - before, behind - own);
    let back_or_ahead = if back.is_nan() { ahead } else { back };
    let ahead_or_back = if ahead.is_nan() { back } else { ahead };
    let slope = 0.5 * (back_or_ahead + ahead_or_back);
    if slope.is_nan() { 0.0 } else { slope }
}

/// Whether the signs differ further from the surface than the squared height `rounding`.
#[inline(always)]
fn is_wrong(target: f64, rest: f64, iso: f64, rounding: f64) -> bool {
    ((target > iso) != (target - rest > iso)) & ((target - iso) * (target - iso) > rounding)
}

/// Those of the knots `asked` of which `of`, marked `#[inline(always)]`, is true.
#[inline(always)]
fn mask(asked: &Mask, of: impl Fn(usize) -> bool) -> Mask {
    let mut found = NONE;
    vectorized(
        #[inline(always)]
        || {
            for x in 0..TILE {
                if asked[x] != 0 {
                    let mut word = 0;
                    for bit in 0..64 {
                        word |= u64::from(of(64 * x + bit)) << bit;
                    }
                    found[x] = asked[x] & word;
                }
            }
        },
    );
    found
}

/// Tiles of the next level about the knots of `open`, sorted: knot `k` of this level is knot `2k` of that, and a knot
/// answers for those beside it there.
pub(super) fn children(open: &[(TileKey, Mask)]) -> Vec<TileKey> {
    gathered(open, [-1, 0, 1], &[0..1, 0..5, 4..8], 2)
}

/// Tiles of the middles of cells about the knots of `open`, sorted.
pub(super) fn between_knots(open: &[(TileKey, Mask)]) -> Vec<TileKey> {
    gathered(open, [-1, 0, 1], &[0..1, 0..8, 8..8], 1)
}

fn gathered(
    open: &[(TileKey, Mask)],
    steps: [i32; 3],
    slots: &[std::ops::Range<usize>; 3],
    scale: i32,
) -> Vec<TileKey> {
    let mut keys = Vec::new();
    for (key, mask) in open {
        for (dx, xs) in steps.iter().zip(slots) {
            let plane = mask[xs.clone()].iter().fold(0, |all, word| all | word);
            if plane == 0 {
                continue;
            }
            for (dy, ys) in steps.iter().zip(slots) {
                let rows = plane.to_le_bytes()[ys.clone()]
                    .iter()
                    .fold(0, |all, row| all | row);
                for (dz, zs) in steps.iter().zip(slots) {
                    let bits = zs.clone().fold(0u8, |bits, z| bits | 1 << z);
                    if rows & bits != 0 {
                        keys.push([scale * key[0] + dx, scale * key[1] + dy, scale * key[2] + dz]);
                    }
                }
            }
        }
    }
    keys.sort_unstable();
    keys.dedup();
    keys
}
