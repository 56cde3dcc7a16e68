//! Edges of the trigger input, reconstructed from the level and the captured time that the
//! trigger's interrupt reads.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Edge {
    pub(crate) is_rise: bool,
    /// Device time of the edge, microseconds since boot.
    pub(crate) at_us: u64,
    /// Smallest number of edges that must have been missed since the previous reported edge.
    pub(crate) lost: u32,
}

/// Level and stamp of the trigger input when its interrupt last ran, and the number of times that
/// the interrupt may still run.
#[derive(Debug)]
pub(crate) struct TriggerLine {
    is_high: bool,
    /// Stamp of the latest edge, lower 16 bits of the microseconds since boot.
    stamp: u16,
    /// Number of times that the interrupt may still run before the next refill.
    budget: usize,
}

impl TriggerLine {
    /// Creates the state of a low input. The interrupt may not run before the first refill.
    pub(crate) const fn new() -> Self {
        Self { is_high: false, stamp: 0, budget: 0 }
    }

    /// Sets the current level and stamp, to which the next observation is compared.
    pub(crate) const fn reset(&mut self, is_high: bool, stamp: u16) {
        self.is_high = is_high;
        self.stamp = stamp;
    }

    /// Sets the budget to `observations`. Returns whether the budget was exhausted before.
    pub(crate) const fn refill_budget(&mut self, observations: usize) -> bool {
        core::mem::replace(&mut self.budget, observations) == 0
    }

    /// Returns whether the interrupt must not run again until the next refill.
    pub(crate) const fn budget_exhausted(&self) -> bool {
        self.budget == 0
    }

    /// Returns the new edge that a level and a stamp indicate, or `None` if both are unchanged.
    /// `stamp` belongs to the latest edge, which must be less than 32 ms before or after `now_us`.
    ///
    /// Rising and falling edges alternate, so a new stamp with an unchanged level means that
    /// another edge, between the previous edge and this one, was lost.
    pub(crate) fn observe(&mut self, is_high: bool, stamp: u16, now_us: u64) -> Option<Edge> {
        // An observation without a new edge counts too, because the interrupt has run for it.
        self.budget = self.budget.saturating_sub(1);
        if is_high == self.is_high && stamp == self.stamp {
            return None;
        }
        let lost = u32::from(is_high == self.is_high);
        self.reset(is_high, stamp);
        #[expect(clippy::cast_possible_truncation, reason = "the stamp has no more bits")]
        let now = now_us as u16;
        let ahead = stamp.wrapping_sub(now).cast_signed();
        Some(Edge { is_rise: is_high, at_us: now_us.saturating_add_signed(ahead.into()), lost })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn edge(is_rise: bool, at_us: u64, lost: u32) -> Edge {
        Edge { is_rise, at_us, lost }
    }

    #[test]
    fn a_stamp_of_16_bits_is_extended_with_the_current_time_across_every_wrap() {
        let mut line = TriggerLine::new();
        assert_eq!(line.observe(true, 0xfff0, 0x1_0005), Some(edge(true, 0xfff0, 0)));
        assert_eq!(line.observe(false, 3, 0x1_0009), Some(edge(false, 0x1_0003, 0)));
        // This stamp is 2 us after `now_us`, past the wrap of 16 bits, so the upper bits count up.
        assert_eq!(line.observe(true, 1, 0x7_ffff_ffff), Some(edge(true, 0x8_0000_0001, 0)));
    }

    #[test]
    fn a_missed_edge_is_counted_and_no_edge_is_reported_twice() {
        let mut line = TriggerLine::new();
        line.reset(true, 7);
        assert_eq!(line.observe(true, 7, 20), None, "the state at the reset is no edge");
        assert_eq!(line.observe(true, 30, 31), Some(edge(true, 30, 1)), "it was low in between");
        assert_eq!(line.observe(true, 30, 40), None);
        assert_eq!(line.observe(false, 50, 51), Some(edge(false, 50, 0)));
    }

    #[test]
    fn a_bouncing_line_is_observed_as_often_as_its_budget_allows() {
        let mut line = TriggerLine::new();
        assert!(line.refill_budget(2));
        assert!(line.observe(true, 1, 1).is_some() && !line.budget_exhausted());
        assert!(line.observe(true, 1, 2).is_none() && line.budget_exhausted());
        assert!(line.refill_budget(2), "it was exhausted");
        assert!(!line.refill_budget(2), "two observations were left");
    }
}
