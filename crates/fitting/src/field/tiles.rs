//! Values at the knots of a level in tiles of 8³, and what is done with them: stencils and masks that look into the
//! tiles beside.

use std::ops::Range;

use bspline::vectorized;
use rayon::prelude::*;

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
/// One bit per knot: word `x`, bit `8y + z`.
pub(super) type Mask = [u64; TILE];

/// A tile's values and those one knot beside.
pub(super) type Padded = [f64; PADDED * PADDED * PADDED];

/// Rows of a tile along z that matter: a range on x and one on y.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    pub x: Range<usize>,
    pub y: Range<usize>,
}

impl Rows {
    /// Those with a knot of a mask.
    pub fn of(mask: &Mask) -> Self {
        let plane = mask.iter().fold(0, |all, word| all | word).to_le_bytes();
        let ends = |is_set: &dyn Fn(usize) -> bool| {
            let first = (0..TILE).find(|i| is_set(*i)).unwrap_or(0);
            let last = (0..TILE).rev().find(|i| is_set(*i));
            first..last.map_or(first, |last| last + 1)
        };
        Self {
            x: ends(&|x| mask[x] != 0),
            y: ends(&|y| plane[y] != 0),
        }
    }
}

pub(super) const NONE: Mask = [0; TILE];
const ABSENT: u32 = u32::MAX;

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

    /// Values of each tile as `of` writes them over zeros.
    pub fn fill(&self, of: impl Fn(usize, &mut Values) + Sync + Send) -> Vec<Values> {
        let mut values = vec![[0.0; LEN]; self.keys.len()];
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

    /// Two values of each tile as `of` writes them over zeros, and what it gives for each run of tiles along z: what is asked
    /// for together costs less. With room for intermediate values.
    pub fn fill_runs<R: Send>(
        &self,
        of: impl Fn(&[TileKey], &mut [Values], &mut [Values], &mut Vec<f64>) -> R + Sync + Send,
    ) -> (Vec<Values>, Vec<Values>, Vec<R>) {
        let zeros = || vec![[0.0; LEN]; self.keys.len()];
        let (mut a, mut b) = (zeros(), zeros());
        let (mut rest_a, mut rest_b) = (a.as_mut_slice(), b.as_mut_slice());
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
        known.into_iter().any(|n| masks[*n as usize] != NONE)
    }

    /// Values of the rows of a tile and one knot beside them; NaN where there is no tile.
    pub fn padded(&self, tile: usize, rows: &Rows, values: &[Values]) -> Padded {
        let mut out = [f64::NAN; PADDED * PADDED * PADDED];
        for x in rows.x.start..rows.x.end + 2 {
            for y in rows.y.start..rows.y.end + 2 {
                if let Some(row) = self.row(tile, [x, y], values, Some(f64::NAN)) {
                    out[(x * PADDED + y) * PADDED..][..PADDED].copy_from_slice(&row);
                }
            }
        }
        out
    }

    /// One row of a tile with those about it, numbered as they lie in [`Padded`], if its tile is there. Where there is no
    /// tile before or behind it stands `absent`, or the value at the face.
    #[inline(always)]
    fn row(
        &self,
        tile: usize,
        [x, y]: [usize; 2],
        values: &[Values],
        absent: Option<f64>,
    ) -> Option<[f64; PADDED]> {
        let ((dx, sx), (dy, sy)) = (split(x), split(y));
        let first = (dx * 3 + dy) * 3;
        let [before, own, behind]: [u32; 3] = self.neighbours[tile][first..first + 3]
            .try_into()
            .expect("three tiles along z");
        if own == ABSENT {
            return None;
        }
        let at = (sx * TILE + sy) * TILE;
        let of = |n: u32| -> &[f64; TILE] {
            values[n as usize][at..at + TILE]
                .try_into()
                .expect("eight values")
        };
        let mut row = [0.0; PADDED];
        row[1..=TILE].copy_from_slice(of(own));
        row[0] = match before {
            ABSENT => absent.unwrap_or(row[1]),
            before => of(before)[TILE - 1],
        };
        row[PADDED - 1] = match behind {
            ABSENT => absent.unwrap_or(row[TILE]),
            behind => of(behind)[0],
        };
        Some(row)
    }

    /// A row where there is no tile: the nearest of a tile that there is.
    #[cold]
    fn nearest_row(&self, tile: usize, [x, y]: [usize; 2], values: &[Values]) -> [f64; PADDED] {
        let [inner_x, inner_y] = [x, y].map(|p| p.clamp(1, TILE));
        [[inner_x, y], [x, inner_y], [inner_x, inner_y]]
            .into_iter()
            .find_map(|at| self.row(tile, at, values, None))
            .expect("the tile itself")
    }

    /// `weights[0]·v_{i-1} + weights[1]·v_i + weights[0]·v_{i+1}` on each axis, in these rows of a tile; the others stay.
    /// Where there is no tile the values at its face go on.
    pub fn convolved(
        &self,
        tile: usize,
        rows: &Rows,
        values: &[Values],
        weights: [f64; 2],
        out: &mut Values,
    ) {
        vectorized(
            #[inline(always)]
            || {
                let [side, own] = weights;
                const PLANE: usize = TILE * TILE;
                let (xs, ys) = (rows.x.clone(), rows.y.clone());
                // The last three planes, done along z and y.
                let mut planes = [[0.0; PLANE]; 3];
                for x in xs.start..xs.end + 2 {
                    let mut along_z = [[0.0; TILE]; PADDED];
                    for y in ys.start..ys.end + 2 {
                        let row = match self.row(tile, [x, y], values, None) {
                            Some(row) => row,
                            None => self.nearest_row(tile, [x, y], values),
                        };
                        for z in 0..TILE {
                            along_z[y][z] = own * row[z + 1] + side * (row[z] + row[z + 2]);
                        }
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
                    let to = &mut out[(x - 2) * PLANE..][..PLANE];
                    for i in ys.start * TILE..ys.end * TILE {
                        to[i] = own * own_plane[i] + side * (before[i] + behind[i]);
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
fn split(padded: usize) -> (usize, usize) {
    match padded {
        0 => (0, TILE - 1),
        PADDED.. => unreachable!("a padded tile is ten wide"),
        p if p == PADDED - 1 => (2, 0),
        p => (1, p - 1),
    }
}

fn spread(reach: usize, masks: impl Fn(usize) -> Option<Mask>) -> Mask {
    // Rows of bits, `reach` wider on every side.
    let width = TILE + 2 * reach;
    let mut rows = [[0u16; TILE + 4]; TILE + 4];
    for n in 0..27 {
        let Some(mask) = masks(n).filter(|m| *m != NONE) else {
            continue;
        };
        let step = [n / 9, n / 3 % 3, n % 3];
        // Where the tile's first knot lies in the wider one.
        let start = step.map(|s| (s * TILE + reach) as i32 - TILE as i32);
        for (x, word) in mask.iter().enumerate() {
            let x = start[0] + x as i32;
            if !(0..width as i32).contains(&x) || *word == 0 {
                continue;
            }
            for (y, bits) in word.to_le_bytes().into_iter().enumerate() {
                let y = start[1] + y as i32;
                if (0..width as i32).contains(&y) {
                    let bits = u32::from(bits) << 16 >> (16 - start[2]);
                    rows[x as usize][y as usize] |= (bits & ((1 << width) - 1)) as u16;
                }
            }
        }
    }
    for row in rows.iter_mut().flatten() {
        *row = (0..=2 * reach).fold(0, |all, by| all | *row >> by);
    }
    std::array::from_fn(|x| {
        let bytes = std::array::from_fn(|y| {
            let near = rows[x..=x + 2 * reach]
                .iter()
                .flat_map(|rows| &rows[y..=y + 2 * reach]);
            near.fold(0, |all, row| all | row) as u8
        });
        u64::from_le_bytes(bytes)
    })
}

/// The knots `lo ..= hi` of a tile.
pub(super) fn between(key: TileKey, lo: [i64; 3], hi: [i64; 3]) -> Mask {
    let [xs, ys, zs] = [0, 1, 2].map(|a| {
        let first = i64::from(key[a]) * TILE as i64;
        let start = (lo[a] - first).clamp(0, TILE as i64);
        let end = (hi[a] + 1 - first).clamp(start, TILE as i64);
        start as usize..end as usize
    });
    let row = ((1u64 << zs.len()) - 1) << zs.start;
    let plane = ys.fold(0, |plane, y| plane | row << (TILE * y));
    std::array::from_fn(|x| if xs.contains(&x) { plane } else { 0 })
}

/// Bits of a mask, with their place `64x + 8y + z`.
pub(super) fn places(mask: &Mask) -> impl Iterator<Item = usize> {
    bspline::hierarchical::active_slots(mask)
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
