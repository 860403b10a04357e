use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::scene::Formula;

/// How the force of a point of a path fades with the way from it: `β` \[Hua04 §6.1\]. All but formulas have the tool's
/// radius as standard deviation on every axis, so that one does about what another does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// `e^{-q²/2}`.
    #[default]
    Gaussian,
    /// 1 within a ball.
    Constant,
    /// A half ball over a ball, `√(1 - q²)`.
    Spherical,
    /// 1 within a cylinder about the path's direction.
    Cylindrical,
    /// A cone over a ball, `1 - q`.
    Conical,
    /// A formula of the way `x`, `y`, `z` from the point and its length `d`, over the radius; counted up to 4, and where it
    /// is negative as 0.
    Formula(String),
}

/// A filter made ready.
pub(crate) enum Shape {
    Gaussian,
    Constant,
    Spherical,
    Cylindrical,
    Conical,
    Formula(Box<Formula>),
}

impl Shape {
    pub fn new(filter: &Filter) -> Result<Self, String> {
        Ok(match filter {
            Filter::Gaussian => Self::Gaussian,
            Filter::Constant => Self::Constant,
            Filter::Spherical => Self::Spherical,
            Filter::Cylindrical => Self::Cylindrical,
            Filter::Conical => Self::Conical,
            Filter::Formula(text) => Self::Formula(Box::new(Formula::parse(text)?)),
        })
    }

    /// Radii at which it ends.
    pub fn reach(&self) -> f64 {
        match self {
            Self::Gaussian | Self::Formula(_) => 4.0,
            Self::Constant => 5f64.sqrt(),
            Self::Spherical => 6f64.sqrt(),
            Self::Cylindrical => 7f64.sqrt(),
            Self::Conical => 7.5f64.sqrt(),
        }
    }

    /// Its value for a way in radii.
    pub fn at(&self, way: DVec3, direction: DVec3) -> Result<f64, String> {
        let q2 = way.length_squared();
        let reach2 = self.reach().powi(2);
        if q2 > reach2 {
            return Ok(0.0);
        }
        let on = |inside: bool| f64::from(u8::from(inside));
        Ok(match self {
            Self::Gaussian => libm::exp(-0.5 * q2),
            Self::Constant => 1.0,
            Self::Spherical => (1.0 - q2 / reach2).sqrt(),
            Self::Cylindrical => {
                let along = way.dot(direction);
                // Variances of a disc and of a line: a quarter and a third of the square.
                on(along * along <= 3.0 && q2 - along * along <= 4.0)
            }
            Self::Conical => 1.0 - (q2 / reach2).sqrt(),
            Self::Formula(formula) => formula.at(way, q2.sqrt())?.max(0.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every filter has the variance 1 on each axis.
    #[test]
    fn filters_have_the_radius_as_standard_deviation() {
        let all = [
            Filter::Gaussian,
            Filter::Constant,
            Filter::Spherical,
            Filter::Cylindrical,
            Filter::Conical,
            Filter::Formula("exp(-d*d/2)".into()),
        ];
        for filter in all {
            let shape = Shape::new(&filter).unwrap();
            let (mut sum, mut squares) = (0.0, DVec3::ZERO);
            for i in 0..80 * 80 * 80 {
                let p = DVec3::new((i / 6400) as f64, (i / 80 % 80) as f64, (i % 80) as f64);
                let way = 0.1 * (p - 39.5);
                let w = shape.at(way, DVec3::Z).unwrap();
                sum += w;
                squares += w * way * way;
            }
            let variance = squares / sum;
            assert!(
                (variance - 1.0).abs().max_element() < 0.04,
                "{filter:?}: {variance}"
            );
        }
    }
}
