//! The simulated board, shared by the driver's wires and the test.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::simulation::board::Board;

/// Handle of a simulated board; clones refer to one board.
#[derive(Clone)]
pub(super) struct SharedBoard<const CHIPS: usize>(Arc<Mutex<Board<CHIPS>>>);

impl<const CHIPS: usize> SharedBoard<CHIPS> {
    pub(super) fn new(board: Board<CHIPS>) -> Self {
        Self(Arc::new(Mutex::new(board)))
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Board<CHIPS>> {
        // After a panic in another thread the board can still be inspected.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<const CHIPS: usize> core::fmt::Debug for SharedBoard<CHIPS> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter
            .debug_struct("SharedBoard")
            .finish_non_exhaustive()
    }
}
