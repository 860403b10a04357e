//! Matter of a scene on the samples of its region.

use bspline::Real;
use dynamics::matter::{Matter, Quantity};
use dynamics::region::Region;
use dynamics::springs::{Plasticity, Weights};
use glam::DVec3;

use super::amount::Amount;
use super::error::{SimulateError, wrong};
use super::place::Samples;
use super::script::{Material, Paint, Scene, Substance};
use crate::paint::{self, Layers, distance};

/// Matter and scale of rest lengths.
#[derive(Clone, Debug, PartialEq)]
pub struct Clay {
    matter: Matter,
    rest_scale: Quantity,
}

impl Clay {
    /// The material on the samples.
    pub fn new(material: &Material, samples: &Samples) -> Result<Self, SimulateError> {
        let on = |key: &str, amount: &Option<Amount>, default: f64, zero: bool| {
            let place = || format!("[material] {key}");
            let check = |v: f64| {
                if v > 0.0 || (zero && v == 0.0) {
                    Ok(v)
                } else {
                    Err(wrong(
                        place(),
                        format!(
                            "is {v}; it has to be {} everywhere",
                            if zero { "0 or above" } else { "above 0" }
                        ),
                    ))
                }
            };
            Ok::<_, SimulateError>(match amount {
                None => Quantity::Constant(default),
                Some(Amount::Constant(v)) => Quantity::Constant(check(*v)?),
                Some(Amount::Formula(f)) => {
                    let all = samples.positions.iter().zip(&samples.densities);
                    let values = all.map(|(p, d)| check(f.at(*p, *d).map_err(|e| wrong(place(), e))?));
                    Quantity::PerSample(values.collect::<Result<_, _>>()?)
                }
            })
        };
        Ok(Self {
            matter: Matter {
                mass: on("mass", &material.mass, 1.0, false)?,
                damping: on("damping", &material.damping, 0.0, true)?,
                stiffness: on("stiffness", &material.stiffness, 1.0, true)?,
                ground: on("ground", &material.ground, 0.0, true)?,
                spring_factors: None,
            },
            rest_scale: on("rest-scale", &material.rest_scale, 1.0, true)?,
        })
    }

    /// Multiplies the material by what is painted on the object.
    pub fn scale_by(&mut self, layers: &Layers, samples: &Samples) {
        for (substance, quantity) in [
            (paint::Substance::Stiffness, &mut self.matter.stiffness),
            (paint::Substance::Mass, &mut self.matter.mass),
            (paint::Substance::Damping, &mut self.matter.damping),
            (paint::Substance::RestLength, &mut self.rest_scale),
        ] {
            let Some(factors) = paint::values(layers, substance, &samples.positions) else {
                continue;
            };
            // Where a region meets no paint its matter stays uniform, and its solver fast.
            if factors.iter().any(|f| *f != 1.0) {
                let values = quantity.paint(samples.positions.len());
                values
                    .iter_mut()
                    .zip(factors)
                    .for_each(|(value, factor)| *value *= factor);
            }
        }
    }

    /// Lays paint on. Between the edge and where it is full the value changes linearly.
    pub fn paint(&mut self, paint: &Paint, samples: &Samples) {
        let quantity = match paint.substance {
            Substance::Mass => &mut self.matter.mass,
            Substance::Damping => &mut self.matter.damping,
            Substance::Stiffness => &mut self.matter.stiffness,
            Substance::Ground => &mut self.matter.ground,
            Substance::RestScale => &mut self.rest_scale,
        };
        let values = quantity.paint(samples.positions.len());
        let fade = paint.fade.map_or(0.0, |f| f.0.min(1.0)) * paint.radius.0;
        for (value, p) in values.iter_mut().zip(&samples.positions) {
            let inside = paint.radius.0 - distance(*p, &paint.along);
            if inside >= 0.0 {
                let w = if fade > 0.0 { (inside / fade).min(1.0) } else { 1.0 };
                *value += w * (paint.value.0 - *value);
            }
        }
    }

    /// Hands the matter to a region.
    pub fn give<T: Real>(&self, region: &mut Region<T>) -> Result<(), SimulateError> {
        let patch = region.patch_mut();
        patch
            .set_matter(self.matter.clone())
            .map_err(|e| wrong("[material]", e))?;
        patch.springs_mut().rest_mut().scale = match &self.rest_scale {
            Quantity::Constant(s) => Weights::Constant(T::from_f64(*s)),
            Quantity::PerSample(s) => Weights::Each(s.iter().map(|s| T::from_f64(*s)).collect()),
        };
        Ok(())
    }
}

/// Whether rest follows, and where.
pub fn plasticity<T: Real>(scene: &Scene, samples: &Samples) -> Result<Plasticity<T>, SimulateError> {
    let rate = scene.plasticity.rate.map_or(0.0, |r| r.0);
    if rate == 0.0 {
        return match scene.plasticity.under_pulls {
            true => Err(wrong(
                "[plasticity] rate",
                "is missing; write at which rate, per second, rest lengths follow under the pulls",
            )),
            false => Ok(Plasticity::Elastic),
        };
    }
    if !scene.plasticity.under_pulls {
        return Ok(Plasticity::Clay { rate });
    }
    let weight = |p: &DVec3| {
        let of = scene.pull.iter().map(|pull| {
            let path = [pull.at, pull.to.unwrap_or(pull.at)];
            let x = distance(*p, &path) / pull.radius.0;
            libm::exp(-0.5 * x * x)
        });
        T::from_f64(of.fold(0.0, f64::max))
    };
    Ok(Plasticity::Kernel {
        rate,
        weights: samples.positions.iter().map(weight).collect(),
    })
}
