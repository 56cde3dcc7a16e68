//! Switching the chips' supplies.

use crate::simulation::board::Board;
use crate::simulation::supply::Supply;

impl<const CHIPS: usize> Board<CHIPS> {
    /// Switches the supplies off: registers are lost, and DRDY stays high.
    pub(in crate::simulation) fn power_off(&mut self) {
        self.supply = Supply::Off;
        for chip in &mut self.chips {
            // The chip accepts no command until the next reset.
            chip.reset(u64::MAX);
        }
        self.burst = None;
        self.is_deaf = None;
        self.convert_at(None);
    }

    /// Switches the supplies of all chips on. The chips accept commands only after a reset, which must
    /// not start before the power-on time has passed.
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

    /// Returns whether a reset that starts at `since_ns` is at least `power_on_ns` after power-on; `None`
    /// without power.
    pub(super) fn may_reset_at(&self, since_ns: u64, power_on_ns: u64) -> Option<bool> {
        match self.supply {
            Supply::Off => None,
            Supply::On(on_ns) => Some(since_ns >= on_ns + power_on_ns),
        }
    }
}
