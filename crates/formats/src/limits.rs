use crate::Fault;

/// Ceiling on what one reading may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Bytes held at once: the inflated file where it is kept whole, plus what is built from it. Default 4 GiB.
    pub max_bytes: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self { max_bytes: 4 << 30 }
    }
}

/// Running account against [`ReadLimits`].
#[derive(Debug)]
pub(crate) struct Budget {
    limit: u64,
    used: u64,
}

impl Budget {
    pub fn new(limits: &ReadLimits) -> Self {
        Self {
            limit: limits.max_bytes,
            used: 0,
        }
    }

    /// Books `count` items of `size` bytes before they are allocated.
    pub fn reserve(&mut self, what: &'static str, count: u64, size: usize) -> Result<(), Fault> {
        let needed = self.used.saturating_add(count.saturating_mul(size as u64));
        if needed > self.limit {
            return Err(Fault::Limit {
                what,
                needed,
                limit: self.limit,
            });
        }
        self.used = needed;
        Ok(())
    }

    /// Bytes booked.
    pub fn used(&self) -> u64 {
        self.used
    }

    /// The ceiling.
    pub fn limit(&self) -> u64 {
        self.limit
    }

    /// Bytes still free.
    pub fn left(&self) -> u64 {
        self.limit - self.used
    }
}

/// A vector that books its growth: for text, whose length says little about what it holds.
#[derive(Debug)]
pub(crate) struct Counted<T> {
    pub items: Vec<T>,
    what: &'static str,
}

impl<T> Counted<T> {
    pub fn new(what: &'static str) -> Self {
        Self {
            items: Vec::new(),
            what,
        }
    }

    pub fn push(&mut self, item: T, budget: &mut Budget) -> Result<(), Fault> {
        if self.items.len() == self.items.capacity() {
            // Growing by doubling holds old and new at once for a moment: three times the old in all.
            let grow = self.items.len().max(256);
            budget.reserve(self.what, grow as u64, size_of::<T>())?;
            self.items.reserve_exact(grow);
        }
        self.items.push(item);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_account_stops_at_the_limit_and_not_before() {
        let mut b = Budget::new(&ReadLimits { max_bytes: 100 });
        b.reserve("a", 10, 8).unwrap();
        assert_eq!(b.left(), 20);
        b.reserve("b", 20, 1).unwrap();
        assert!(matches!(
            b.reserve("c", 1, 1),
            Err(Fault::Limit {
                needed: 101,
                limit: 100,
                ..
            })
        ));
        assert!(b.reserve("c", u64::MAX, 8).is_err());
    }

    #[test]
    fn a_counted_vector_cannot_outgrow_its_budget() {
        let mut b = Budget::new(&ReadLimits { max_bytes: 8 * 1000 });
        let mut v = Counted::new("points");
        let pushed = (0..10_000)
            .take_while(|i| v.push(*i as u64, &mut b).is_ok())
            .count();
        assert_eq!(pushed, 512);
        assert!(v.items.capacity() * 8 <= 8000);
    }
}
