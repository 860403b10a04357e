//! What may be touched.

use glam::DVec3;

/// What a place of a surface feels like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Stiffness of the surface, N/m; infinite where the coupling alone gives way.
    pub stiffness: f64,
    /// Coefficient of friction, 0 or above.
    pub friction: f64,
}

impl Default for Touch {
    /// Rigid and without friction.
    fn default() -> Self {
        Self {
            stiffness: f64::INFINITY,
            friction: 0.0,
        }
    }
}

/// What may be touched at one moment. Answers neither allocate nor lock.
pub trait Obstacle: Send + Sync {
    /// Signed distance to the nearest surface, mm, positive in the air, and its gradient. The gradient has length 1 but for
    /// what a sampled distance is off by.
    fn distance(&self, p: DVec3) -> (f64, DVec3);

    /// A way, mm, within which no part of the solid is missed when the distance is asked at its ends alone.
    fn finest(&self) -> f64;

    /// What the surface nearest to a place feels like.
    fn touch(&self, p: DVec3) -> Touch {
        let _ = p;
        Touch::default()
    }
}

impl<O: Obstacle + ?Sized> Obstacle for &O {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        (**self).distance(p)
    }

    fn finest(&self) -> f64 {
        (**self).finest()
    }

    fn touch(&self, p: DVec3) -> Touch {
        (**self).touch(p)
    }
}

/// Several obstacles at once: the nearest counts \[Kim03 eq. 4.10\].
#[derive(Clone, Copy, Debug)]
pub struct Together<'a, O>(pub &'a [O]);

impl<O: Obstacle> Together<'_, O> {
    /// The nearest obstacle, its distance and gradient.
    fn nearest(&self, p: DVec3) -> Option<(&O, (f64, DVec3))> {
        let all = self.0.iter().map(|o| (o, o.distance(p)));
        all.min_by(|a, b| a.1.0.total_cmp(&b.1.0))
    }
}

impl<O: Obstacle> Obstacle for Together<'_, O> {
    /// Nothing is infinitely far away.
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.nearest(p)
            .map_or((f64::INFINITY, DVec3::Z), |(_, found)| found)
    }

    fn finest(&self) -> f64 {
        self.0.iter().map(O::finest).fold(f64::INFINITY, f64::min)
    }

    fn touch(&self, p: DVec3) -> Touch {
        self.nearest(p).map_or(Touch::default(), |(o, _)| o.touch(p))
    }
}

/// An obstacle on its way from one state to the next, so that an edit comes as a motion and not as a step.
#[derive(Clone, Copy, Debug)]
pub struct Blend<A, B> {
    /// What was.
    pub from: A,
    /// What comes.
    pub to: B,
    /// Share of the second, 0 to 1.
    pub share: f64,
}

impl<A: Obstacle, B: Obstacle> Obstacle for Blend<A, B> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        if self.share >= 1.0 {
            return self.to.distance(p);
        }
        let ((a, ga), (b, gb)) = (self.from.distance(p), self.to.distance(p));
        (a + self.share * (b - a), ga + self.share * (gb - ga))
    }

    fn finest(&self) -> f64 {
        self.from.finest().min(self.to.finest())
    }

    fn touch(&self, p: DVec3) -> Touch {
        self.to.touch(p)
    }
}
