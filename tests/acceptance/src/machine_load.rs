//! Keeps tests apart that disturb each other through the load of the machine.
//!
//! The tests of one executable run in parallel. A build takes all cores, and delays what a test
//! that judges times by the wall clock measures.

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

static MACHINE: RwLock<()> = RwLock::new(());

/// Waits until no build runs, and keeps builds from starting while the value lives. For tests that
/// judge times by the wall clock.
pub fn without_builds() -> RwLockReadGuard<'static, ()> {
    MACHINE.read().unwrap_or_else(PoisonError::into_inner)
}

/// Waits until no other build and no test of times runs, and keeps them from starting while the
/// value lives.
pub fn exclusive() -> RwLockWriteGuard<'static, ()> {
    MACHINE.write().unwrap_or_else(PoisonError::into_inner)
}
