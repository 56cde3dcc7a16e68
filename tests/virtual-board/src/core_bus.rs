//! Bus adapter that redirects or patches accesses of the emulated core.

use std::ops::Range;

use rigless::emulator::{Access, AccessKind, Checked, CoreBus, InterruptLine, Queued};
use rigless::time::VirtualNanos;

/// A redirected address range.
///
/// The emulator's register tables cover the whole block of a peripheral. Registers that they lack are modelled
/// at a free address; the firmware still uses the address of the real chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Redirect {
    /// Addresses that the firmware uses.
    pub(crate) from: Range<u64>,
    /// Address that replaces the first one of `from`.
    pub(crate) to: u64,
}

/// Register bits that always read as 0, whatever the emulator's model returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ClearedBits {
    /// Address of the 32-bit register.
    pub(crate) address: u64,
    pub(crate) bits: u64,
}

/// Differences between the emulator's part and the chip, as the core's accesses must see them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Differences {
    pub(crate) redirects: Vec<Redirect>,
    pub(crate) cleared: Vec<ClearedBits>,
}

/// First address after code and SRAM in the address map (ARM DDI 0403, B3.1). Accesses below it that reach
/// this bus hit no memory.
const MEMORY_END: u64 = 0x4000_0000;

/// Bus adapter that the core uses for one run.
pub(crate) struct Bus<'a> {
    pub(crate) inner: &'a mut dyn CoreBus,
    pub(crate) differences: &'a Differences,
    /// Failed accesses below [`MEMORY_END`]: the address, and the program counter if known.
    pub(crate) failed: &'a mut Vec<(u64, Option<u64>)>,
}

impl Bus<'_> {
    fn redirected(&self, mut access: Access) -> Access {
        let mut redirects = self.differences.redirects.iter();
        if let Some(redirect) = redirects.find(|redirect| redirect.from.contains(&access.address)) {
            access.address = access.address - redirect.from.start + redirect.to;
        }
        access
    }
}

impl CoreBus for Bus<'_> {
    /// Refuses accesses below [`MEMORY_END`], for which the emulator's own bus would return 0.
    /// Accesses to existing memory are served without a call of this function.
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let reads = access.kind == AccessKind::Read;
        // Vector fetches by the core itself are passed on to the emulator.
        if access.address < MEMORY_END && (from_code || !reads) {
            self.failed.push((access.address, access.program_counter));
            return None;
        }
        let value = self.inner.access(self.redirected(access), from_code)?;
        let mut cleared = self.differences.cleared.iter();
        let bits = cleared.find(|cleared| cleared.address == access.address & !3);
        let shift = 8 * (access.address & 3);
        Some(bits.map_or(value, |cleared| value & !(cleared.bits >> shift)))
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.inner.time(instructions)
    }

    fn queued(&mut self) -> Vec<Queued> {
        self.inner.queued()
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        self.inner.carry_on(instructions, event)
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.inner.acknowledge(line, instructions)
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.inner.read_checked(self.redirected(access), report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.inner.write_checked(self.redirected(access))
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        self.inner.stops_before(&self.redirected(*access))
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.inner.send_trace(bytes);
    }
}
