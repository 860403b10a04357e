//! Points that no surface passes through.

use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;

use super::local::{Neighbours, Surroundings};

/// Neighbours looked at.
const COUNT: usize = 12;
/// Distance to the neighbours, as a multiple of that among them (or of the cloud's median), from which on a point
/// stands alone.
const ALONE: f64 = 2.5;
/// Surface variation of a neighbourhood that fills space; a plane has 0, a ball 1/3, clean creases up to 0.08.
const VOLUME: f64 = 0.08;
/// Rounds: outliers hide each other. Ten per cent over the box of a scan take eight.
const ROUNDS: usize = 12;
/// Distance from the quadric of the neighbours, as a multiple of that usual among them, from which on a point lies
/// beside the surface: six standard deviations of Gaussian noise.
const BESIDE: f64 = 9.0;
/// The same as a share of the distance to the neighbours; clean creases reach it, but among others like them.
const BESIDE_BY_DISTANCE: f64 = 0.2;
/// No neighbours are known, or not any more.
const STALE: u32 = u32::MAX;

/// What a point sees.
#[derive(Clone, Copy)]
struct View {
    near: [u32; COUNT],
    /// Root of the mean square distance to them.
    distance: f64,
    /// Surface variation \[Pauly02\].
    variation: f64,
}

/// Which points stand alone: far from their neighbours compared with how near these are to theirs \[Breunig00\], or far compared with the cloud and with neighbours that lie on no surface. Repeated without them until
/// no more are found.
pub(crate) fn lone(positions: &[DVec3]) -> Vec<bool> {
    let stale = View {
        near: [STALE; COUNT],
        distance: 0.0,
        variation: 0.0,
    };
    let mut views = vec![stale; positions.len()];
    let mut is_lone = vec![false; positions.len()];
    let mut kept: Vec<u32> = (0..positions.len() as u32).collect();
    for _ in 0..ROUNDS {
        if kept.len() < 4 * COUNT {
            break;
        }
        look(positions, &kept, &mut views);
        let typical = median(kept.iter().map(|&i| views[i as usize].distance).collect());
        let found: Vec<u32> = kept
            .par_iter()
            .with_min_len(256)
            .copied()
            .filter(|&i| stands_alone(&views[i as usize], &views, typical))
            .collect();
        // Where most stand alone there is no surface to stand apart from.
        if found.is_empty() || 2 * found.len() > kept.len() {
            break;
        }
        for &i in &found {
            is_lone[i as usize] = true;
        }
        kept.retain(|&i| !is_lone[i as usize]);
        for &i in &kept {
            if views[i as usize].near.iter().any(|&j| is_lone[j as usize]) {
                views[i as usize].near[0] = STALE;
            }
        }
    }
    is_lone
}

/// Brings the stale views up to date.
fn look(positions: &[DVec3], kept: &[u32], views: &mut [View]) {
    let here: Vec<DVec3> = kept.iter().map(|&i| positions[i as usize]).collect();
    let tree = Neighbours::new(&here);
    let stale: Vec<u32> = kept
        .iter()
        .copied()
        .filter(|&i| views[i as usize].near[0] == STALE)
        .collect();
    let fresh: Vec<View> = stale
        .par_iter()
        .with_min_len(256)
        .map(|&i| view(positions[i as usize], &here, kept, &tree))
        .collect();
    for (i, view) in stale.into_iter().zip(fresh) {
        views[i as usize] = view;
    }
}

fn view(p: DVec3, here: &[DVec3], kept: &[u32], tree: &Neighbours<'_>) -> View {
    let mut near = [0; COUNT];
    let (mut mean, mut moments, mut square) = (DVec3::ZERO, DMat3::ZERO, 0.0);
    for (slot, (j, d2)) in near.iter_mut().zip(tree.nearest(p, COUNT + 1).skip(1)) {
        *slot = kept[j];
        let d = here[j] - p;
        mean += d;
        moments += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        square += d2;
    }
    let n = COUNT as f64;
    mean /= n;
    moments -= DMat3::from_cols(mean * mean.x, mean * mean.y, mean * mean.z) * n;
    let variances = SymmetricEigen::new(Matrix3::from_column_slice(&moments.to_cols_array())).eigenvalues;
    View {
        near,
        distance: (square / n).sqrt(),
        variation: variances.min() / variances.sum().max(f64::MIN_POSITIVE),
    }
}

fn stands_alone(view: &View, views: &[View], typical: f64) -> bool {
    let theirs = median(view.near.iter().map(|&j| views[j as usize].distance).collect());
    view.distance > ALONE * theirs || (view.distance > ALONE * typical && view.variation > VOLUME)
}

/// Which points lie beside the surface of their neighbours; the one farthest from it where several seem to, since
/// it bends the quadrics of the others.
pub(crate) fn beside(positions: &[DVec3], near: &Neighbours<'_>, around: &[Surroundings]) -> Vec<bool> {
    positions
        .par_iter()
        .zip(around)
        .with_min_len(256)
        .map(|(&p, own)| {
            let is_suspect = own.residual > BESIDE_BY_DISTANCE * own.spread.sqrt();
            is_suspect && {
                let theirs = near.nearest(p, COUNT + 1).skip(1);
                let theirs: Vec<f64> = theirs.map(|(j, _)| around[j].residual).collect();
                let is_farthest = theirs.iter().all(|r| *r <= own.residual);
                is_farthest && own.residual > BESIDE * median(theirs)
            }
        })
        .collect()
}

fn median(mut all: Vec<f64>) -> f64 {
    let middle = all.len() / 2;
    *all.select_nth_unstable_by(middle, f64::total_cmp).1
}
