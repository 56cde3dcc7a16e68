//! Keeps tests of one executable apart that disturb each other through the load of the machine:
//! builds, which take all cores, and tests that judge times by the wall clock.

use std::sync::{Mutex, MutexGuard, PoisonError};

static MACHINE: Mutex<()> = Mutex::new(());

/// Waits until no other test holds the returned guard; later callers wait until it is dropped.
pub fn exclusive() -> MutexGuard<'static, ()> {
    MACHINE.lock().unwrap_or_else(PoisonError::into_inner)
}
