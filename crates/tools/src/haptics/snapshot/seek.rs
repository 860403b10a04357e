//! The search for closest places, many at a time.

use bspline::Jet;
use glam::DVec3;

use super::foot::{Foot, creased};
use super::grid::Grid;
use super::hull::Hull;
use super::surface::Surface;

/// Newton steps of a place before it is taken for one at an edge.
const ROUNDS: usize = 8;
/// Step, in node distances, after which a closest place is found: what is left is of the order of its square.
const SETTLED: f64 = 0.05;
/// Halvings of a way between neighbours.
const HALVES: usize = 24;

/// A node on the way to its closest place.
#[derive(Clone, Copy)]
pub struct Seeker {
    pub slot: u32,
    /// A place of the surface, near enough.
    pub start: DVec3,
    pub at: DVec3,
    /// The neighbour on the other side, of nodes beside the surface.
    pub other: Option<DVec3>,
    /// What was looked at so far.
    pub hull: Hull,
}

pub struct Seek<'a> {
    pub surface: &'a Surface<'a>,
    pub grid: &'a Grid,
    pub inside: &'a [bool],
}

impl Seek<'_> {
    fn place(&self, seeker: &Seeker) -> DVec3 {
        self.grid.place(self.grid.node(seeker.slot as usize))
    }

    /// The distance of a node from a place, positive in the air.
    pub fn signed(&self, seeker: &Seeker) -> f32 {
        let far = self.place(seeker).distance(seeker.at);
        (if self.inside[seeker.slot as usize] {
            -far
        } else {
            far
        }) as f32
    }

    /// Leads all to their closest places. `feet` gets what the field is like there, or as near to it as it was asked.
    pub fn all(&self, seekers: &mut [Seeker], mut feet: Option<&mut Vec<Foot>>) {
        let h = self.grid.spacing;
        if let Some(feet) = &mut feet {
            feet.clear();
            feet.extend(seekers.iter().map(|s| Foot::flat(s.start)));
        }
        // No answer may be farther than this: a place of the surface is known that is as near.
        let mut most: Vec<f64> = seekers
            .iter()
            .map(|s| self.place(s).distance(s.start) + SETTLED * h)
            .collect();
        let mut open: Vec<u32> = (0..seekers.len() as u32).collect();
        let (mut places, mut jets): (Vec<DVec3>, Vec<Jet>) = (Vec::new(), Vec::new());
        let (mut left, mut stuck): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
        for round in 0..ROUNDS {
            if open.is_empty() {
                break;
            }
            places.clear();
            places.extend(open.iter().map(|i| seekers[*i as usize].at));
            self.surface.jets(&places, &mut jets);
            left.clear();
            for (i, jet) in open.iter().zip(&jets) {
                let most = &mut most[*i as usize];
                let seeker = &mut seekers[*i as usize];
                let p = self.grid.place(self.grid.node(seeker.slot as usize));
                seeker.hull.add_place(self.grid.spacing, seeker.at);
                let Some(foot) = Foot::new(seeker.at, jet) else {
                    stuck.push(*i);
                    continue;
                };
                if round == 0 && seeker.other.is_some() {
                    // The first place was a guess.
                    *most += foot.depth.abs();
                }
                if let Some(feet) = &mut feet {
                    feet[*i as usize] = foot;
                }
                let next = foot.toward(p, h);
                let step = next.distance(seeker.at);
                seeker.at = next;
                if step > SETTLED * h {
                    left.push(*i);
                } else if p.distance(next) > *most {
                    stuck.push(*i);
                }
            }
            std::mem::swap(&mut open, &mut left);
        }
        stuck.extend(&open);
        for i in stuck {
            let seeker = &mut seekers[i as usize];
            self.at_an_edge(seeker);
            if let Some(feet) = &mut feet {
                self.surface.jets(&[seeker.at], &mut jets);
                seeker.hull.add_place(h, seeker.at);
                feet[i as usize] = Foot::new(seeker.at, &jets[0]).unwrap_or(Foot::flat(seeker.at));
            }
        }
    }

    /// Where Newton finds nothing.
    fn at_an_edge(&self, seeker: &mut Seeker) {
        let (p, is_inside) = (self.place(seeker), self.inside[seeker.slot as usize]);
        let mut start = seeker.start;
        if let Some(other) = seeker.other {
            start = self.between(p, other, is_inside);
            seeker.hull.add_place(self.grid.spacing, start);
            seeker.hull.add_place(self.grid.spacing, other);
        }
        let look = |at: DVec3| seeker.hull.add_place(self.grid.spacing, at);
        seeker.at = creased(self.surface, p, is_inside, start, self.grid.spacing, look);
    }

    /// Where the surface lies between two neighbours, by halves.
    fn between(&self, p: DVec3, other: DVec3, is_inside: bool) -> DVec3 {
        let (mut same, mut beyond) = (0.0, 1.0);
        for _ in 0..HALVES {
            let middle = 0.5 * (same + beyond);
            let value = self.surface.value_gradient(p.lerp(other, middle)).0;
            if (value > 0.0) == is_inside {
                same = middle;
            } else {
                beyond = middle;
            }
        }
        p.lerp(other, beyond)
    }
}
