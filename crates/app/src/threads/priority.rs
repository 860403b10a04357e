//! Asking the system to run a thread before all others.

use thread_priority::unix::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// Above what audio servers take, below the system's own watchdogs, of 1 to 99.
const PRIORITY: u8 = 80;

/// Asks for the real-time policy for this thread. The answer, as a sentence; a refusal is no error: the thread goes on as it was.
pub fn ask() -> String {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    // Its range in the crate is 0 to 99.
    let value = ThreadPriorityValue::try_from(PRIORITY).expect("80 is among them");
    let priority = ThreadPriority::Crossplatform(value);
    match set_thread_priority_and_policy(thread_native_id(), priority, policy) {
        Ok(()) => "granted".into(),
        Err(why) => format!(
            "refused ({why:?}); ticks may come late under load; allow it by a limit `rtprio` of {PRIORITY} in \
             /etc/security/limits.d"
        ),
    }
}
