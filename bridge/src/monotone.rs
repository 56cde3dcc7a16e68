//! Stamps that only go forwards.

use neuro_ros::Stamp;

/// Stamps that only go forwards, whatever the clocks do: each at least 1 us after the last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Monotone {
    last_ns: i64,
    held: u64,
}

impl Monotone {
    pub(crate) fn stamp(&mut self, nanoseconds: i64) -> Stamp {
        let least = self.last_ns.saturating_add(1000);
        self.held += u64::from(nanoseconds < least);
        self.last_ns = nanoseconds.max(least);
        Stamp::from_nanoseconds(self.last_ns)
    }

    /// The clock itself was stepped back too far to wait for it: the next stamp may lie before
    /// the last.
    pub(crate) fn step_back(&mut self) {
        self.last_ns = 0;
    }

    /// Stamps that had to be moved forwards.
    pub(crate) fn held(&self) -> u64 {
        self.held
    }
}
