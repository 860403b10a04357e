use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::placed_box::PlacedBox;
use crate::{Aabb, KnotVector, Real};

/// `f(x) = Σᵢⱼₖ Bᵢ(u) Cⱼ(v) Dₖ(w) pᵢⱼₖ` with `(u, v, w) = T x` [Hua04 eqs. 1 and 3].
///
/// Each axis has a knot vector and a degree (1 to 5) of its own; a knot of multiplicity `m` leaves `p - m` continuous
/// derivatives. Outside the box of the three domains `f(clamp x) - g·|x - clamp x|`, clamped in parameters, distance in
/// the world, `g` the [slope](Self::slope): with zero outer coefficients and `g = 0`, nothing, as [Hua04 eq. 3] needs it.
/// A clone shares the coefficients.
#[derive(Clone, Debug)]
pub struct TensorSpline<T> {
    pub(super) knots: [KnotVector; 3],
    pub(super) coefficients: Arc<[T]>,
    pub(super) place: PlacedBox,
}

/// Why there is no such spline.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TensorError {
    /// The number of coefficients does not fit the knots.
    #[error("{found} coefficients for {shape:?} functions; the product of the three is needed")]
    CoefficientCount {
        /// Functions on each axis.
        shape: [usize; 3],
        /// Coefficients given.
        found: usize,
    },
    /// A coefficient is NaN or infinite.
    #[error("coefficient {index} is {value}; coefficients have to be finite")]
    NotFinite {
        /// Place in the array.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The field would jump.
    #[error(
        "on axis {axis} the inner knot {knot} occurs {found} times; at most {degree}, the degree, leave the field continuous"
    )]
    Discontinuous {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// Value of the knot.
        knot: f64,
        /// How often it occurs.
        found: usize,
        /// Degree on that axis.
        degree: usize,
    },
    /// The map flattens space or is not finite.
    #[error("the map from parameters to the world cannot be inverted (determinant {determinant:e})")]
    Placement {
        /// Determinant of its linear part.
        determinant: f64,
    },
    /// The fall outside the box is negative or not finite.
    #[error("the fall outside the box is {slope} per length; it has to be finite and not negative")]
    Slope {
        /// Slope given.
        slope: f64,
    },
}

impl<T: Real> TensorSpline<T> {
    /// A spline of `coefficients` in the order `(i, j, k)`, `k` fastest, on `knots` along x, y and z.
    ///
    /// `slope >= 0` is the fall of the field per world length outside the box.
    ///
    /// # Errors
    /// Any [`TensorError`].
    pub fn new(
        knots: [KnotVector; 3],
        coefficients: Vec<T>,
        world_from_parameter: DAffine3,
        slope: f64,
    ) -> Result<Self, TensorError> {
        let (shape, found) = (Self::shape_of(&knots), coefficients.len());
        let needed = shape.iter().try_fold(1usize, |n, m| n.checked_mul(*m));
        if needed != Some(found) {
            return Err(TensorError::CoefficientCount { shape, found });
        }
        if let Some((index, c)) = coefficients.iter().enumerate().find(|(_, c)| !c.is_finite()) {
            let value = c.as_f64();
            return Err(TensorError::NotFinite { index, value });
        }
        for (axis, knots) in knots.iter().enumerate() {
            let ([start, end], degree) = (knots.domain(), knots.degree());
            let runs = knots.knots().chunk_by(|a, b| a == b);
            for run in runs.filter(|r| start < r[0] && r[0] < end) {
                let (knot, found) = (run[0], run.len());
                if found > degree {
                    return Err(TensorError::Discontinuous {
                        axis,
                        knot,
                        found,
                        degree,
                    });
                }
            }
        }
        let parameter_from_world = world_from_parameter.inverse();
        if !(world_from_parameter.is_finite() && parameter_from_world.is_finite()) {
            let determinant = world_from_parameter.matrix3.determinant();
            return Err(TensorError::Placement { determinant });
        }
        if !(slope.is_finite() && slope >= 0.0) {
            return Err(TensorError::Slope { slope });
        }
        let end = |e: usize| DVec3::from_array(knots.each_ref().map(|k| k.domain()[e]));
        let place = PlacedBox {
            min: end(0),
            max: end(1),
            world_from_local: world_from_parameter,
            local_from_world: parameter_from_world,
            slope,
        };
        Ok(Self {
            knots,
            coefficients: coefficients.into(),
            place,
        })
    }

    /// The same spline with other coefficients: how a solver moves it.
    ///
    /// # Errors
    /// [`TensorError::CoefficientCount`], [`TensorError::NotFinite`].
    pub fn with_coefficients(&self, coefficients: Vec<T>) -> Result<Self, TensorError> {
        let Self { knots, place, .. } = self;
        Self::new(knots.clone(), coefficients, place.world_from_local, place.slope)
    }

    /// Knot vectors along x, y and z.
    pub fn knots(&self) -> &[KnotVector; 3] {
        &self.knots
    }

    /// Coefficients, last axis fastest.
    pub fn coefficients(&self) -> &[T] {
        &self.coefficients
    }

    /// Coefficients on each axis.
    pub fn shape(&self) -> [usize; 3] {
        Self::shape_of(&self.knots)
    }

    fn shape_of(knots: &[KnotVector; 3]) -> [usize; 3] {
        knots.each_ref().map(KnotVector::coefficient_count)
    }

    /// All `(i, j, k)` in the order of the coefficients.
    pub fn indices(knots: &[KnotVector; 3]) -> impl Iterator<Item = [usize; 3]> + use<T> {
        let [nx, ny, nz] = Self::shape_of(knots);
        (0..nx).flat_map(move |i| (0..ny).flat_map(move |j| (0..nz).map(move |k| [i, j, k])))
    }

    /// The natural place of coefficient `(i, j, k)` in parameters: the three Greville abscissae.
    ///
    /// # Panics
    /// If there is no such coefficient.
    pub fn greville(knots: &[KnotVector; 3], ijk: [usize; 3]) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|a| knots[a].greville(ijk[a])))
    }

    /// Parameters to world.
    pub fn world_from_parameter(&self) -> &DAffine3 {
        &self.place.world_from_local
    }

    /// World to parameters.
    pub fn parameter_from_world(&self) -> &DAffine3 {
        &self.place.local_from_world
    }

    /// Fall of the field per world length outside the box, `>= 0`.
    pub fn slope(&self) -> f64 {
        self.place.slope
    }

    /// World box round the box of the three domains.
    pub fn world_box(&self) -> Aabb {
        self.place.world_box()
    }
}
