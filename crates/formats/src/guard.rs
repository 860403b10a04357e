//! Decoders of other people behind a wall.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use crate::Fault;

thread_local! {
    /// Whether a decoder runs in this thread.
    static IS_DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder of `what`; a panic in it is a damaged file.
///
/// The decoders of LAZ and E57 are written for sound files: bytes that no encoder wrote meet an index, a sum or an
/// `unwrap` that nobody foresaw. Such a file must not take down a program that holds somebody's work. What the
/// decoder had in its hands is dropped with it, so nothing half made is seen afterwards. Own code is not run in
/// here: its panics are our mistakes. What a panic says is for the decoder's authors: the hook that would print it is
/// not called, for these panics alone.
pub(crate) fn decode<T>(what: &str, decoder: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    static FILTER: Once = Once::new();
    FILTER.call_once(|| {
        let hook = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_DECODING.get() {
                hook(panic);
            }
        }));
    });
    let outer = IS_DECODING.replace(true);
    let result = catch_unwind(AssertUnwindSafe(decoder));
    IS_DECODING.set(outer);
    result.unwrap_or_else(|_| {
        Err(Fault::Damaged {
            what: format!("the {what} gave up: these bytes are none that an encoder writes"),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_a_decoder_is_a_damaged_file_and_prints_nothing() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        static HEARD: AtomicUsize = AtomicUsize::new(0);
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            HEARD.fetch_add(
                usize::from(panic.payload_as_str() == Some("of ours")),
                Ordering::Relaxed,
            );
            before(panic);
        }));
        assert_eq!(decode("x", || Ok(1)).unwrap(), 1);
        let number = std::hint::black_box(7);
        let e = decode::<()>("decoder of x", || panic!("index {number}"))
            .unwrap_err()
            .to_string();
        assert!(
            e.contains("the decoder of x gave up") && !e.contains("index"),
            "{e}"
        );
        assert!(!IS_DECODING.get());
        // Those outside of a decoder are heard as before.
        assert!(catch_unwind(|| panic!("of ours")).is_err());
        assert_eq!(HEARD.load(Ordering::Relaxed), 1);
    }
}
