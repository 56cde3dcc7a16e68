//! Adapter between the emulated core and the emulator's bus.

use std::ops::Range;

use rigless::emulator::{Access, AccessKind, Checked, CoreBus, InterruptLine, Queued};
use rigless::time::VirtualNanos;

/// A range of addresses and where it is redirected to.
///
/// The emulator's register tables cover a peripheral's whole block; what they lack is modelled at a free
/// address, and the program does not notice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Redirect {
    /// The addresses the program uses.
    pub from: Range<u64>,
    /// The address that stands for the first of them.
    pub to: u64,
}

/// Bits of a register that read as 0, whatever the emulator's model has there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cleared {
    /// The register.
    pub(crate) address: u64,
    /// Its bits.
    pub(crate) bits: u64,
}

/// How the core's accesses differ from the emulator's part.
#[derive(Clone, Debug, Default)]
pub(crate) struct Differences {
    pub(crate) redirects: Vec<Redirect>,
    pub(crate) cleared: Vec<Cleared>,
}

/// The end of code and SRAM in the address map (ARM DDI 0403, B3.1): memory, which answers by itself.
const MEMORY_END: u64 = 0x4000_0000;

/// The bus that the core is lent.
pub(crate) struct Bus<'a> {
    pub(crate) inner: &'a mut dyn CoreBus,
    pub(crate) differences: &'a Differences,
    /// Accesses to memory that is not there: address, and the instruction.
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
    /// Memory that the part has is answered before; below its end nothing else does, and the bus fails the
    /// access. The emulator's own bus would answer 0.
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let reads = access.kind == AccessKind::Read;
        // The core's own reads, of vectors, are left to the emulator.
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
