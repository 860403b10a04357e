//! What a set of oriented triangles looks like from afar.

use glam::DVec3;

/// Moments of area vectors about a point: the first three terms of the Taylor expansion of their solid angle.
///
/// Only full symmetrizations are kept: the kernel `r/|r|³` is a gradient, so its derivatives are symmetric.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moments {
    pub center: DVec3,
    /// `Σ ∫ n dA`.
    dipole: DVec3,
    /// `Σ ∫ n ⊗ x dA`: xx, yy, zz, xy, xz, yz.
    quadrupole: [f64; 6],
    /// `Σ ∫ n ⊗ x ⊗ x dA`: xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz.
    octupole: [f64; 10],
}

impl Moments {
    /// Nothing yet, about `center`.
    pub fn about(center: DVec3) -> Self {
        Self {
            center,
            ..Default::default()
        }
    }

    /// Moments of one triangle with the area vector `n`, about its centroid.
    pub fn of_triangle(corners: &[DVec3; 3], n: DVec3) -> Self {
        let mut out = Self::about((corners[0] + corners[1] + corners[2]) / 3.0);
        out.dipole = n;
        // ∫ x xᵀ dA = A/12 Σ v vᵀ over the corners v.
        for v in corners {
            let v = *v - out.center;
            let part = symmetric3(n / 12.0, v, v);
            for i in 0..10 {
                out.octupole[i] += part[i];
            }
        }
        out
    }

    /// Adds moments about another point.
    pub fn add(&mut self, other: &Self) {
        let d = other.center - self.center;
        self.dipole += other.dipole;
        let q = &other.quadrupole;
        let shift = symmetric2(other.dipole, d);
        for i in 0..6 {
            self.quadrupole[i] += q[i] + shift[i];
        }
        // The rows of a symmetric matrix, times d: Sym(Q ⊗ d) = Σ_a Sym(Q_a ⊗ e_a ⊗ d).
        let rows = [
            DVec3::new(q[0], q[3], q[4]),
            DVec3::new(q[3], q[1], q[5]),
            DVec3::new(q[4], q[5], q[2]),
        ];
        let mut shift = symmetric3(other.dipole, d, d);
        for (row, axis) in rows.into_iter().zip(DVec3::AXES) {
            let part = symmetric3(row, axis, d * 2.0);
            for i in 0..10 {
                shift[i] += part[i];
            }
        }
        for i in 0..10 {
            self.octupole[i] += other.octupole[i] + shift[i];
        }
    }

    /// `Σ ∫ n·(x - q)/|x - q|³ dA` by the expansion, for `r = center - q`.
    #[inline]
    pub fn solid_angle(&self, r: DVec3) -> f64 {
        let inverse = 1.0 / r.length_squared();
        let (x, y, z) = (r.x, r.y, r.z);
        let [xx, yy, zz, xy, xz, yz] = self.quadrupole;
        let along = (xx * x * x + yy * y * y + zz * z * z) + 2.0 * (xy * x * y + xz * x * z + yz * y * z);
        let second = (xx + yy + zz) - 3.0 * inverse * along;
        let [xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz] = self.octupole;
        let trace = (xxx + yyx + zzx) * x + (xxy + yyy + zzy) * y + (xxz + yyz + zzz) * z;
        let along = (xxx * x * x * x + yyy * y * y * y + zzz * z * z * z)
            + 3.0 * (x * x * (xxy * y + xxz * z) + y * y * (yyx * x + yyz * z) + z * z * (zzx * x + zzy * y))
            + 6.0 * xyz * x * y * z;
        let third = inverse * (7.5 * inverse * along - 4.5 * trace);
        (self.dipole.dot(r) + second + third) * (inverse * inverse.sqrt())
    }
}

/// Symmetric part of `a ⊗ b`.
fn symmetric2(a: DVec3, b: DVec3) -> [f64; 6] {
    [
        a.x * b.x,
        a.y * b.y,
        a.z * b.z,
        0.5 * (a.x * b.y + a.y * b.x),
        0.5 * (a.x * b.z + a.z * b.x),
        0.5 * (a.y * b.z + a.z * b.y),
    ]
}

/// Symmetric part of `a ⊗ b ⊗ c`.
fn symmetric3(a: DVec3, b: DVec3, c: DVec3) -> [f64; 10] {
    let at = |i: usize, j: usize, k: usize| {
        (a[i] * (b[j] * c[k] + b[k] * c[j])
            + a[j] * (b[i] * c[k] + b[k] * c[i])
            + a[k] * (b[i] * c[j] + b[j] * c[i]))
            / 6.0
    };
    [
        at(0, 0, 0),
        at(1, 1, 1),
        at(2, 2, 2),
        at(0, 0, 1),
        at(0, 0, 2),
        at(1, 1, 0),
        at(1, 1, 2),
        at(2, 2, 0),
        at(2, 2, 1),
        at(0, 1, 2),
    ]
}
