//! Probing: what is inside a solid, felt as a drag that grows with the stiffness of what is near.

use bspline::{Aabb, Field};
use glam::{DAffine3, DVec3};

use crate::paint::{Layers, Substance};

/// Nodes of a map in a radius of the probe.
const NODES: f64 = 4.0;

/// How a probe feels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeOptions {
    /// Springs within this radius count, the less the farther away, mm.
    pub radius: f64,
    /// Damping in unpainted matter, N s/m.
    pub damping: f64,
    /// Largest damping, N s/m. A device that has damping `b` of its own stays passive at a period `T` and an age `d` of its velocity for less
    /// than some `b + m/(T + d)`.
    pub most: f64,
    /// Largest force, N.
    pub force: f64,
    /// Time constant of the velocity and of the damping, s.
    pub smoothing: f64,
}

impl ProbeOptions {
    /// Of a probe of a radius: 2 N s/m in unpainted matter, 20 N s/m and 2 N at most.
    pub fn of_radius(radius: f64) -> Self {
        Self {
            radius,
            damping: 2.0,
            most: 20.0,
            force: 2.0,
            smoothing: 5e-3,
        }
    }
}

/// Stiffness of the springs round a probe: an immutable value, made by the simulation. Without springs, in the air, it is 0.
#[derive(Clone, Debug)]
pub struct MatterMap {
    first: [i64; 3],
    count: [usize; 3],
    /// Distance of nodes, mm.
    spacing: f64,
    radius: f64,
    stiffness: Vec<f32>,
}

impl MatterMap {
    /// Of an object with the surface `{f = c}`, where it stands, for a probe that is within `reach` of `at`, mm: the painted factor on the stiffness of
    /// its springs.
    pub fn new(
        (field, iso): (&dyn Field, f64),
        world_from_object: &DAffine3,
        layers: &Layers,
        options: &ProbeOptions,
        at: DVec3,
        reach: f64,
    ) -> Self {
        let spacing = options.radius / NODES;
        let b = Aabb::new(at, at).widened(reach + options.radius);
        let first = (b.min / spacing).floor().to_array().map(|v| v as i64);
        let last = (b.max / spacing).ceil().to_array().map(|v| v as i64);
        let count: [usize; 3] = std::array::from_fn(|a| (last[a] - first[a]) as usize + 1);
        let back = world_from_object.inverse();
        let mut places = Vec::with_capacity(count.iter().product());
        for x in 0..count[0] as i64 {
            for y in 0..count[1] as i64 {
                for z in 0..count[2] as i64 {
                    let node = DVec3::new(
                        (first[0] + x) as f64,
                        (first[1] + y) as f64,
                        (first[2] + z) as f64,
                    );
                    places.push(back.transform_point3(node * spacing));
                }
            }
        }
        let painted = layers
            .get(&Substance::Stiffness)
            .map(|layer| layer.values(&places));
        let unpainted = Substance::Stiffness.unpainted();
        let number = |(n, p): (usize, &DVec3)| match field.value(*p) > iso {
            true => (unpainted + painted.as_ref().map_or(0.0, |all| all[n])) as f32,
            false => 0.0,
        };
        Self {
            first,
            count,
            spacing,
            radius: options.radius,
            stiffness: places.iter().enumerate().map(number).collect(),
        }
    }

    /// What a probe at a place reads, also at rest: the mean stiffness, 1 in unpainted matter, of the springs within its radius, the weight of each
    /// falling linearly with its distance \[Hua04 §6.1\]. What lies beyond the map counts as air.
    pub fn reading(&self, p: DVec3) -> f64 {
        let (h, r) = (self.spacing, self.radius);
        let q = p / h;
        let range = |a: usize| {
            let lo = ((q[a] - r / h).ceil() - self.first[a] as f64).max(0.0);
            let hi = ((q[a] + r / h).floor() - self.first[a] as f64).min((self.count[a] - 1) as f64);
            // Nothing if the one is above the other.
            (lo as usize)..((hi + 1.0).max(0.0) as usize)
        };
        let (mut sum, mut weights) = (0.0, 0.0);
        for x in range(0) {
            for y in range(1) {
                let row = (x * self.count[1] + y) * self.count[2];
                for z in range(2) {
                    let number = |n: usize, a: usize| (n as i64 + self.first[a]) as f64;
                    let node = DVec3::new(number(x, 0), number(y, 1), number(z, 2)) * h;
                    let weight = (1.0 - node.distance(p) / r).max(0.0);
                    sum += weight * f64::from(self.stiffness[row + z]);
                    weights += weight;
                }
            }
        }
        // Of a whole ball of nodes: where the map ends there is less.
        let whole = std::f64::consts::FRAC_PI_3 * (r / h).powi(3);
        sum / f64::max(weights, 0.5 * whole)
    }
}

/// What a probe tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed {
    /// Force on the hand, N.
    pub force: DVec3,
    /// Mean stiffness near, 1 in unpainted matter, 0 in the air.
    pub reading: f64,
}

/// A probe in a hand: `F = −b v`, `b` from the stiffness of what is near \[Hua04 §6.1, "viscous-like"\], bounded.
#[derive(Clone, Debug)]
pub struct Probe {
    options: ProbeOptions,
    last: Option<DVec3>,
    velocity: DVec3,
    /// N s/m.
    damping: f64,
}

impl Probe {
    /// At rest.
    pub fn new(options: ProbeOptions) -> Self {
        Self {
            options,
            last: None,
            velocity: DVec3::ZERO,
            damping: 0.0,
        }
    }

    /// A tick of `dt` seconds with the hand at a place, mm. Its velocity is that of the way since the last tick, smoothed, and so is the damping: what a
    /// new map says comes without a step.
    pub fn tick(&mut self, matter: &MatterMap, hand: DVec3, dt: f64) -> Probed {
        let reading = matter.reading(hand);
        if let Some(last) = self.last.replace(hand)
            && dt > 0.0
        {
            // Metres per second; a first-order filter, implicit.
            let now = (hand - last) * (1e-3 / dt);
            let share = dt / (self.options.smoothing + dt);
            self.velocity += (now - self.velocity) * share;
            let damping = (self.options.damping * reading).min(self.options.most);
            self.damping += (damping - self.damping) * share;
        }
        let force = -self.damping * self.velocity;
        Probed {
            force: force.clamp_length_max(self.options.force),
            reading,
        }
    }

    /// Forgets the way so far.
    pub fn reset(&mut self) {
        self.last = None;
        self.velocity = DVec3::ZERO;
        self.damping = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use bspline::HierarchicalSpline;
    use bspline::hierarchical::Lattice;

    use super::*;
    use crate::paint::{Layer, LayerError};

    const STIFF: DVec3 = DVec3::new(2.0, 1.0, -1.5);
    const RADIUS: f64 = 3.0;

    /// A ball of 10 mm with a stiff ball of 3 mm buried in it.
    fn map(at: DVec3, reach: f64, options: &ProbeOptions) -> MatterMap {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(DVec3::splat(-12.0)),
            cells: [24; 3],
        };
        let ball: HierarchicalSpline<f32> =
            HierarchicalSpline::schoenberg(lattice, 1.0, |p| 10.0 - p.length()).unwrap();
        let layer = Layer::empty(&lattice, 1);
        let whole = lattice.world_box();
        let layer = layer.painted(&whole, |p, _| {
            Ok::<_, LayerError>((p.distance(STIFF) < RADIUS).then_some(9.0))
        });
        let layers = Layers::from([(Substance::Stiffness, layer.unwrap())]);
        MatterMap::new((&ball, 0.0), &DAffine3::IDENTITY, &layers, options, at, reach)
    }

    /// From readings at rest alone, on a grid of places, a buried ball is found: where it is and how large, within a tenth of its radius.
    #[test]
    fn a_buried_ball_is_found_by_readings_alone() {
        let options = ProbeOptions::of_radius(1.0);
        let map = map(DVec3::ZERO, 9.0, &options);
        let step = 0.5;
        let mut readings = Vec::new();
        for x in -14..=14 {
            for y in -14..=14 {
                for z in -14..=14 {
                    let p = DVec3::new(x.into(), y.into(), z.into()) * step;
                    readings.push((p, map.reading(p)));
                }
            }
        }
        let most = readings.iter().map(|r| r.1).fold(0.0, f64::max);
        // Unpainted matter reads 1.
        let half = 0.5 * (1.0 + most);
        let stiff: Vec<DVec3> = readings.iter().filter(|r| r.1 > half).map(|r| r.0).collect();
        let center = stiff.iter().sum::<DVec3>() / stiff.len() as f64;
        let radius = (stiff.len() as f64 * step.powi(3) * 3.0 / (4.0 * std::f64::consts::PI)).cbrt();
        println!("found at {center}, radius {radius}, most {most}");
        assert!(center.distance(STIFF) < 0.1 * RADIUS, "{center}");
        assert!((radius - RADIUS).abs() < 0.1 * RADIUS, "{radius}");
        assert!((most - 10.0).abs() < 0.1, "{most}");
        // Nothing is read in the air.
        assert_eq!(map.reading(DVec3::new(9.0, 9.0, 9.0)), 0.0);
    }

    /// Moved through the solid the hand is dragged by what the reading says, never pushed on, and never more than allowed.
    #[test]
    fn the_drag_follows_the_reading_and_takes_energy_only() {
        let options = ProbeOptions::of_radius(1.0);
        let map = map(DVec3::ZERO, 12.0, &options);
        let mut probe = Probe::new(options);
        let (dt, speed) = (1e-3, 0.08);
        let (mut taken, mut last, mut jump): (f64, Option<DVec3>, f64) = (0.0, None, 0.0);
        let mut peak = (0.0, 0.0);
        for n in 0..250 {
            let x = -10.0 + 1e3 * speed * dt * f64::from(n);
            let told = probe.tick(&map, DVec3::new(x, STIFF.y, STIFF.z), dt);
            taken -= told.force.x * speed * dt;
            assert!(told.force.length() <= options.force && told.force.x <= 0.0);
            if let Some(last) = last {
                jump = jump.max((told.force - last).length());
            }
            last = Some(told.force);
            if told.reading > peak.1 {
                peak = (told.force.x, told.reading);
            }
        }
        println!("taken {taken} J, largest step {jump} N, peak {peak:?}");
        let expected = (options.damping * peak.1).min(options.most) * speed;
        assert!((-peak.0 / expected - 1.0).abs() < 0.05, "{peak:?} for {expected}");
        assert!(taken > 1e-3 && jump < 0.1);
    }
}
