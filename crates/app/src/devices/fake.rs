//! A device in memory: plays reports when their time has come, and notes what was written.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use super::clock::Clock;
use super::transport::{Transport, TransportError};

/// Answers a feature report that is asked for by its number, after those that were sent.
pub type Answer = Box<dyn FnMut(u8, &[Vec<u8>]) -> Vec<u8> + Send>;

#[derive(Default)]
struct State {
    is_unplugged: bool,
    /// Writes hang, as on a bus that is full: they fail after their time.
    is_stuck: bool,
    reports: VecDeque<(f64, Vec<u8>)>,
    asked: Option<Vec<u8>>,
    written: Vec<(f64, Vec<u8>)>,
    features: Vec<Vec<u8>>,
    answer: Option<Answer>,
}

/// One of several handles of a device in memory.
#[derive(Clone)]
pub struct Fake {
    clock: Clock,
    state: Arc<Mutex<State>>,
}

impl Fake {
    /// A device that says nothing.
    pub fn new(clock: Clock) -> Self {
        Self {
            clock,
            state: Arc::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Says a report at a time.
    pub fn say(&self, at: f64, report: &[u8]) {
        self.state().reports.push_back((at, report.to_vec()));
    }

    /// Has what is asked for answered with this input report.
    pub fn answer_input(&self, report: &[u8]) {
        self.state().asked = Some(report.to_vec());
    }

    /// Has feature reports answered.
    pub fn answer(&self, answer: Answer) {
        self.state().answer = Some(answer);
    }

    /// Pulls the plug.
    pub fn unplug(&self) {
        self.state().is_unplugged = true;
    }

    /// Has every write fail from now on.
    pub fn stick(&self) {
        self.state().is_stuck = true;
    }

    /// Output reports so far, with their times.
    pub fn written(&self) -> Vec<(f64, Vec<u8>)> {
        self.state().written.clone()
    }

    /// Feature reports so far.
    pub fn features(&self) -> Vec<Vec<u8>> {
        self.state().features.clone()
    }

    fn plugged(&self) -> Result<MutexGuard<'_, State>, TransportError> {
        let state = self.state();
        match state.is_unplugged {
            true => Err(TransportError::Gone("no such device".into())),
            false => Ok(state),
        }
    }
}

fn copy(from: &[u8], to: &mut [u8]) -> usize {
    let length = from.len().min(to.len());
    to[..length].copy_from_slice(&from[..length]);
    length
}

impl Transport for Fake {
    fn read(&mut self, report: &mut [u8], _timeout: Duration) -> Result<usize, TransportError> {
        let now = self.clock.now();
        let mut state = self.plugged()?;
        match state.reports.front() {
            Some((at, _)) if *at <= now => {}
            _ => return Ok(0),
        }
        let (_, next) = state.reports.pop_front().expect("the front was there");
        Ok(copy(&next, report))
    }

    fn input(&mut self, report: &mut [u8]) -> Result<usize, TransportError> {
        let state = self.plugged()?;
        let asked = state
            .asked
            .as_ref()
            .ok_or(TransportError::Failed("stalled".into()))?;
        Ok(copy(asked, report))
    }

    fn write(&mut self, report: &[u8]) -> Result<(), TransportError> {
        let now = self.clock.now();
        let mut state = self.plugged()?;
        if state.is_stuck {
            return Err(TransportError::Failed("timed out".into()));
        }
        state.written.push((now, report.to_vec()));
        Ok(())
    }

    fn feature(&mut self, report: &mut [u8]) -> Result<usize, TransportError> {
        let mut state = self.plugged()?;
        let state = &mut *state;
        let answer = state
            .answer
            .as_mut()
            .ok_or(TransportError::Failed("stalled".into()))?;
        let bytes = answer(report[0], &state.features);
        Ok(copy(&bytes, report))
    }

    fn set_feature(&mut self, report: &[u8]) -> Result<(), TransportError> {
        self.plugged()?.features.push(report.to_vec());
        Ok(())
    }
}
