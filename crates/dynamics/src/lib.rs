//! Density dynamics of implicit solids: a field becomes elastic.
//!
//! A [`Patch`](patch::Patch) is a box of a B-spline field, sampled on a regular [lattice](lattice::Lattice). The
//! samples are mass-points that move along the density axis only, joined by [density springs](springs); their
//! [matter](matter::Matter) is given per volume. The state is the change `p` of the free control coefficients and its
//! rate; with the collocation matrix `A`, `d = d₀ + A p` are the densities, and
//!
//! `M̃ p̈ + D̃ ṗ = Aᵀ(f_ext + f_int(d))`, `M̃ = AᵀMA`, `D̃ = AᵀDA` [Hua04 eq. 8 with forces relative to rest]
//!
//! is integrated by [`step`](patch::Patch::step). Implicit steps solve for the *increment*, `AᵀSA x = Aᵀg` with a
//! matrix `S` on the samples ([`solve`]), and judge convergence against the impulse `Aᵀg`.
//!
//! Arrays have the order `(x, y, z)` with `z` fastest. Coefficients and samples with a fixed rim are the free ones only.
//! Sums have fixed orders, and multiplications and additions are never fused: the same input gives the same bits.
//!
//! ```
//! use dynamics::{integrators::Integrator, lattice::{Lattice, Rim}, matter::Matter, patch::Patch};
//! use dynamics::{solve::SolverOptions, springs::{Law, Neighbours}};
//!
//! // 15³ coefficients of which 9³ are free, 20³ samples 0.5 apart, cut from the half-space x < 4.75.
//! let lattice = Lattice::<f32>::cube(15, 20, Rim::Fixed, 0.5)?;
//! let d: Vec<f32> = (0..8000).map(|i| 4.75 - 0.5 * (i / 400) as f32).collect();
//! let law = Law::Linear { scale: 1.0 };
//! let mut patch = Patch::new(lattice, Matter::default(), law, Neighbours::Six, &d, SolverOptions::default())?;
//! let mut force = vec![0.0; 8000];
//! force[10 * 400 + 10 * 20 + 10] = 1.0;
//! patch.set_force(&force)?;
//! let report = patch.step(Integrator::TrBdf2, 0.1)?;
//! assert!(report.work > 0.0 && report.solve.iteration.iterations <= 8);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! The sources that are cited by keys such as [Hua04 eq. 8] stand in `docs/bibliography.md`.
//!
//! A [`Region`](region::Region) cuts a patch out of a hierarchical field and bakes its change back; a
//! [`TensorRegion`](region::TensorRegion) moves a whole patch on knots of its own.
//!
//! What it cannot do yet: use more than one thread.

pub mod constraints;
pub mod integrators;
pub mod lattice;
pub mod matter;
pub mod paint;
pub mod patch;
pub mod region;
pub mod response;
mod rest;
pub mod snapshot;
pub mod solve;
pub mod sparse;
pub mod springs;
#[cfg(feature = "study")]
pub mod study;
mod units;
