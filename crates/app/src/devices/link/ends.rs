//! The end of the program: no device is left with a force.

use std::sync::{Arc, Mutex, Once, Weak};
use std::time::{Duration, Instant};

use super::Link;

/// Links whose threads run.
static LINKS: Mutex<Vec<Weak<Link>>> = Mutex::new(Vec::new());

/// Longest wait for the writers at the end. A report goes within 1 ms as a rule and within 14 ms at worst.
const GRACE: Duration = Duration::from_millis(60);

/// Remembers a link until it ends, and has a panic of any thread end it.
pub fn remember(link: &Arc<Link>) {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            leave_all();
            before(panic);
        }));
    });
    if let Ok(mut links) = LINKS.lock() {
        links.retain(|l| l.strong_count() > 0);
        links.push(Arc::downgrade(link));
    }
}

/// Leaves the hand without force at every device, and ends them. Waits a moment for their writers.
pub fn leave_all() {
    // Who panics while it holds the list has not begun its link.
    let links: Vec<_> = match LINKS.try_lock() {
        Ok(links) => links.iter().filter_map(Weak::upgrade).collect(),
        Err(_) => return,
    };
    for link in &links {
        link.end();
    }
    let start = Instant::now();
    while start.elapsed() < GRACE && links.iter().any(|l| !l.has_left()) {
        std::thread::sleep(Duration::from_micros(200));
    }
}
