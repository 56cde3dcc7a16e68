//! A lock that tests of one executable hold while they build, which loads all cores, or judge
//! wall-clock times, which such a load disturbs.

use std::sync::{Mutex, MutexGuard, PoisonError};

static MACHINE: Mutex<()> = Mutex::new(());

/// Waits until no other test holds the lock, and returns its guard, which frees it when dropped.
pub fn exclusive() -> MutexGuard<'static, ()> {
    MACHINE.lock().unwrap_or_else(PoisonError::into_inner)
}
