//! Values at the knots of a level in tiles of 8³, and what is done with them: stencils and masks that look into the
//! tiles beside.

use std::ops::Range;

use bspline::vectorized;
use rayon::prelude::*;

use super::masks::{Mask, Rows, is_none, spread};
use super::room::Room;

/// Knots along a tile.
pub(super) const TILE: usize = 8;
const LEN: usize = TILE * TILE * TILE;
/// A tile and one knot beside it.
const PADDED: usize = TILE + 2;
/// Tiles from which on the threads share them: some tenths of a millisecond's work. Waking another takes a part of that.
const SIDE_BY_SIDE: usize = 24;

/// Most tiles that are sampled together.
pub(super) const RUN: usize = 4;

/// Tile `k` holds the knots `8k .. 8k + 8`, as the cells of a brick begin.
pub(super) type TileKey = [i32; 3];
/// Values of a tile, z fastest.
pub(super) type Values = [f64; LEN];

/// A tile's values and those one knot beside.
pub(super) type Padded = [f64; PADDED * PADDED * PADDED];

const ABSENT: u32 = u32::MAX;

/// Values of a tile along z, and those before and behind them where there are tiles.
struct Row<'a> {
    before: Option<f64>,
    own: &'a [f64; TILE],
    behind: Option<f64>,
}

/// Tiles along z about one, or beside it, as stencils read them.
struct Column<'a> {
    own: &'a Values,
    /// The tile with the value before a row and its place in z: the row's own first where there is no tile.
    before: (&'a Values, usize),
    /// The same behind.
    behind: (&'a Values, usize),
    /// Whether the tile at hand goes on there, on x and on y, as there is no other.
    goes_on: [bool; 2],
}

impl Column<'_> {
    /// Where the row begins that stands at `x`, `y` in [`Padded`].
    #[inline(always)]
    fn start(&self, x: usize, y: usize) -> usize {
        let within = |padded: usize, goes_on: bool| match goes_on {
            true => padded.clamp(1, TILE) - 1,
            false => (padded + TILE - 1) % TILE,
        };
        (within(x, self.goes_on[0]) * TILE + within(y, self.goes_on[1])) * TILE
    }
}

/// Tiles of a level in order, and where those beside each stand.
pub(super) struct Tiles {
    pub keys: Vec<TileKey>,
    neighbours: Vec<[u32; 27]>,
}

impl Tiles {
    /// Of `keys`, sorted.
    pub fn new(keys: Vec<TileKey>) -> Self {
        // The tile from which on those of each column about the last one stand: it only moves on.
        let mut starts = [0; 9];
        let neighbours = keys.iter().map(|&[x, y, z]| {
            let mut all = [ABSENT; 27];
            for (column, (row, start)) in all.chunks_exact_mut(3).zip(&mut starts).enumerate() {
                let at = [x + column as i32 / 3 - 1, y + column as i32 % 3 - 1];
                let first = [at[0], at[1], z - 1];
                while *start < keys.len() && keys[*start] < first {
                    *start += 1;
                }
                for (n, key) in keys.iter().enumerate().skip(*start).take(3) {
                    let ahead = i64::from(key[2]) - i64::from(first[2]);
                    if [key[0], key[1]] == at && (0..3).contains(&ahead) {
                        row[ahead as usize] = n as u32;
                    }
                }
            }
            all
        });
        let neighbours = neighbours.collect();
        Self { keys, neighbours }
    }

    /// What `of` gives for each tile, in order, whatever the number of threads.
    pub fn map<R: Send>(&self, of: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
        each(self.keys.len(), of)
    }

    /// The same for some of the tiles, and nothing for the others.
    pub fn map_of<R: Default + Send>(
        &self,
        some: &Range<usize>,
        of: impl Fn(usize) -> R + Sync + Send,
    ) -> Vec<R> {
        self.map(|i| if some.contains(&i) { of(i) } else { R::default() })
    }

    /// Values of each tile, all of which `of` writes.
    pub fn fill(&self, of: impl Fn(usize, &mut Values) + Sync + Send) -> Room {
        let mut values = Room::of(self.keys.len());
        self.change(&mut values, of);
        values
    }

    /// Changes the values of each tile.
    pub fn change(&self, values: &mut [Values], of: impl Fn(usize, &mut Values) + Sync + Send) {
        match values.len() < SIDE_BY_SIDE {
            true => values.iter_mut().enumerate().for_each(|(i, v)| of(i, v)),
            false => {
                let all = values.par_iter_mut().with_min_len(4).enumerate();
                all.for_each(|(i, v)| of(i, v));
            }
        }
    }

    /// Two values of each tile, all of which `of` writes, and what it gives for each run of tiles along z: what is asked
    /// for together costs less. With room for intermediate values.
    pub fn fill_runs<R: Send>(
        &self,
        of: impl Fn(&[TileKey], &mut [Values], &mut [Values], &mut Vec<f64>) -> R + Sync + Send,
    ) -> (Room, Room, Vec<R>) {
        let [mut a, mut b] = [(); 2].map(|()| Room::of(self.keys.len()));
        let (mut rest_a, mut rest_b) = (&mut a[..], &mut b[..]);
        let is_next = |k: &TileKey, l: &TileKey| *l == [k[0], k[1], k[2] + 1];
        let columns = self.keys.chunk_by(is_next).flat_map(|column| column.chunks(RUN));
        let runs: Vec<_> = columns
            .map(|run| {
                let own_a = rest_a.split_off_mut(..run.len()).expect("a value for each tile");
                let own_b = rest_b.split_off_mut(..run.len()).expect("a value for each tile");
                (run, own_a, own_b)
            })
            .collect();
        let of = |room: &mut Vec<f64>, (run, a, b): (&[TileKey], &mut [Values], &mut [Values])| {
            of(run, a, b, room)
        };
        let found = match self.keys.len() < SIDE_BY_SIDE {
            true => {
                let mut room = Vec::new();
                runs.into_iter().map(|run| of(&mut room, run)).collect()
            }
            false => runs.into_par_iter().map_init(Vec::new, of).collect(),
        };
        (a, b, found)
    }

    /// Whether anything is not zero in a tile or beside it.
    pub fn is_any_near(&self, tile: usize, masks: &[Mask]) -> bool {
        let known = self.neighbours[tile].iter().filter(|n| **n != ABSENT);
        known.into_iter().any(|n| !is_none(&masks[*n as usize]))
    }

    /// Values of the rows of a tile and one knot beside them; NaN where there is no tile.
    pub fn padded(&self, tile: usize, rows: &Rows, values: &[Values]) -> Padded {
        let mut out = [f64::NAN; PADDED * PADDED * PADDED];
        for x in rows.x.start..rows.x.end + 2 {
            for y in rows.y.start..rows.y.end + 2 {
                if let Some(row) = self.row(tile, [x, y], values) {
                    let to = &mut out[(x * PADDED + y) * PADDED..][..PADDED];
                    to[1..=TILE].copy_from_slice(row.own);
                    to[0] = row.before.unwrap_or(f64::NAN);
                    to[PADDED - 1] = row.behind.unwrap_or(f64::NAN);
                }
            }
        }
        out
    }

    /// One row of a tile with those about it, numbered as they lie in [`Padded`], if its tile is there.
    #[inline(always)]
    fn row<'a>(&self, tile: usize, [x, y]: [usize; 2], values: &'a [Values]) -> Option<Row<'a>> {
        let ((dx, sx), (dy, sy)) = (split(x), split(y));
        let first = (dx * 3 + dy) * 3;
        let [before, own, behind]: [u32; 3] = self.neighbours[tile][first..first + 3]
            .try_into()
            .expect("three tiles along z");
        if own == ABSENT {
            return None;
        }
        let at = (sx * TILE + sy) * TILE;
        let of = |n: u32| -> &'a [f64; TILE] {
            values[n as usize][at..at + TILE]
                .try_into()
                .expect("eight values")
        };
        let known = |n: u32, z: usize| (n != ABSENT).then(|| of(n)[z]);
        Some(Row {
            before: known(before, TILE - 1),
            own: of(own),
            behind: known(behind, 0),
        })
    }

    /// The tiles about one as its stencils read them, by their step on x and y: found once, not for every row.
    #[inline(always)]
    fn columns<'a>(&self, tile: usize, values: &'a [Values]) -> [[Column<'a>; 3]; 3] {
        let neighbours = &self.neighbours[tile];
        std::array::from_fn(|dx| {
            std::array::from_fn(|dy| {
                // Where there is no tile the nearest that there is goes on: beside it on x, on y, the tile itself.
                let all = [[dx, dy], [1, dy], [dx, 1], [1, 1]];
                let is_there = |at: &[usize; 2]| neighbours[(at[0] * 3 + at[1]) * 3 + 1] != ABSENT;
                let at = all.into_iter().find(is_there).unwrap_or([1, 1]);
                let first = (at[0] * 3 + at[1]) * 3;
                let [before, own, behind] = [0, 1, 2].map(|z| values.get(neighbours[first + z] as usize));
                let own = own.expect("a tile that is there");
                Column {
                    before: before.map_or((own, 0), |before| (before, TILE - 1)),
                    own,
                    behind: behind.map_or((own, TILE - 1), |behind| (behind, 0)),
                    goes_on: [at[0] != dx, at[1] != dy],
                }
            })
        })
    }

    /// `weights[0]·v_{i-1} + weights[1]·v_i + weights[0]·v_{i+1}` on each axis, in these rows of a tile, handed to `put`
    /// with its place and what `out` holds there; the others stay. Where there is no tile the values at its face go on.
    #[inline(always)]
    pub fn convolved(
        &self,
        tile: usize,
        rows: &Rows,
        values: &[Values],
        weights: [f64; 2],
        out: &mut Values,
        put: impl Fn(&mut f64, usize, f64),
    ) {
        vectorized(
            #[inline(always)]
            || {
                let [side, own] = weights;
                const PLANE: usize = TILE * TILE;
                let (xs, ys) = (rows.x.clone(), rows.y.clone());
                let columns = self.columns(tile, values);
                // The last three planes, done along z and y.
                let mut planes = [[0.0; PLANE]; 3];
                let mut along_z = [[0.0; TILE]; PADDED];
                for x in xs.start..xs.end + 2 {
                    for y in ys.start..ys.end + 2 {
                        let column = &columns[x.div_ceil(TILE)][y.div_ceil(TILE)];
                        let start = column.start(x, y);
                        let [before, behind] = [column.before, column.behind].map(|(v, z)| v[start + z]);
                        const LAST: usize = TILE - 1;
                        let v: &[f64; TILE] = column.own[start..start + TILE].try_into().expect("a row");
                        let to = &mut along_z[y];
                        to[0] = own * v[0] + side * (before + v[1]);
                        for z in 1..LAST {
                            to[z] = own * v[z] + side * (v[z - 1] + v[z + 1]);
                        }
                        to[LAST] = own * v[LAST] + side * (v[LAST - 1] + behind);
                    }
                    let to = &mut planes[x % 3];
                    for y in ys.clone() {
                        for z in 0..TILE {
                            to[y * TILE + z] =
                                own * along_z[y + 1][z] + side * (along_z[y][z] + along_z[y + 2][z]);
                        }
                    }
                    if x < xs.start + 2 {
                        continue;
                    }
                    let [before, own_plane, behind] = [1, 2, 0].map(|n| &planes[(x + n) % 3]);
                    let first = (x - 2) * PLANE;
                    let to = &mut out[first..first + PLANE];
                    for i in ys.start * TILE..ys.end * TILE {
                        let value = own * own_plane[i] + side * (before[i] + behind[i]);
                        put(&mut to[i], first + i, value);
                    }
                }
            },
        );
    }

    /// Knots of a tile, or beside it by one on any axis, at which a mask is set: its rows grown by `reach` (1 or 2).
    pub fn spread(&self, tile: usize, masks: &[Mask], reach: usize) -> Mask {
        spread(reach, |n| match self.neighbours[tile][n] {
            ABSENT => None,
            n => Some(masks[n as usize]),
        })
    }

    /// [`Self::spread`] into a tile that need not be one of these.
    pub fn spread_to(&self, key: TileKey, masks: &[Mask], reach: usize) -> Mask {
        spread(reach, |n| {
            let step = [n / 9, n / 3 % 3, n % 3];
            let key: TileKey = std::array::from_fn(|a| key[a] + step[a] as i32 - 1);
            self.keys.binary_search(&key).ok().map(|n| masks[n])
        })
    }
}

/// Which of three tiles a padded place lies in, and where in it.
#[inline(always)]
fn split(padded: usize) -> (usize, usize) {
    match padded {
        0 => (0, TILE - 1),
        PADDED.. => unreachable!("a padded tile is ten wide"),
        p if p == PADDED - 1 => (2, 0),
        p => (1, p - 1),
    }
}

/// Does work on `tiles` tiles where its parts can be shared at once: each call from outside the threads' pool waits for
/// one of them to wake.
pub(super) fn in_pool<R: Send>(tiles: usize, work: impl FnOnce() -> R + Send) -> R {
    match tiles < SIDE_BY_SIDE {
        true => work(),
        false => rayon::scope(|_| work()),
    }
}

/// What `of` gives for each of `count`, in order; side by side where there are many.
fn each<R: Send>(count: usize, of: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    match count < SIDE_BY_SIDE {
        true => (0..count).map(of).collect(),
        false => (0..count).into_par_iter().with_min_len(4).map(of).collect(),
    }
}
