//! A lock for tests of one executable that would disturb each other by the load that they put on
//! the machine: builds, which use all cores, and tests that judge wall-clock times.

use std::sync::{Mutex, MutexGuard, PoisonError};

static MACHINE: Mutex<()> = Mutex::new(());

/// Waits until no other test holds the lock, and returns its guard, which frees it when dropped.
pub fn exclusive() -> MutexGuard<'static, ()> {
    MACHINE.lock().unwrap_or_else(PoisonError::into_inner)
}
