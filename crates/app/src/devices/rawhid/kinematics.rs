//! From counts to a place and from a force to torques, for arms of three links.
//!
//! With R = Lb sin tB + Lc sin tC the handle is at (cos tA R, sin tA R, La + Lb cos tB - Lc cos tC) less the middle of the room.
//! Angles in radians, lengths in metres, in the arm's own axes: towards the user, to his right, up.

use std::f64::consts::PI;

use glam::{DMat3, DQuat, DVec3};

use super::variants::Variant;

/// Acceleration of gravity, m/s².
const GRAVITY: f64 = 9.81;

/// Angles of the three bodies.
pub fn angles(arm: &Variant, counts: [i32; 3]) -> DVec3 {
    let angle = |i: usize| 2.0 * PI * f64::from(counts[i]) / arm.counts[i] * arm.ratio(i);
    DVec3::new(angle(0), angle(1), angle(2))
}

/// The handle.
pub fn position(arm: &Variant, angles: DVec3) -> DVec3 {
    let [la, lb, lc] = arm.length;
    let (a, b, c) = (angles.x, angles.y, angles.z);
    let out = lb * libm::sin(b) + lc * libm::sin(c);
    let up = la + lb * libm::cos(b) - lc * libm::cos(c);
    DVec3::new(libm::cos(a) * out, libm::sin(a) * out, up) - DVec3::from(arm.origin)
}

/// How the handle goes with each angle: the columns are its derivatives by tA, tB and tC.
pub fn jacobian(arm: &Variant, angles: DVec3) -> DMat3 {
    let [_, lb, lc] = arm.length;
    let (sin, cos) = (
        [angles.x, angles.y, angles.z].map(libm::sin),
        [angles.x, angles.y, angles.z].map(libm::cos),
    );
    let out = lb * sin[1] + lc * sin[2];
    DMat3::from_cols(
        DVec3::new(-sin[0] * out, cos[0] * out, 0.0),
        DVec3::new(cos[0] * cos[1], sin[0] * cos[1], -sin[1]) * lb,
        DVec3::new(cos[0] * cos[2], sin[0] * cos[2], sin[2]) * lc,
    )
}

/// Torques on the bodies, N m, that push the hand with a force, N.
pub fn torques(arm: &Variant, angles: DVec3, force: DVec3) -> DVec3 {
    jacobian(arm, angles).transpose() * force
}

/// Torques on the bodies that hold the links against gravity: the slopes of their energy, g (mB cB + mC Lb) cos tB - g mC cC cos tC.
///
/// The makers' formula pushes the second link the other way and adds sin tC to it; it is off in all of their settings, and the energy
/// of the links is what a test can hold this to.
pub fn gravity(arm: &Variant, angles: DVec3) -> DVec3 {
    let ([mb, mc], [cb, cc]) = (arm.mass, arm.centre);
    let lb = arm.length[1];
    DVec3::new(
        0.0,
        -GRAVITY * (mb * cb + mc * lb) * libm::sin(angles.y),
        GRAVITY * mc * cc * libm::sin(angles.z),
    )
}

/// Currents of the motors, A, for torques on the bodies.
pub fn currents(arm: &Variant, torques: DVec3) -> DVec3 {
    let current = |i: usize| torques[i] * arm.ratio(i) / arm.torque_constant[i];
    DVec3::new(current(0), current(1), current(2))
}

/// Turn of the handle from the three angles of the gimbal, none without one. `gimbal` are the counts of its joints from the arm
/// outwards.
pub fn turn(arm: &Variant, angles: DVec3, gimbal: [i32; 3]) -> DQuat {
    if arm.gimbal_counts == 0.0 {
        return DQuat::IDENTITY;
    }
    let joint = |i: usize| {
        let sign = if arm.gimbal_aligned[i] { 1.0 } else { -1.0 };
        sign * 2.0 * PI * f64::from(gimbal[i]) / arm.gimbal_counts
    };
    about(DVec3::Z, angles.x)
        * about(DVec3::Y, PI / 2.0 - angles.z)
        * about(DVec3::X, joint(0))
        * about(DVec3::Y, joint(1))
        * about(DVec3::X, joint(2))
}

/// A turn about an axis of length 1, with the same bits on every machine.
fn about(axis: DVec3, angle: f64) -> DQuat {
    let v = axis * libm::sin(angle / 2.0);
    DQuat::from_xyzw(v.x, v.y, v.z, libm::cos(angle / 2.0))
}

/// Way of the handle for one count of each motor, m, where the links stand at right angles and the handle in the middle of the room.
pub fn resolution(arm: &Variant) -> [f64; 3] {
    let arms = [arm.origin[0], arm.length[1], arm.length[2]];
    std::array::from_fn(|i| (2.0 * PI / arm.counts[i] * arm.ratio(i) * arms[i]).abs())
}
