use glam::DVec3;

/// The generator SplitMix64 \[Steele14\]: 64 bits of state, every seed as good as another, the
/// same numbers on every machine.
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// Starts the sequence of `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `[0, 1)`, with 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in the cube `[0, 1)³`.
    pub fn uniform3(&mut self) -> DVec3 {
        let x = self.uniform();
        let y = self.uniform();
        let z = self.uniform();
        DVec3::new(x, y, z)
    }

    /// Three independent standard normals, by Marsaglia's polar method: multiplications, one logarithm and one
    /// root a pair.
    pub fn normal3(&mut self) -> DVec3 {
        let (x, y) = self.normal_pair();
        let (z, _) = self.normal_pair();
        DVec3::new(x, y, z)
    }

    /// A standard normal.
    pub fn normal(&mut self) -> f64 {
        self.normal_pair().0
    }

    fn normal_pair(&mut self) -> (f64, f64) {
        loop {
            let u = 2.0 * self.uniform() - 1.0;
            let v = 2.0 * self.uniform() - 1.0;
            let s = u * u + v * v;
            if s > 0.0 && s < 1.0 {
                let scale = (-2.0 * s.ln() / s).sqrt();
                return (u * scale, v * scale);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_that_of_the_paper() {
        let mut r = SplitMix64::new(1234567);
        // Reference values of the authors' C program for this seed.
        assert_eq!(r.next_u64(), 6457827717110365317);
        assert_eq!(r.next_u64(), 3203168211198807973);
        assert_eq!(r.next_u64(), 9817491932198370423);
    }

    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut r = SplitMix64::new(7);
        let n = 100_000;
        let (mut mean, mut square, mut uniform) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for _ in 0..n {
            let x = r.normal3();
            mean += x;
            square += x * x;
            uniform += r.uniform3();
        }
        // Four standard errors: 1/√n, √2/√n and 1/√(12n).
        let root = (n as f64).sqrt();
        assert!((mean / n as f64).abs().max_element() < 4.0 / root);
        assert!((square / n as f64 - DVec3::ONE).abs().max_element() < 4.0 * 2f64.sqrt() / root);
        assert!((uniform / n as f64 - DVec3::splat(0.5)).abs().max_element() < 4.0 / (12f64.sqrt() * root));
    }
}
