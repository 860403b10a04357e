//! All interleavings of a few steps of both ends, by loom: no slot is reached by both at once, and what is read is new.

use loom::thread;

use super::*;

/// A publisher makes two values, a reader looks three times.
#[test]
fn no_slot_is_reached_by_both() {
    loom::model(|| {
        let (mut publisher, mut reader) = latest(|| [0_u32; 2]);
        let writer = thread::spawn(move || {
            for n in 1..=2 {
                let old = publisher.publish([n; 2]);
                assert!(old[0] == old[1] && old[0] < n);
            }
        });
        let mut before = 0;
        for _ in 0..3 {
            let is_new = reader.refresh();
            let [a, b] = *reader.get();
            assert_eq!(a, b);
            assert_eq!(is_new, a > before, "{before} and then {a}");
            before = a;
            // loom sees a read as it begins: this one ends what the first began.
            assert_eq!(*reader.get(), [a, b]);
        }
        writer.join().unwrap();
        reader.refresh();
        assert_eq!(*reader.get(), [2, 2], "the last is never lost");
    });
}

/// Values that own memory: none is leaked, freed twice, or freed by the reader.
#[test]
fn what_is_published_is_freed_once() {
    loom::model(|| {
        let (mut publisher, mut reader) = latest(|| Arc::new(0));
        let writer = thread::spawn(move || {
            for n in 1..=2 {
                drop(publisher.publish(Arc::new(n)));
            }
        });
        reader.refresh();
        assert!(**reader.get() <= 2);
        writer.join().unwrap();
    });
}
