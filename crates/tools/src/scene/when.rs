use serde::Deserialize;

use crate::number::{NonNegative, Positive};

/// When something acts, in seconds from the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct When {
    /// First moment; 0 if missing.
    pub from: Option<NonNegative>,
    /// Last moment; never ends if missing.
    pub until: Option<Positive>,
    /// How long it takes to reach its full strength, and to lose it before the end.
    pub ramp: Option<NonNegative>,
    /// Length of a cycle in which it is on for the first part.
    pub every: Option<Positive>,
    /// Share of the cycle in which it is on; half of it if missing.
    pub share: Option<Positive>,
}

impl When {
    /// What is wrong with it.
    pub fn check(&self) -> Result<(), String> {
        let (from, until) = self.span();
        if until <= from {
            return Err(format!(
                "it begins at {from} s and ends at {until} s; let it end after it begins"
            ));
        }
        let ramp = self.ramp.map_or(0.0, |r| r.0);
        if 2.0 * ramp > until - from {
            return Err(format!(
                "two ramps of {ramp} s are longer than the {} s that it lasts; shorten ramp",
                until - from
            ));
        }
        match (self.every, self.share) {
            (None, Some(_)) => Err(
                "share is the part of a cycle in which it is on; write the length of the cycle as every"
                    .into(),
            ),
            (Some(_), Some(share)) if share.0 > 1.0 => Err(format!(
                "share is {}; it can be at most 1, the whole cycle",
                share.0
            )),
            _ => Ok(()),
        }
    }

    fn span(&self) -> (f64, f64) {
        (
            self.from.map_or(0.0, |f| f.0),
            self.until.map_or(f64::INFINITY, |u| u.0),
        )
    }

    /// Which share of the time that it acts has passed at `t`, of what never ends up to `end`.
    pub fn share_passed(&self, t: f64, end: f64) -> f64 {
        let (from, until) = self.span();
        ((t - from) / (until.min(end) - from)).clamp(0.0, 1.0)
    }

    /// The first moment after `t` at which it is switched on or off; infinite if there is none.
    pub fn next_change(&self, t: f64) -> f64 {
        let (from, until) = self.span();
        if t < from {
            return from;
        }
        let cycle = self.every.map_or(f64::INFINITY, |every| {
            let begin = from + ((t - from) / every.0).floor() * every.0;
            let off = begin + self.share.map_or(0.5, |s| s.0) * every.0;
            // By rounding t may belong to the cycle before.
            let switches = [off, begin + every.0, off + every.0];
            switches.into_iter().find(|s| *s > t).unwrap_or(f64::INFINITY)
        });
        if until > t {
            cycle.min(until)
        } else {
            f64::INFINITY
        }
    }

    /// Its strength, 0 to 1, over the step that begins at `t` and lasts `dt`: that in the middle.
    pub fn strength(&self, t: f64, dt: f64) -> f64 {
        let t = t + 0.5 * dt;
        let (from, until) = self.span();
        if t < from || t >= until {
            return 0.0;
        }
        if let Some(every) = self.every
            && (t - from).rem_euclid(every.0) >= self.share.map_or(0.5, |s| s.0) * every.0
        {
            return 0.0;
        }
        match self.ramp {
            Some(ramp) if ramp.0 > 0.0 => ((t - from) / ramp.0).min((until - t) / ramp.0).min(1.0),
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_cycles_and_ends() {
        let when = |text: &str| toml::from_str::<When>(text).unwrap();
        let all = when("");
        assert_eq!([all.strength(0.0, 0.1), all.strength(1e6, 0.1)], [1.0, 1.0]);
        let ramp = when("from = 1\nuntil = 3\nramp = 0.5");
        let at = |t: f64| ramp.strength(t - 0.05, 0.1);
        assert_eq!(
            [at(0.9), at(1.25), at(2.0), at(2.75), at(3.0)],
            [0.0, 0.5, 1.0, 0.5, 0.0]
        );
        let cycle = when("from = 1\nevery = 1\nshare = 0.25");
        let at = |t: f64| cycle.strength(t - 0.05, 0.1);
        assert_eq!([at(1.1), at(1.4), at(2.1), at(2.9)], [1.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn switches_come_in_order() {
        let when = toml::from_str::<When>("from = 1\nuntil = 3.2\nevery = 1\nshare = 0.25").unwrap();
        let mut t = 0.0;
        let mut found = Vec::new();
        while t < 10.0 {
            t = when.next_change(t);
            found.push(t);
        }
        assert_eq!(found, [1.0, 1.25, 2.0, 2.25, 3.0, 3.2, f64::INFINITY]);
    }

    #[test]
    fn impossible_times_are_refused() {
        for (text, word) in [
            ("from = 2\nuntil = 1", "after it begins"),
            ("from = 0\nuntil = 1\nramp = 0.6", "ramp"),
            ("share = 0.5", "every"),
            ("every = 1\nshare = 2", "at most 1"),
        ] {
            let e = toml::from_str::<When>(text).unwrap().check().unwrap_err();
            assert!(e.contains(word), "{e}");
        }
    }
}
