//! What a hand feels while nobody computes.

/// Time for which a force is held that no other follows, s.
pub(super) const HOLD: f64 = 2e-3;
/// Time after which nothing is left of it, s.
const GONE: f64 = 5e-3;

/// Share of a force that the hand still feels some time, s, after it was sent, if no other followed: all for 2 ms, then less and
/// less, and nothing after 5 ms.
///
/// Whoever writes to a device multiplies by it, and so does the servo when it comes late: so both know what the hand feels, and the
/// next force is a small step away from that.
pub fn held(elapsed: f64) -> f64 {
    ((GONE - elapsed) / (GONE - HOLD)).clamp(0.0, 1.0)
}
