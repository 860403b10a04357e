//! Where a hand wants to be.

use std::f64::consts::TAU;

use glam::DVec3;

/// Places at times.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    places: Vec<(f64, DVec3)>,
    is_smooth: bool,
    dither: Option<(DVec3, f64)>,
}

impl Path {
    /// From place to place, at rest in each, by the way of least jerk \[Flash85 eq. 3\]. Times, s, must rise; before the first and after the last
    /// it stays there.
    ///
    /// # Panics
    /// Without places, or if times fall.
    pub fn smooth(places: impl IntoIterator<Item = (f64, DVec3)>) -> Self {
        Self::of(places, true)
    }

    /// From place to place at constant speed.
    ///
    /// # Panics
    /// As [`Path::smooth`].
    pub fn straight(places: impl IntoIterator<Item = (f64, DVec3)>) -> Self {
        Self::of(places, false)
    }

    /// One place for ever.
    pub fn still(at: DVec3) -> Self {
        Self::of([(0.0, at)], false)
    }

    fn of(places: impl IntoIterator<Item = (f64, DVec3)>, is_smooth: bool) -> Self {
        let places: Vec<_> = places.into_iter().collect();
        assert!(!places.is_empty(), "a path needs a place");
        assert!(
            places.windows(2).all(|w| w[0].0 < w[1].0),
            "the times of a path must rise"
        );
        Self {
            places,
            is_smooth,
            dither: None,
        }
    }

    /// Trembling besides: a sine of an amplitude, mm, and a frequency, Hz.
    #[must_use]
    pub fn trembling(mut self, amplitude: DVec3, frequency: f64) -> Self {
        self.dither = Some((amplitude, frequency));
        self
    }

    /// Place, mm, and speed, mm/s, at a time.
    pub fn at(&self, time: f64) -> (DVec3, DVec3) {
        let (mut at, mut speed) = self.steady(time);
        if let Some((amplitude, frequency)) = self.dither {
            let (sine, cosine) = libm::sincos(TAU * frequency * time);
            at += amplitude * sine;
            speed += amplitude * (TAU * frequency * cosine);
        }
        (at, speed)
    }

    fn steady(&self, time: f64) -> (DVec3, DVec3) {
        let next = self.places.partition_point(|p| p.0 <= time);
        if next == 0 {
            return (self.places[0].1, DVec3::ZERO);
        }
        let (t0, p0) = self.places[next - 1];
        let Some(&(t1, p1)) = self.places.get(next) else {
            return (p0, DVec3::ZERO);
        };
        let (way, s) = (p1 - p0, (time - t0) / (t1 - t0));
        let (share, rate) = if self.is_smooth {
            let rest = 1.0 - s;
            (
                s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
                30.0 * s * s * rest * rest,
            )
        } else {
            (s, 1.0)
        };
        (p0 + share * way, way * (rate / (t1 - t0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_is_the_derivative_of_the_place() {
        let places = [
            (0.5, DVec3::ZERO),
            (1.0, DVec3::X),
            (2.0, DVec3::new(1.0, -3.0, 2.0)),
        ];
        let path = Path::smooth(places).trembling(DVec3::new(0.0, 0.02, 0.0), 35.0);
        for i in 0..250 {
            let (t, h) = (0.01 * f64::from(i), 1e-6);
            let slope = (path.at(t + h).0 - path.at(t - h).0) / (2.0 * h);
            assert!((slope - path.at(t).1).length() < 1e-4, "at {t} s");
        }
    }

    #[test]
    fn a_path_stays_at_its_ends() {
        let path = Path::straight([(1.0, DVec3::X), (2.0, DVec3::Y)]);
        assert_eq!(path.at(0.0), (DVec3::X, DVec3::ZERO));
        assert_eq!(path.at(9.0), (DVec3::Y, DVec3::ZERO));
        assert_eq!(path.at(1.5).0, DVec3::new(0.5, 0.5, 0.0));
    }
}
