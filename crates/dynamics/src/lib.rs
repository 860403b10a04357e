//! Density dynamics of implicit solids: springs, matter, integrators, constraints. Not built yet.
