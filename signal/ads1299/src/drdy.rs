//! Falling edges of DRDY with their times.

/// A falling edge of DRDY, which reports a new sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrdyEdge {
    /// Device time of the edge, in microseconds.
    pub us: u64,
    /// Number of earlier edges that were missed because nothing waited for them in time.
    pub missed: u32,
}

/// DRDY of chip 0, and the monotonic clock that stamps its edges in microseconds.
#[expect(
    async_fn_in_trait,
    reason = "an executor of one priority polls it; it need not be Send"
)]
pub trait Drdy {
    /// Returns the current time of that clock, in microseconds.
    fn now_us(&self) -> u64;

    /// Waits at most until time `us` for an edge of DRDY that no earlier call has returned. Returns the
    /// newest such edge, even if `us` has passed; `None` if there is none.
    async fn next_until(&mut self, us: u64) -> Option<DrdyEdge>;

    /// Waits until time `us`, in microseconds, and ignores DRDY.
    async fn wait_until(&mut self, us: u64);

    /// Discards all edges so far; the next wait returns only a later edge.
    fn forget(&mut self);
}
