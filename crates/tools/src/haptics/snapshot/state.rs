//! All that may be touched at one moment.

use std::sync::Arc;

use glam::DVec3;

use super::brick::DistanceBrick;
use super::thin::Unresolved;
use super::touch_map::TouchMap;
use crate::haptics::{Obstacle, Touch};

/// An object as it may be touched.
#[derive(Clone)]
pub struct Part {
    /// Which object.
    pub object: u64,
    /// Its shape.
    pub shape: Arc<DistanceBrick>,
    /// Its shape in the snapshot before, if that was another.
    pub before: Option<Arc<DistanceBrick>>,
    /// What it feels like where nothing else is painted.
    pub default: Touch,
    /// What is painted.
    pub painted: Option<Arc<TouchMap>>,
}

/// What may be touched at one moment: a value that the simulation publishes and the haptic thread reads. Asked directly it is what has come;
/// [`moving`](Self::moving) is on the way there from the snapshot before.
#[derive(Clone)]
pub struct Snapshot {
    pub(super) parts: Vec<Part>,
    /// What the simulation calls the state that it was made from.
    pub edit: u64,
    /// Counts the snapshots of a maker, also those without a change: the age of a snapshot is that of the last of these.
    pub heartbeat: u64,
    /// The tool's place that it was made round.
    pub at: DVec3,
}

impl Snapshot {
    /// Nothing to touch.
    pub fn empty() -> Self {
        Self {
            parts: Vec::new(),
            edit: 0,
            heartbeat: 0,
            at: DVec3::ZERO,
        }
    }

    /// Objects.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// On the way from the snapshot before to this one; `share` goes from 0 to 1 within one period of the simulation, so that an edit comes as a
    /// motion and not as a step.
    pub fn moving(&self, share: f64) -> Moving<'_> {
        Moving {
            snapshot: self,
            share: share.clamp(0.0, 1.0),
        }
    }

    /// Whether it differs in shape from the snapshot before.
    pub fn moves(&self) -> bool {
        self.parts.iter().any(|part| part.before.is_some())
    }

    /// Whether no surface beyond what was sampled is nearer to a tool of some size, mm, than what is told.
    pub fn covers(&self, p: DVec3, size: f64) -> bool {
        self.parts.iter().all(|part| part.shape.covers(p, size))
    }

    /// What was sampled too coarsely, of the worst object: to be told to the user.
    pub fn unresolved(&self) -> Option<Unresolved> {
        let all = self.parts.iter().map(|part| part.shape.unresolved());
        let all = all.filter(Unresolved::any);
        all.max_by_key(|u| (u.missed, u.thin))
    }

    /// Bytes of all samples.
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(|part| part.shape.bytes()).sum()
    }
}

/// A snapshot on its way from the one before.
#[derive(Clone, Copy)]
pub struct Moving<'a> {
    snapshot: &'a Snapshot,
    share: f64,
}

impl Moving<'_> {
    fn of(&self, part: &Part, p: DVec3) -> (f64, DVec3) {
        let (b, gb) = part.shape.distance(p);
        match &part.before {
            Some(before) if self.share < 1.0 && before.covers(p, 0.0) => {
                let (a, ga) = before.distance(p);
                (a + self.share * (b - a), ga + self.share * (gb - ga))
            }
            _ => (b, gb),
        }
    }

    /// The nearest object, its distance and gradient \[Kim03 eq. 4.10\].
    fn nearest(&self, p: DVec3) -> Option<(&Part, (f64, DVec3))> {
        let all = self.snapshot.parts.iter().map(|part| (part, self.of(part, p)));
        all.min_by(|a, b| a.1.0.total_cmp(&b.1.0))
    }
}

impl Obstacle for Moving<'_> {
    /// Nothing is infinitely far away.
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.nearest(p)
            .map_or((f64::INFINITY, DVec3::Z), |(_, found)| found)
    }

    fn finest(&self) -> f64 {
        let of = |part: &Part| {
            let before = part.before.as_ref().map_or(f64::INFINITY, |b| b.finest());
            part.shape.finest().min(before)
        };
        self.snapshot.parts.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    /// Where the surface is that is nearest to the place.
    fn touch(&self, p: DVec3) -> Touch {
        let Some((part, (phi, gradient))) = self.nearest(p) else {
            return Touch::default();
        };
        let painted = |map: &Arc<TouchMap>| map.at(p - phi * gradient);
        part.painted.as_ref().map_or(part.default, painted)
    }
}

impl Obstacle for Snapshot {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.moving(1.0).distance(p)
    }

    fn finest(&self) -> f64 {
        self.moving(1.0).finest()
    }

    fn touch(&self, p: DVec3) -> Touch {
        self.moving(1.0).touch(p)
    }
}
