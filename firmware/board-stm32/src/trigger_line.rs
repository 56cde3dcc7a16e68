//! What the edges of the trigger's line are, from what its interrupt reads.

/// An edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Edge {
    /// It has risen.
    pub(crate) is_rise: bool,
    /// Device time, microseconds since boot.
    pub(crate) at_us: u64,
    /// Edges before it that nobody saw, at least.
    pub(crate) lost: u32,
}

/// The line, as it was seen last.
#[derive(Debug)]
pub(crate) struct TriggerLine {
    is_high: bool,
    /// The stamp of its last edge, lower 16 bits of the microseconds since boot.
    stamp: u16,
    /// Looks that may be taken until the next sample.
    left: usize,
}

impl TriggerLine {
    /// A line that is low, with nothing to look at.
    pub(crate) const fn new() -> Self {
        Self {
            is_high: false,
            stamp: 0,
            left: 0,
        }
    }

    /// How it is now; what was before is no edge.
    pub(crate) const fn begin(&mut self, is_high: bool, stamp: u16) {
        self.is_high = is_high;
        self.stamp = stamp;
    }

    /// So many looks may be taken from now on; gives whether there were none left.
    pub(crate) const fn allow(&mut self, looks: usize) -> bool {
        core::mem::replace(&mut self.left, looks) == 0
    }

    /// Whether no more looks may be taken.
    pub(crate) const fn is_spent(&self) -> bool {
        self.left == 0
    }

    /// The edge that a level and a stamp show, if they show a new one. The stamp belongs to the last
    /// edge, which is less than 32 ms older than `now_us`, or as much younger.
    ///
    /// Two edges alternate: where the level is that of before, the one between was lost.
    pub(crate) fn look(&mut self, is_high: bool, stamp: u16, now_us: u64) -> Option<Edge> {
        // Pulses that are too short for the timer count as well: looking is what takes time.
        self.left = self.left.saturating_sub(1);
        if is_high == self.is_high && stamp == self.stamp {
            return None;
        }
        let lost = u32::from(is_high == self.is_high);
        self.begin(is_high, stamp);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the stamp has no more bits"
        )]
        let now = now_us as u16;
        let ahead = stamp.wrapping_sub(now).cast_signed();
        Some(Edge {
            is_rise: is_high,
            at_us: now_us.saturating_add_signed(ahead.into()),
            lost,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn edge(is_rise: bool, at_us: u64, lost: u32) -> Edge {
        Edge {
            is_rise,
            at_us,
            lost,
        }
    }

    #[test]
    fn a_stamp_of_16_bits_is_placed_beside_the_time_across_every_wrap() {
        let mut line = TriggerLine::new();
        assert_eq!(
            line.look(true, 0xfff0, 0x1_0005),
            Some(edge(true, 0xfff0, 0))
        );
        assert_eq!(
            line.look(false, 3, 0x1_0009),
            Some(edge(false, 0x1_0003, 0))
        );
        // An edge between the reading of the time and that of the stamp.
        assert_eq!(
            line.look(true, 1, 0x7_ffff_ffff),
            Some(edge(true, 0x8_0000_0001, 0))
        );
    }

    #[test]
    fn an_edge_that_nobody_saw_is_counted_and_one_that_was_seen_is_not_seen_twice() {
        let mut line = TriggerLine::new();
        line.begin(true, 7);
        assert_eq!(line.look(true, 7, 20), None, "how it was at the start");
        assert_eq!(
            line.look(true, 30, 31),
            Some(edge(true, 30, 1)),
            "it was low"
        );
        assert_eq!(line.look(true, 30, 40), None);
        assert_eq!(line.look(false, 50, 51), Some(edge(false, 50, 0)));
    }

    #[test]
    fn a_line_that_bounces_is_looked_at_as_often_as_allowed() {
        let mut line = TriggerLine::new();
        assert!(line.allow(2));
        assert!(line.look(true, 1, 1).is_some() && !line.is_spent());
        assert!(line.look(true, 1, 2).is_none() && line.is_spent());
        assert!(line.allow(2), "it was spent");
        assert!(!line.allow(2), "it was not");
    }
}
