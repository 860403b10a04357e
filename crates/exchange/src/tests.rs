use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::*;

#[test]
fn a_reader_has_the_latest_and_nothing_twice_as_new() {
    let (mut publisher, mut reader) = latest(|| 0);
    assert!(!reader.refresh());
    assert_eq!(*reader.get(), 0);
    for round in 0..10 {
        for n in 1..=3 {
            publisher.publish(10 * round + n);
        }
        assert!(reader.refresh());
        assert_eq!(*reader.get(), 10 * round + 3);
        assert!(!reader.refresh());
        assert_eq!(*reader.get(), 10 * round + 3);
    }
}

#[test]
fn what_was_published_comes_back_to_the_publisher() {
    static ALIVE: AtomicUsize = AtomicUsize::new(0);
    struct Counted(u32);
    impl Drop for Counted {
        fn drop(&mut self) {
            ALIVE.fetch_sub(1, Ordering::SeqCst);
        }
    }
    let made = |n| {
        ALIVE.fetch_add(1, Ordering::SeqCst);
        Counted(n)
    };
    let (mut publisher, mut reader) = latest(|| made(0));
    for n in 1..100 {
        let read = reader.get().0;
        let old = publisher.publish(made(n));
        assert_eq!(reader.get().0, read, "what is read stays");
        assert!(old.0 < n);
        drop(old);
        assert_eq!(ALIVE.load(Ordering::SeqCst), 3);
        if n % 3 == 0 {
            reader.refresh();
        }
        assert_eq!(ALIVE.load(Ordering::SeqCst), 3, "a reader frees nothing");
    }
    drop((publisher, reader));
    assert_eq!(ALIVE.load(Ordering::SeqCst), 0);
}

#[test]
fn no_value_is_torn_and_none_comes_before_an_older_one() {
    const LAST: u64 = 200_000;
    let (mut publisher, mut reader) = latest(|| [0_u64; 16]);
    let writer = thread::spawn(move || {
        (1..=LAST).for_each(|n| {
            publisher.publish([n; 16]);
        })
    });
    let mut before = 0;
    while before < LAST {
        if reader.refresh() {
            let value = reader.get();
            assert!(value.iter().all(|&word| word == value[0]), "{value:?}");
            assert!(value[0] > before);
            before = value[0];
        } else {
            thread::yield_now();
        }
    }
    writer.join().unwrap();
}
