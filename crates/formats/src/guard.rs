//! Decoders of other people behind a wall.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::Fault;

/// Runs a decoder of `what`; a panic in it is a damaged file.
///
/// The decoders of LAZ and E57 are written for sound files: bytes that no encoder wrote meet an index, a sum or an
/// `unwrap` that nobody foresaw. Such a file must not take down a program that holds somebody's work. What the
/// decoder had in its hands is dropped with it, so nothing half made is seen afterwards. Own code is not run in
/// here: its panics are our mistakes.
pub(crate) fn decode<T>(what: &str, decoder: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    catch_unwind(AssertUnwindSafe(decoder)).unwrap_or_else(|panic| {
        Err(Fault::Damaged {
            what: format!("the {what} gave up ({})", message(&*panic)),
        })
    })
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = match (panic.downcast_ref::<&str>(), panic.downcast_ref::<String>()) {
        (Some(text), _) => text,
        (_, Some(text)) => text.as_str(),
        _ => "without a message",
    };
    text.chars().take(120).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_a_decoder_is_a_damaged_file() {
        assert_eq!(decode("x", || Ok(1)).unwrap(), 1);
        let number = std::hint::black_box(7);
        let e = decode::<()>("decoder of x", || panic!("index {number}"))
            .unwrap_err()
            .to_string();
        assert!(e.contains("the decoder of x gave up (index 7)"), "{e}");
    }
}
