//! One level of a field fit: which functions take part, and what they add.

use std::collections::BTreeMap;
use std::ops::Range;

use bspline::hierarchical::{BRICK, BrickEdit, BrickKey, DenseCorrections};
use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;

use super::FieldFitOptions;
use super::judge::{Judge, Left, between_knots, children};
use super::masks::{ALL, Mask, NONE, Rows, between, is_none, places};
use super::region::Region;
use super::room::Room;
use super::sample::sample;
use super::slabs::{Slab, slabs};
use super::tiles::{TILE, TileKey, Tiles, Values};
use crate::FitError;

/// Side and middle of the cubic B-spline at the knots.
pub(super) const SAMPLES: [f64; 2] = [1.0 / 6.0, 4.0 / 6.0];
/// The same of the quasi-interpolant's coefficients \[Lyche75\].
pub(super) const QUASI: [f64; 2] = [-1.0 / 6.0, 8.0 / 6.0];

/// Target and field compared on one level.
pub(super) struct LevelFit<'a, T> {
    pub target: &'a dyn Field,
    pub field: &'a HierarchicalSpline<T>,
    pub region: Region<'a>,
    pub options: &'a FieldFitOptions,
    /// Whether no coarser level was fitted: then all of the box counts.
    pub is_first: bool,
    /// Whether the target holds nothing finer than this level as far as is known: then its knots tell what lies between.
    pub is_resolved: bool,
    /// Tiles of a slab from which on the next one begins.
    pub slab: usize,
}

/// What bricks add, as it is gathered.
type Bricks<T> = BTreeMap<BrickKey, DenseCorrections<T>>;

/// What one level adds, and where the next has to look.
pub(super) struct Round<T> {
    pub edits: Vec<BrickEdit<T>>,
    /// Tiles about the knots that are still in question: of the next level, or of the cells' middles on the finest.
    pub open: Vec<TileKey>,
    pub samples: u64,
}

/// Target and rest at the knots of a slab.
struct Samples {
    tiles: Tiles,
    /// The slab's own tiles.
    own: Range<usize>,
    target: Room,
    rest: Room,
    count: u64,
}

impl<T: Real> LevelFit<'_, T> {
    /// All tiles of the box.
    pub fn all_tiles(&self) -> Vec<TileKey> {
        let (lo, hi) = self.region.sampled();
        let [first, last] = [lo, hi].map(|knot| knot.map(|k| k.div_euclid(TILE as i64) as i32));
        let range = |a: usize| first[a]..=last[a];
        let rows = range(0).flat_map(|x| range(1).map(move |y| [x, y]));
        rows.flat_map(|[x, y]| range(2).map(move |z| [x, y, z])).collect()
    }

    /// Compares target and field in `keys` and says what the functions there should add.
    pub fn run(&self, keys: &[TileKey]) -> Result<Round<T>, FitError> {
        let mut round = Round {
            edits: Vec::new(),
            open: Vec::new(),
            samples: 0,
        };
        let mut bricks = BTreeMap::new();
        for slab in slabs(keys, self.slab) {
            // Those of the last slab that this one reaches, too.
            let reached = bricks.split_off(&BrickKey([slab.start.max(0) as u32, 0, 0]));
            round
                .edits
                .extend(self.edits(std::mem::replace(&mut bricks, reached)));
            round.samples += self.run_slab(slab, &mut bricks, &mut round.open)?;
        }
        round.edits.extend(self.edits(bricks));
        round.open.sort_unstable();
        round.open.dedup();
        Ok(round)
    }

    /// The same of one slab: adds to `bricks` and `open`, and gives the number of samples.
    fn run_slab(&self, slab: Slab, bricks: &mut Bricks<T>, open: &mut Vec<TileKey>) -> Result<u64, FitError> {
        let Samples {
            tiles,
            own,
            target,
            rest,
            count,
        } = self.samples(slab)?;
        let judge = self.judge();
        let (lo, hi) = self.region.judged();
        let exceeding = tiles.map(|i| {
            let judged = between(tiles.keys[i], lo, hi);
            judge.exceeding(&tiles, i, &judged, &target, &rest)
        });
        let mut spread = tiles.map(|i| tiles.spread(i, &exceeding, 1));
        let mut takes_part = self.taking_part(&tiles, &spread);
        let reached = tiles.map_of(&own, |i| self.reached(&tiles, i, &spread));
        let mut near = tiles.map(|i| judge.near(&tiles, i, &reached[i], &target, &rest));
        // What was asked of the target makes room.
        let (mut coefficients, mut left) = self.coefficients(&tiles, &rest, &takes_part, target);
        if judge.is_for_density() && self.region.level == self.options.finest {
            let parts = (&mut spread[..], &mut takes_part);
            self.refine(&tiles, &rest, parts, &mut coefficients, &mut left);
        }
        if judge.is_for_density() {
            for i in own.clone() {
                let is_known = self.is_resolved && !is_none(&takes_part[i]);
                let open = match is_known {
                    true => judge.between(&reached[i], &left[i]),
                    false => reached[i],
                };
                near[i] = std::array::from_fn(|x| near[i][x] | open[x]);
            }
        }
        // What lies beside the slab's own tiles is for its neighbours.
        for i in (0..own.start).chain(own.end..tiles.keys.len()) {
            (spread[i], takes_part[i]) = (NONE, NONE);
        }
        gather(&tiles.keys, &takes_part, &coefficients, bricks);
        open.extend(self.open(&tiles, &near, &spread));
        Ok(count)
    }

    /// The functions that take part: those next to a knot, or on one, that exceeds the tolerance, where they may.
    pub(super) fn taking_part(&self, tiles: &Tiles, spread: &[Mask]) -> Vec<Mask> {
        let (first, last) = self.region.allowed();
        tiles.map(|i| {
            let allowed = and(&spread[i], &between(tiles.keys[i], first, last));
            self.free(tiles.keys[i], allowed, [0, 0])
        })
    }

    /// Those of the places `asked` of a tile about which all functions may change, from so many knots before to so many behind.
    fn free(&self, key: TileKey, asked: Mask, [before, behind]: [i64; 2]) -> Mask {
        let are_free = |lo: [i64; 3], hi: [i64; 3]| {
            self.region
                .are_free(lo.map(|k| k - before), hi.map(|k| k + behind))
        };
        let ends = [0, TILE * TILE * TILE - 1].map(|place| knot_of(key, place));
        if is_none(&asked) || are_free(ends[0], ends[1]) {
            return asked;
        }
        let mut free = NONE;
        for place in places(&asked) {
            let knot = knot_of(key, place);
            free[place / 64] |= u64::from(are_free(knot, knot)) << (place % 64);
        }
        free
    }

    /// What is left at the middles of cells in `keys` that no function reaches which has to stay; with the number of samples.
    pub fn look(&self, keys: &[TileKey]) -> Result<(Left, u64), FitError> {
        let judge = self.judge();
        let (lo, hi) = self.region.judged();
        let (mut all, mut samples) = (Left::default(), 0);
        for slab in slabs(keys, self.slab) {
            let Samples {
                tiles,
                own,
                target,
                rest,
                count,
            } = self.samples(slab)?;
            let left = tiles.map_of(&own, |i| {
                let judged = self.free(tiles.keys[i], between(tiles.keys[i], lo, hi), [1, 2]);
                judge.left(&tiles, i, &judged, &target, &rest)
            });
            all = left.into_iter().fold(all, |all, one| Left {
                worst: all.worst.max(one.worst),
                over_tolerance: all.over_tolerance + one.over_tolerance,
                wrong_signs: all.wrong_signs + one.wrong_signs,
            });
            samples += count;
        }
        Ok((all, samples))
    }

    pub(super) fn judge(&self) -> Judge {
        let region = &self.region;
        let to_world = self.field.lattice_from_world().matrix3.transpose();
        let [cell, finest] = [region.level, region.finest].map(|level| region.world_spacing(level));
        Judge::new(
            self.options.aim,
            to_world * (1.0 / region.spacing(region.level)),
            cell,
            finest,
            self.is_first,
        )
    }

    fn samples(&self, mut slab: Slab) -> Result<Samples, FitError> {
        let (lo, hi) = self.region.sampled();
        slab.keys.retain(|key| !is_none(&between(*key, lo, hi)));
        let own = slab.own();
        let tiles = Tiles::new(slab.keys);
        let fields = [self.target, self.field as &dyn Field];
        let (target, rest, counts) = tiles
            .fill_runs(|run, target, rest, room| sample(fields, &self.region, run[0], target, rest, room));
        for (key, (target, rest)) in tiles.keys.iter().zip(target.iter().zip(&*rest)) {
            // The rest is told faster, and not finite where the target is not.
            if rest.iter().fold(true, |all, r| all & r.is_finite()) {
                continue;
            }
            let inside = between(*key, lo, hi);
            if let Some(bad) = places(&inside).find(|i| !target[*i].is_finite()) {
                return Err(self.not_finite(*key, bad));
            }
        }
        let count = counts.into_iter().sum();
        Ok(Samples {
            tiles,
            own,
            target,
            rest,
            count,
        })
    }

    fn not_finite(&self, key: TileKey, place: usize) -> FitError {
        let at = knot_of(key, place);
        let p = self.region.frame().node(at);
        let DVec3 { x, y, z } = p;
        FitError::Degenerate(format!(
            "the target is not finite at ({x}, {y}, {z}); fit a field that is finite in the box"
        ))
    }

    /// The quasi-interpolant of the rest, and of what that leaves at the knots, in the functions that take part.
    ///
    /// Only the sum is cut off where functions do not take part: where all that reach a point do, it is interpolated as
    /// if there were no cut. With them what the first leaves, in tiles about functions that take part. `left` is room.
    fn coefficients(
        &self,
        tiles: &Tiles,
        rest: &[Values],
        takes_part: &[Mask],
        mut left: Room,
    ) -> (Room, Room) {
        let (first, last) = self.region.sampled();
        let rows = |i: usize| Rows::of(&between(tiles.keys[i], first, last));
        let mut once = tiles.fill(|i, out| {
            let rows = rows(i);
            let is_near = tiles.is_any_near(i, takes_part);
            if !(is_near && rows.is_all()) {
                out.fill(0.0);
            }
            if is_near {
                tiles.convolved(i, &rows, rest, QUASI, out, |to, _, value| *to = value);
            }
        });
        // Beside the rows that are sampled no function takes part, nor next to one: nobody reads what was there.
        tiles.change(&mut left, |i, out| {
            if tiles.is_any_near(i, takes_part) {
                let rest = &rest[i];
                tiles.convolved(i, &rows(i), &once, SAMPLES, out, |to, place, value| {
                    *to = rest[place] - value;
                });
            }
        });
        tiles.change(&mut once, |i, out| {
            if !is_none(&takes_part[i]) {
                let rows = Rows::of(&takes_part[i]);
                tiles.convolved(i, &rows, &left, QUASI, out, |to, _, value| *to += value);
            }
        });
        (once, left)
    }

    /// What the bricks add.
    fn edits(&self, bricks: Bricks<T>) -> impl Iterator<Item = BrickEdit<T>> {
        let level = self.region.level;
        bricks.into_iter().map(move |(key, brick)| BrickEdit {
            level,
            key,
            add: brick.pack(),
        })
    }

    /// Those places of a tile that a change reaches, two knots further, if anybody is to look there.
    fn reached(&self, tiles: &Tiles, tile: usize, spread: &[Mask]) -> Mask {
        let is_last = self.region.level == self.options.finest;
        match (self.is_first, is_last) {
            (_, true) if !self.options.look => NONE,
            (true, false) => ALL,
            _ => tiles.spread(tile, spread, 2),
        }
    }

    /// Tiles in which the next level looks, or the last one between its knots: about those that are `near`, and beside the tiles.
    fn open(&self, tiles: &Tiles, near: &[Mask], spread: &[Mask]) -> Vec<TileKey> {
        let is_last = self.region.level == self.options.finest;
        if is_last && !self.options.look {
            return Vec::new();
        }
        let mut open: Vec<(TileKey, Mask)> = tiles.keys.iter().copied().zip(near.iter().copied()).collect();
        // Beside the tiles nothing is known but that a change reaches there.
        let mut beside: Vec<TileKey> = (tiles.keys.iter().zip(spread))
            .filter(|(_, mask)| !is_none(mask))
            .flat_map(|(key, _)| about(*key))
            .filter(|key| tiles.keys.binary_search(key).is_err())
            .collect();
        beside.sort_unstable();
        beside.dedup();
        open.extend(
            beside
                .into_iter()
                .map(|key| (key, tiles.spread_to(key, spread, 2))),
        );
        match is_last {
            true => between_knots(&open),
            false => children(&open),
        }
    }
}

/// Adds the coefficients of the functions that take part to their bricks.
fn gather<T: Real>(keys: &[TileKey], takes_part: &[Mask], coefficients: &[Values], bricks: &mut Bricks<T>) {
    // Function `k + 1` is centred on knot `k`: the last knots of a tile are the first functions of the next bricks.
    const PARTS: [Range<usize>; 2] = [0..TILE - 1, TILE - 1..TILE];
    for ((key, mask), values) in keys.iter().zip(takes_part).zip(coefficients) {
        if is_none(mask) {
            continue;
        }
        for n in 0..8 {
            let [xs, ys, zs] = [n >> 2, n >> 1 & 1, n & 1].map(|part: usize| PARTS[part].clone());
            let in_part = ((1u64 << zs.len()) - 1) << zs.start;
            let rows = xs.flat_map(|x| ys.clone().map(move |y| [x, y]));
            let taken = |[x, y]: [usize; 2]| mask[x] >> (TILE * y) & in_part;
            let mut rows = rows.filter(|row| taken(*row) != 0).peekable();
            let Some([x, y]) = rows.peek() else { continue };
            let function = |at| knot_of(*key, at).map(|k| (k + 1).max(0) as u32);
            let start = |[x, y]: [usize; 2]| (x * TILE + y) * TILE + zs.start;
            let brick = bricks.entry(BrickKey::of(function(start([*x, *y]))));
            let brick = brick.or_insert_with(DenseCorrections::empty);
            for row in rows {
                let (at, taken) = (start(row), taken(row) >> zs.start);
                let [i, j, k] = [row[0], row[1], zs.start].map(|place| (place + 1) % BRICK);
                brick.mask[i] |= taken << (BRICK * j + k);
                // Nobody reads those of functions that do not take part.
                let to = &mut brick.values[(i * BRICK + j) * BRICK + k..];
                match zs.len() {
                    1 => to[0] = T::from_f64(values[at]),
                    _ => copied::<T, { TILE - 1 }>(&values[at..], to),
                }
            }
        }
    }
}

fn about(key: TileKey) -> impl Iterator<Item = TileKey> {
    (0..27).map(move |n| [key[0] + n / 9 - 1, key[1] + n / 3 % 3 - 1, key[2] + n % 3 - 1])
}

#[inline]
fn knot_of(key: TileKey, place: usize) -> [i64; 3] {
    let at = [place / TILE / TILE, place / TILE % TILE, place % TILE];
    std::array::from_fn(|a| i64::from(key[a]) * TILE as i64 + at[a] as i64)
}

/// The first `N` values, which is a loop of a known length.
fn copied<T: Real, const N: usize>(values: &[f64], to: &mut [T]) {
    let pairs = to[..N].iter_mut().zip(&values[..N]);
    pairs.for_each(|(to, value)| *to = T::from_f64(*value));
}

fn and(a: &Mask, b: &Mask) -> Mask {
    std::array::from_fn(|x| a[x] & b[x])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Aim;
    use bspline::Aabb;
    use bspline::hierarchical::Lattice;
    use bspline::primitives::Sphere;
    use glam::DAffine3;

    /// What slabs of a plane of tiles find is what all tiles together find.
    #[test]
    fn slabs_change_nothing() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(DVec3::splat(-20.0)),
            cells: [40; 3],
        };
        let flat = HierarchicalSpline::<f32>::from_corrections(lattice, 1.0, vec![Default::default()]);
        let ball = Sphere::new(DVec3::new(0.3, -0.2, 0.1), 13.0).unwrap();
        let within = Aabb::new(DVec3::splat(3.0), DVec3::new(36.0, 35.0, 34.0));
        let (iso, tolerance) = (0.0, 0.001);
        let aims = [
            Aim::Surface { iso, tolerance },
            Aim::SurfaceAndDensity {
                iso,
                tolerance,
                density: 0.001,
            },
        ];
        for aim in aims {
            let options = FieldFitOptions {
                aim,
                finest: 2,
                look: true,
            };
            let fit = |level, slab| LevelFit {
                target: &ball,
                field: &flat,
                region: Region {
                    lattice: flat.lattice(),
                    level,
                    finest: 2,
                    within: &within,
                    is_between: false,
                    is_free: &|_| true,
                },
                options: &options,
                is_first: level == 0,
                is_resolved: level > 0,
                slab,
            };
            let mut keys = fit(0, 1).all_tiles();
            for level in 0..3 {
                let [whole, planes] = [usize::MAX, 1].map(|slab| fit(level, slab).run(&keys).unwrap());
                assert!(
                    whole.edits.len() > 20 && whole.edits == planes.edits,
                    "level {level}"
                );
                assert!(
                    !whole.open.is_empty() && whole.open == planes.open,
                    "level {level}"
                );
                keys = whole.open;
            }
            let [whole, planes] = [usize::MAX, 1].map(|slab| fit(2, slab).look(&keys).unwrap().0);
            assert!(whole.worst > 0.0 && whole == planes, "{whole:?}, {planes:?}");
        }
    }
}
