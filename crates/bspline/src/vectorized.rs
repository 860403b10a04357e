//! Plain loops compiled for the widest vectors that the processor has.

use pulp::{Arch, Simd, WithSimd};

struct Kernel<F>(F);

impl<R, F: FnMut() -> R> WithSimd for Kernel<F> {
    type Output = R;
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> R {
        (self.0)()
    }
}

/// Runs a closure marked `#[inline(always)]`, compiled for these vectors.
///
/// [`Arch::dispatch`] on the closure itself calls it through the shim that makes a `FnOnce` of it. The shim is compiled
/// for the baseline, and is too long to be inlined: its loops stay at 128 bits.
#[inline(always)]
pub fn vectorized<R>(kernel: impl FnMut() -> R) -> R {
    Arch::new().dispatch(Kernel(kernel))
}
