use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that any thread may raise; the fit looks at it between slices of work.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// A flag that is not raised.
    pub fn new() -> Self {
        Self::default()
    }
    /// Asks the work to stop; it returns [`crate::FitError::Cancelled`] soon after.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
    /// Whether someone asked.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// How far a fit has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is being done, as a short English phrase.
    pub stage: &'static str,
    /// Share of the whole work that is done, `0..=1`, never falling.
    pub fraction: f64,
}

/// What the caller holds while a fit runs: progress out, cancel in, a memory ceiling.
pub struct Control {
    /// Called from the fitting thread, at most a few hundred times.
    pub on_progress: Box<dyn FnMut(Progress) + Send>,
    /// Looked at between slices of work.
    pub cancel: Cancel,
    /// Bytes the fit may hold at once, if bounded.
    pub memory_limit: Option<u64>,
}

impl Default for Control {
    fn default() -> Self {
        Self {
            on_progress: Box::new(|_| ()),
            cancel: Cancel::new(),
            memory_limit: None,
        }
    }
}

impl Control {
    /// Reports progress and gives way to a cancel.
    ///
    /// # Errors
    /// [`crate::FitError::Cancelled`] if the cancel flag is up.
    pub fn step(&mut self, stage: &'static str, fraction: f64) -> Result<(), crate::FitError> {
        if self.cancel.is_cancelled() {
            return Err(crate::FitError::Cancelled);
        }
        (self.on_progress)(Progress { stage, fraction });
        Ok(())
    }

    /// The same cancel and ceiling for a part of the work whose progress nobody sees.
    pub fn quiet(&self) -> Self {
        Self {
            on_progress: Box::new(|_| ()),
            cancel: self.cancel.clone(),
            memory_limit: self.memory_limit,
        }
    }

    /// Refuses work that would hold more than the ceiling.
    ///
    /// # Errors
    /// [`crate::FitError::MemoryLimit`] with both figures.
    pub fn reserve(&self, needed: u64) -> Result<(), crate::FitError> {
        match self.memory_limit {
            Some(limit) if needed > limit => Err(crate::FitError::MemoryLimit { needed, limit }),
            _ => Ok(()),
        }
    }
}
