//! The nearest point of a polyhedron in six dimensions, by the dual active set method \[Goldfarb83\].

/// A displacement of a tool: a way, mm, and a turn times the lever of its coupling, mm.
pub(super) type Twist = [f64; 6];

/// Rows closer to the span of the active ones than this share of their square are no rows of their own.
const DEPENDENT: f64 = 1e-10;
/// Least violation that is mended, mm.
const EXACT: f64 = 1e-9;
/// Exchanges of the active set at most. Tools on random solids need 3 to 15.
const EXCHANGES: usize = 64;

pub(super) fn dot(a: &Twist, b: &Twist) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}

pub(super) fn add(a: &mut Twist, share: f64, b: &Twist) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += share * b;
    }
}

/// `min |u − d|²` so that `aᵢ·u ≥ bᵢ`: the rows, and room for the solution.
#[derive(Clone, Debug)]
pub(super) struct Polyhedron {
    rows: Vec<(Twist, f64)>,
    active: [usize; 6],
    /// Of the active rows, 0 or above.
    multipliers: [f64; 6],
    count: usize,
    /// Orthonormal basis of the active rows, and their triangle in it.
    q: [Twist; 6],
    r: [Twist; 6],
}

impl Polyhedron {
    /// All of space, with room for a number of rows.
    pub fn with_capacity(rows: usize) -> Self {
        Self {
            rows: Vec::with_capacity(rows),
            active: [0; 6],
            multipliers: [0.0; 6],
            count: 0,
            q: [[0.0; 6]; 6],
            r: [[0.0; 6]; 6],
        }
    }

    pub fn clear(&mut self) {
        self.rows.clear();
        self.count = 0;
    }

    /// Adds `a·u ≥ b`. Whether there was room.
    pub fn push(&mut self, a: Twist, b: f64) -> bool {
        let room = self.rows.len() < self.rows.capacity();
        if room {
            self.rows.push((a, b));
        }
        room
    }

    /// Whether the origin violates a row by more than a length.
    pub fn lacks(&self, most: f64) -> bool {
        self.rows.iter().any(|(_, b)| *b > most)
    }

    /// Asks of no row more than the origin gives.
    pub fn relax(&mut self) {
        for (_, b) in &mut self.rows {
            *b = b.min(0.0);
        }
    }

    /// The point nearest to `d`; nothing if the polyhedron is empty.
    #[cfg(test)]
    pub fn nearest(&mut self, d: &Twist) -> Option<Twist> {
        self.count = 0;
        self.go_on(*d)
    }

    /// The point nearest to `d`; nothing if the polyhedron is empty. It is looked for from the rows that were active last, or are expected to
    /// be: it is the same from any, but where many sets of rows say the same, those stay.
    pub fn nearest_again(&mut self, d: &Twist) -> Option<Twist> {
        let mut u = *d;
        while self.count > 0 {
            self.multipliers = self.multipliers_of(d);
            let pulling =
                (0..self.count).min_by(|a, b| self.multipliers[*a].total_cmp(&self.multipliers[*b]));
            match pulling.filter(|j| self.multipliers[*j] < 0.0) {
                Some(j) => self.leave(j),
                None => break,
            }
        }
        for (row, multiplier) in self.active() {
            add(&mut u, multiplier, &self.rows[row].0);
        }
        self.go_on(u)
    }

    /// Begins with a row that is likely to be active; it is left out if the others say as much.
    pub fn expect(&mut self, row: usize) {
        if self.count == 6 || self.active[..self.count].contains(&row) {
            return;
        }
        self.enter(row, 0.0);
        let (j, a) = (self.count - 1, &self.rows[row].0);
        if self.r[j][j] * self.r[j][j] <= DEPENDENT * dot(a, a) {
            self.count = j;
        }
    }

    /// Multipliers by which all active rows hold exactly.
    fn multipliers_of(&self, d: &Twist) -> [f64; 6] {
        let mut y = [0.0; 6];
        for j in 0..self.count {
            let (a, b) = &self.rows[self.active[j]];
            let known: f64 = (0..j).map(|k| self.r[k][j] * y[k]).sum();
            y[j] = (b - dot(a, d) - known) / self.r[j][j];
        }
        for j in (0..self.count).rev() {
            let known: f64 = (j + 1..self.count).map(|k| self.r[j][k] * y[k]).sum();
            y[j] = (y[j] - known) / self.r[j][j];
        }
        y
    }

    /// From the point nearest to `d` by the active rows alone to that by all.
    fn go_on(&mut self, mut u: Twist) -> Option<Twist> {
        for _ in 0..EXCHANGES {
            let Some(entering) = self.most_violated(&u) else {
                return Some(u);
            };
            let mut multiplier = 0.0;
            loop {
                let (a, b) = self.rows[entering];
                let (z, shares) = self.split(&a);
                let (zz, aa) = (dot(&z, &z), dot(&a, &a));
                let dependent = self.count == 6 || zz <= DEPENDENT * aa;
                let full = if dependent {
                    f64::INFINITY
                } else {
                    (b - dot(&a, &u)) / zz
                };
                // The first active row that would have to pull.
                let mut most = f64::INFINITY;
                let mut leaving = 0;
                for j in 0..self.count {
                    if shares[j] > 1e-12 && self.multipliers[j] / shares[j] < most {
                        (most, leaving) = (self.multipliers[j] / shares[j], j);
                    }
                }
                let step = full.min(most);
                if step == f64::INFINITY {
                    self.count = 0;
                    return None;
                }
                if !dependent {
                    add(&mut u, step, &z);
                }
                for j in 0..self.count {
                    self.multipliers[j] -= step * shares[j];
                }
                multiplier += step;
                if full <= most {
                    self.enter(entering, multiplier);
                    break;
                }
                self.leave(leaving);
            }
        }
        // Rows that agree to rounding can take turns for ever: the last point violates them by that much.
        self.most_violated(&u)
            .is_none_or(|i| self.rows[i].1 - dot(&self.rows[i].0, &u) < 1e-6)
            .then_some(u)
    }

    fn most_violated(&self, u: &Twist) -> Option<usize> {
        let mut worst = (EXACT, None);
        for (i, (a, b)) in self.rows.iter().enumerate() {
            let lack = b - dot(a, u);
            if lack > worst.0 && !self.active[..self.count].contains(&i) {
                worst = (lack, Some(i));
            }
        }
        worst.1
    }

    /// The rows that press, and their multipliers, by which `u = d + Σ λa`.
    pub fn active(&self) -> impl Iterator<Item = (usize, f64)> {
        let rows = self.active[..self.count].iter().copied();
        rows.zip(self.multipliers[..self.count].iter().copied())
    }

    /// Part of a vector across all active rows.
    pub fn across(&self, a: &Twist) -> Twist {
        let mut across = *a;
        for q in &self.q[..self.count] {
            let part = dot(q, &across);
            add(&mut across, -part, q);
        }
        across
    }

    /// Share of a vector up to where it first violates a row; 1 if it violates none.
    pub fn meets(&self, u: &Twist) -> f64 {
        let violated = self.rows.iter().map(|(a, b)| (dot(a, u), *b));
        let violated = violated.filter(|(along, b)| along < b && *along < 0.0);
        violated.fold(1.0, |share, (along, b)| share.min((b / along).max(0.0)))
    }

    /// Part of a row across all active ones, and the shares of these in it.
    fn split(&self, a: &Twist) -> (Twist, Twist) {
        let (mut z, mut h) = (*a, [0.0; 6]);
        for _ in 0..2 {
            for j in 0..self.count {
                let part = dot(&self.q[j], &z);
                h[j] += part;
                add(&mut z, -part, &self.q[j]);
            }
        }
        for j in (0..self.count).rev() {
            for k in j + 1..self.count {
                h[j] -= self.r[j][k] * h[k];
            }
            h[j] /= self.r[j][j];
        }
        (z, h)
    }

    fn enter(&mut self, row: usize, multiplier: f64) {
        let j = self.count;
        self.active[j] = row;
        self.multipliers[j] = multiplier;
        self.count += 1;
        self.factor(j);
    }

    fn leave(&mut self, place: usize) {
        self.count -= 1;
        for j in place..self.count {
            self.active[j] = self.active[j + 1];
            self.multipliers[j] = self.multipliers[j + 1];
        }
        for j in place..self.count {
            self.factor(j);
        }
    }

    /// Gram and Schmidt, twice, for the active row at a place; those before it stand.
    fn factor(&mut self, j: usize) {
        let mut v = self.rows[self.active[j]].0;
        for i in 0..6 {
            self.r[i][j] = 0.0;
        }
        for _ in 0..2 {
            for i in 0..j {
                let part = dot(&self.q[i], &v);
                self.r[i][j] += part;
                add(&mut v, -part, &self.q[i]);
            }
        }
        let length = dot(&v, &v).sqrt();
        self.r[j][j] = length;
        self.q[j] = v.map(|v| v / length);
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::Random;
    use super::*;

    fn twist(random: &mut Random) -> Twist {
        std::array::from_fn(|_| 2.0 * random.share() - 1.0)
    }

    /// Conditions of optimality: no row is violated, and what is left of `d − u` is a sum of pushing rows.
    #[test]
    fn nearest_points_meet_the_conditions_of_optimality() {
        let mut random = Random::new(7);
        let mut busy = 0;
        for _ in 0..2000 {
            let mut p = Polyhedron::with_capacity(90);
            let inside = twist(&mut random);
            for _ in 0..1 + (random.share() * 80.0) as usize {
                let a = twist(&mut random);
                p.push(a, dot(&a, &inside) - 0.2 * random.share());
            }
            // Rows that say the same twice, and nearly the same.
            for k in 0..p.rows.len().min(4) {
                let (mut a, b) = p.rows[k];
                p.push(a, b);
                a[k] += 1e-7;
                p.push(a, b);
            }
            let d = twist(&mut random).map(|x| 5.0 * x);
            let u = p.nearest(&d).expect("a point inside is known");
            let mut rest: Twist = std::array::from_fn(|k| d[k] - u[k]);
            for j in 0..p.count {
                assert!(p.multipliers[j] >= -1e-12);
                add(&mut rest, p.multipliers[j], &p.rows[p.active[j]].0);
            }
            // Rows that differ by 1e-7 change places as if they were one: multipliers here are up to some 10.
            assert!(dot(&rest, &rest).sqrt() < 5e-6, "{rest:?}");
            assert!(p.rows.iter().all(|(a, b)| dot(a, &u) >= b - 1e-6));
            busy += usize::from(p.count >= 3);
        }
        assert!(busy > 1000, "{busy}");
    }

    /// The solution does not depend on where it was begun, and goes on from one that is near.
    #[test]
    fn nearest_points_are_the_same_from_other_active_rows() {
        let mut random = Random::new(11);
        for _ in 0..500 {
            let mut p = Polyhedron::with_capacity(40);
            for _ in 0..40 {
                let a = twist(&mut random);
                p.push(a, -0.2 * random.share());
            }
            let mut d = twist(&mut random).map(|x| 3.0 * x);
            p.nearest(&d).expect("the origin is inside");
            for _ in 0..5 {
                let other = twist(&mut random);
                add(&mut d, 0.7, &other);
                let again = p.nearest_again(&d).expect("the origin is inside");
                let fresh = p.clone().nearest(&d).expect("the origin is inside");
                assert!(
                    (0..6).all(|k| (again[k] - fresh[k]).abs() < 1e-7),
                    "{again:?} {fresh:?}"
                );
            }
        }
    }

    #[test]
    fn an_empty_polyhedron_is_told() {
        let mut p = Polyhedron::with_capacity(4);
        p.push([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0);
        p.push([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0);
        assert_eq!(p.nearest(&[0.0; 6]), None);
    }
}
