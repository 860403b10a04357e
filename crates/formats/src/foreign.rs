//! Decoders of others on bytes of unknown origin.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::Fault;

/// Runs `decode`, and takes a panic in it for what it is there: the sign of a stream that does not hold.
///
/// Decoders of images and archives reach for bytes that a damaged stream does not have, and some of them panic.
/// Nothing of theirs outlives the call but what `decode` gives, so no broken state can be met afterwards.
pub(crate) fn guarded<T>(what: &str, decode: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        Err(Fault::Damaged {
            what: format!("the decoder of {what} gave up on it"),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_damage_and_a_result_passes() {
        let none: [u8; 0] = [];
        let broken = guarded("a test", || Ok(none[std::hint::black_box(3)]));
        assert!(broken.unwrap_err().to_string().contains("the decoder of a test"));
        assert_eq!(guarded("a test", || Ok(5)).unwrap(), 5);
        assert!(matches!(
            guarded::<u8>("a test", || Err(Fault::Empty)),
            Err(Fault::Empty)
        ));
    }
}
