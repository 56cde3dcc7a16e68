//! Progress of a job, and the request to end it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::error::OfflineError;

/// Seconds of signal that all jobs together have processed, and whether the jobs should end early.
/// All jobs share one `Progress`.
#[derive(Debug, Default)]
pub struct Progress {
    seconds: AtomicU64,
    interrupted: AtomicBool,
}

impl Progress {
    /// Returns the seconds of signal processed so far.
    pub fn seconds(&self) -> u64 {
        self.seconds.load(Ordering::Relaxed)
    }

    /// Ends the jobs: each returns [`OfflineError::Interrupted`] within a second of signal.
    pub fn interrupt(&self) {
        self.interrupted.store(true, Ordering::Relaxed);
    }

    /// Counts one more second of processed signal.
    ///
    /// # Errors
    /// [`OfflineError::Interrupted`] after [`Self::interrupt`].
    pub(crate) fn add_second(&self) -> Result<(), OfflineError> {
        self.seconds.fetch_add(1, Ordering::Relaxed);
        self.check()
    }

    /// Checks whether the jobs may continue.
    ///
    /// # Errors
    /// [`OfflineError::Interrupted`] after [`Self::interrupt`].
    pub fn check(&self) -> Result<(), OfflineError> {
        if self.interrupted.load(Ordering::Relaxed) {
            return Err(OfflineError::Interrupted);
        }
        Ok(())
    }
}
