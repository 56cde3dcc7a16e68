//! The supplies of the chips.

use super::Board;

/// Whether the chips have power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Supply {
    /// The pins are driven and nothing answers.
    Off,
    /// Since a time, ns.
    On(u64),
}

impl Supply {
    pub(super) const fn is_on(self) -> bool {
        matches!(self, Self::On(_))
    }
}

impl<const CHIPS: usize> Board<CHIPS> {
    /// The supplies go: registers are lost, and DRDY stays high.
    pub(in crate::simulation) fn power_off(&mut self) {
        self.supply = Supply::Off;
        for chip in &mut self.chips {
            // As before a first reset.
            chip.reset(u64::MAX);
        }
        self.burst = None;
        self.is_deaf = None;
        self.convert_at(None);
    }

    /// The supplies come, for all chips at once; only a reset wakes the chips, and not too early.
    pub(in crate::simulation) fn power_on(&mut self) {
        if self.supply.is_on() {
            return;
        }
        self.supply = Supply::On(self.now_ns);
        if self.start {
            let settled = self.cycles() + u64::from(self.rate().settling());
            self.convert_at(Some(settled));
        }
    }

    /// Whether a reset that begins at a time comes late enough after the supplies; none without them.
    pub(super) fn may_reset_at(&self, since_ns: u64, power_on_ns: u64) -> Option<bool> {
        match self.supply {
            Supply::Off => None,
            Supply::On(on_ns) => Some(since_ns >= on_ns + power_on_ns),
        }
    }
}
