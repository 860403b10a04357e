//! Where a body slides whose contacts rub with given strengths.
//!
//! `½|u − d|² + Σ gᵢ ψ(|Tᵢu|)` is least, ψ the length, but for slips below [`SOFT`] its square over twice that \[Huber64\]. Newton's method for the
//! slips and the frictions `sᵢ = −gᵢ tᵢ/|tᵢ|` together, as for sums of lengths in \[Andersen00\]: from `|tᵢ| sᵢ + gᵢ tᵢ = 0` linearised, so that a contact
//! whose friction is not known yet is not taken for one that slides on as it does.

use super::projection::{Twist, add, dot};

/// Slip below which friction is softened, mm.
pub(super) const SOFT: f64 = 1e-6;
/// Steps at most.
const STEPS: usize = 12;
/// Widths of the softening for where steps go round in circles: each over the one before, from one mm on.
const NARROWER: f64 = 0.1;
/// Length of a step that ends them, mm.
const DONE: f64 = 0.01 * SOFT;

/// What a contact does against slipping.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rubs {
    /// Largest friction, mm.
    most: f64,
    /// Slip along each tangent for a twist.
    slips: [Twist; 2],
    /// The parts of these that the contacts leave free.
    yields: [Twist; 2],
    /// The friction, mm: as it is expected, then as it is.
    pub friction: [f64; 2],
    slip: [f64; 2],
    width: f64,
    is_soft: bool,
}

impl Rubs {
    /// Of a largest friction, slips along two tangents, the parts of these that are free, and what the friction is expected to be.
    pub fn new(most: f64, slips: [Twist; 2], yields: [Twist; 2], friction: [f64; 2]) -> Self {
        Self {
            most,
            slips,
            yields,
            friction,
            ..Self::default()
        }
    }

    /// Takes a twist, and adds what follows from it to the matrix and to the way down.
    fn linearise(&mut self, u: &Twist, soft: f64, matrix: &mut [[f64; 6]; 6], down: &mut Twist) {
        self.slip = self.slips.map(|t| dot(&t, u));
        let length = length(self.slip);
        self.width = length.max(soft);
        self.is_soft = length <= soft;
        let stiff = self.most / self.width;
        let [t, s] = [self.direction(), self.friction];
        // (g + ½(s tᵀ + t sᵀ))/w is not negative, since |s| ≤ g.
        let across = 0.5 * (s[0] * t[1] + s[1] * t[0]) / self.width;
        for k in 0..2 {
            add(down, -stiff * self.slip[k], &self.yields[k]);
            add_product(
                matrix,
                stiff + s[k] * t[k] / self.width,
                &self.yields[k],
                &self.yields[k],
            );
            add_product(matrix, across, &self.yields[k], &self.yields[1 - k]);
        }
    }

    /// Of the slip; none where that is softened.
    fn direction(&self) -> [f64; 2] {
        match self.is_soft {
            true => [0.0; 2],
            false => self.slip.map(|t| t / self.width),
        }
    }

    /// Takes a step.
    fn follow(&mut self, way: &Twist) {
        let [t, change] = [self.direction(), self.slips.map(|slip| dot(&slip, way))];
        let grows = t[0] * change[0] + t[1] * change[1];
        for k in 0..2 {
            let moved = self.most * (self.slip[k] + change[k]);
            self.friction[k] = -(moved + self.friction[k] * grows) / self.width;
        }
        self.confine();
    }

    /// The friction nearest to this one that there may be.
    fn confine(&mut self) {
        let size = length(self.friction);
        if size > self.most {
            self.friction = self.friction.map(|s| s * (self.most / size));
        }
    }
}

/// Finds the frictions of contacts when the body would go to `free` without them. Whether that is done to [`DONE`].
pub(super) fn slide(free: &Twist, rubs: &mut [Rubs]) -> bool {
    if settle(free, rubs, SOFT) {
        return true;
    }
    let mut soft = 1.0;
    while soft > SOFT {
        settle(free, rubs, soft);
        soft = (NARROWER * soft).max(SOFT);
    }
    settle(free, rubs, SOFT)
}

/// The same from what the frictions are, softened below a width.
fn settle(free: &Twist, rubs: &mut [Rubs], soft: f64) -> bool {
    rubs.iter_mut().for_each(Rubs::confine);
    let mut u = held(free, rubs);
    for _ in 0..STEPS {
        let mut matrix = [[0.0; 6]; 6];
        for (k, row) in matrix.iter_mut().enumerate() {
            row[k] = 1.0;
        }
        let mut way: Twist = std::array::from_fn(|k| free[k] - u[k]);
        for rub in rubs.iter_mut() {
            rub.linearise(&u, soft, &mut matrix, &mut way);
        }
        solve(&mut matrix, &mut way);
        for rub in rubs.iter_mut() {
            rub.follow(&way);
        }
        add(&mut u, 1.0, &way);
        // What the frictions themselves come to.
        let mut off = held(free, rubs);
        add(&mut off, -1.0, &u);
        if dot(&way, &way) < DONE * DONE && dot(&off, &off) < DONE * DONE {
            return true;
        }
    }
    false
}

/// Where the body goes with frictions.
fn held(free: &Twist, rubs: &[Rubs]) -> Twist {
    let mut u = *free;
    for rub in rubs {
        for (yields, friction) in rub.yields.iter().zip(rub.friction) {
            add(&mut u, friction, yields);
        }
    }
    u
}

fn length(t: [f64; 2]) -> f64 {
    (t[0] * t[0] + t[1] * t[1]).sqrt()
}

/// To the lower half of a matrix.
fn add_product(matrix: &mut [[f64; 6]; 6], share: f64, a: &Twist, b: &Twist) {
    for i in 0..6 {
        for j in 0..=i {
            matrix[i][j] += share * a[i] * b[j];
        }
    }
}

/// By the factors of Cholesky; the matrix is the identity and what is not negative.
fn solve(matrix: &mut [[f64; 6]; 6], x: &mut Twist) {
    for j in 0..6 {
        for k in 0..j {
            let part = matrix[j][k];
            for i in j..6 {
                matrix[i][j] -= part * matrix[i][k];
            }
        }
        let root = matrix[j][j].max(0.5).sqrt();
        for i in j..6 {
            matrix[i][j] /= root;
        }
        matrix[j][j] = root;
        for k in 0..j {
            x[j] -= matrix[j][k] * x[k];
        }
        x[j] /= root;
    }
    for j in (0..6).rev() {
        for i in j + 1..6 {
            x[j] -= matrix[i][j] * x[i];
        }
        x[j] /= matrix[j][j];
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::places::row;
    use super::super::projection::Polyhedron;
    use super::super::random::Random;
    use super::*;

    fn vector(random: &mut Random) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| 2.0 * random.share() - 1.0))
    }

    /// Contacts of a tool that is pressed on a plane or on all sides, and a twist that it would go without friction.
    fn contacts(random: &mut Random) -> (Twist, Vec<Rubs>) {
        let count = 1 + (random.share() * 6.0) as usize;
        let flat = random.share() < 0.6;
        let mut rows = Polyhedron::with_capacity(6);
        let lever = 63.0;
        let high = 16.0 * random.share();
        let places: Vec<_> = (0..count)
            .map(|_| {
                let place = 12.0 * vector(random) * DVec3::new(1.0, 1.0, 0.0) - high * DVec3::Z;
                let lean = if flat { DVec3::ZERO } else { vector(random) };
                (place, (lean + DVec3::Z).normalize_or(DVec3::Z))
            })
            .collect();
        for (n, (place, normal)) in places.iter().enumerate() {
            rows.push(row(*normal, *place, lever), 0.0);
            rows.expect(n);
        }
        let strength = [0.01, 0.3, 1.0, 3.0][(random.share() * 4.0) as usize];
        let rubs = places.iter().map(|(place, normal)| {
            let (a, b) = normal.any_orthonormal_pair();
            let slips = [a, b].map(|t| row(t, *place, lever));
            let most = strength * random.share().powi(2);
            Rubs::new(most, slips, slips.map(|t| rows.across(&t)), [0.0; 2])
        });
        let rubs: Vec<_> = rubs.collect();
        let size = [1e-3, 0.05, 1.0, 3.0][(random.share() * 4.0) as usize];
        let free: Twist = std::array::from_fn(|_| size * (2.0 * random.share() - 1.0));
        (rows.across(&free), rubs)
    }

    /// Frictions are within their strengths and balance; what slips is held back with all of it, and what has less does not slip.
    #[test]
    fn frictions_meet_their_conditions() {
        let mut random = Random::new(3);
        let (mut stick, mut slip, mut open) = (0, 0, 0);
        for _ in 0..5000 {
            let (free, mut rubs) = contacts(&mut random);
            if !slide(&free, &mut rubs) {
                open += 1;
                continue;
            }
            let u = held(&free, &rubs);
            for rub in &rubs {
                let t = rub.slips.map(|t| dot(&t, &u));
                let size = length(rub.friction);
                assert!(size <= rub.most * (1.0 + 1e-12));
                if length(t) < 2.0 * SOFT {
                    stick += 1;
                    continue;
                }
                slip += 1;
                let against = -(t[0] * rub.friction[0] + t[1] * rub.friction[1]) / length(t);
                assert!(
                    (against - rub.most).abs() < 1e-2 * rub.most,
                    "{against} {}",
                    rub.most
                );
            }
        }
        println!("{stick} stick, {slip} slip, {open} of 5000 open");
        assert!(stick > 1000 && slip > 1000, "{stick} {slip}");
        assert_eq!(open, 0);
    }
}
