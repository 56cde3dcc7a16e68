//! Edges of DRDY, with their times.

/// A falling edge of DRDY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrdyEdge {
    /// When it came, us.
    pub us: u64,
    /// Earlier edges that were missed: none of them was waited for in time.
    pub missed: u32,
}

/// DRDY of chip 0 and the clock that stamps its edges, us; it never goes back.
#[expect(
    async_fn_in_trait,
    reason = "an executor of one priority polls it; it need not be Send"
)]
pub trait Drdy {
    /// The time.
    fn now_us(&self) -> u64;

    /// Waits for an edge that was not returned yet, until a time at most; returns the newest, also where
    /// that time has passed.
    async fn next_until(&mut self, us: u64) -> Option<DrdyEdge>;

    /// Waits until a time, whatever DRDY does.
    async fn wait_until(&mut self, us: u64);

    /// Drops the edges that have come so far.
    fn forget(&mut self);
}
