//! A rank among numbers that are seen twice and never held.

/// The number of some rank among more than can be held, none of them negative: by the upper halves of all, then by the lower
/// halves of those that share its upper one. The bits of such floats are in their order.
pub struct Rank {
    counts: Vec<u64>,
    upper: Option<u32>,
    left: u64,
}

impl Rank {
    /// Nothing is seen yet.
    pub fn new() -> Self {
        Self {
            counts: vec![0; 1 << 16],
            upper: None,
            left: 0,
        }
    }

    /// Takes a number for the first time.
    pub fn see(&mut self, value: f32) {
        self.counts[(value.to_bits() >> 16) as usize] += 1;
    }

    /// Says which rank it is, counted from 0, once all have been seen.
    pub fn settle(&mut self, rank: usize) {
        self.left = rank as u64;
        self.upper = self.bin();
        self.counts.fill(0);
    }

    /// The bin that the rank is in; what is left of the rank there.
    fn bin(&mut self) -> Option<u32> {
        for (bin, count) in self.counts.iter().enumerate() {
            if self.left < *count {
                return Some(bin as u32);
            }
            self.left -= count;
        }
        None
    }

    /// Takes a number for the second time.
    pub fn look_closer(&mut self, value: f32) {
        if self.upper == Some(value.to_bits() >> 16) {
            self.counts[(value.to_bits() & 0xffff) as usize] += 1;
        }
    }

    /// The number; 0 if there is none of that rank.
    pub fn value(&mut self) -> f64 {
        let bits = self.upper.zip(self.bin());
        bits.map_or(0.0, |(upper, lower)| {
            f64::from(f32::from_bits(upper << 16 | lower))
        })
    }
}
