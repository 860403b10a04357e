//! The conditions of the paper: two points off the surface for each sample, in the place of its gradient.
//!
//! `f(x ± d n) = ∓d` beside `f(x) = 0` (Hua and Qin 2004, §4). An off-surface point speaks for its sample only if no
//! other sample is nearer to it, or across a thin wall it would ask for the wrong sign; `d` is halved until that holds,
//! and the point is dropped if it never does.

use glam::DVec3;
use kiddo::SquaredEuclidean;
use rayon::prelude::*;

use super::samples::{ADDED, Entry, Samples};
use super::support::Tree;

/// Offsets tried, each half the one before; the first is the mean spacing of the samples.
const TRIES: i32 = 4;

/// The samples with their off-surface points, and a sentence that counts these.
pub(crate) fn with_offset_pairs(samples: &Samples, tree: &Tree, spacing: f64) -> (Samples, String) {
    let positions = &samples.positions;
    let is_own = |p: DVec3, i: usize, d: f64| {
        let nearest = tree
            .query(&p.to_array())
            .nearest_one::<SquaredEuclidean<f64>>()
            .execute();
        // Points that coincide with the sample are as good as itself.
        let j = nearest.item as usize;
        j == i || positions[j] == positions[i] || nearest.distance >= d * d * (1.0 - 1e-9)
    };
    let found: Vec<[Option<(f64, i32)>; 2]> = (0..positions.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            if samples.is_sign_condition(i) || samples.weights[i] == 0.0 {
                return [None; 2];
            }
            let normal = DVec3::from(samples.normals[i].map(f64::from));
            [1.0, -1.0].map(|side| {
                (0..TRIES).find_map(|halvings| {
                    let d = spacing * 0.5f64.powi(halvings);
                    let p = positions[i] + normal * (side * d);
                    let in_box = p.min_element() >= 0.0 && p.max_element() < 1.0;
                    (in_box && is_own(p, i, d)).then_some((side * d, halvings))
                })
            })
        })
        .collect();
    let mut entries: Vec<Entry> = (0..positions.len()).map(|i| samples.entry(i)).collect();
    let (mut shortened, mut dropped) = (0, 0);
    for (i, pair) in found.iter().enumerate() {
        if samples.is_sign_condition(i) || samples.weights[i] == 0.0 {
            continue;
        }
        let own = entries[i];
        for off in pair {
            let Some((d, halvings)) = off else {
                dropped += 1;
                continue;
            };
            shortened += usize::from(*halvings > 0);
            let position = own.position + DVec3::from(own.normal.map(f64::from)) * *d;
            entries.push(Entry {
                position,
                measured: position,
                normal: [0.0; 3],
                target: own.target - *d as f32,
                weight: own.weight,
                certainty: 1.0,
                source: ADDED,
            });
        }
    }
    let account = format!(
        "offset pairs: {} off-surface points, {shortened} of them nearer than the mean spacing; {dropped} dropped, since \
         another sample was nearer",
        entries.len() - positions.len()
    );
    (samples.with_entries(entries), account)
}
