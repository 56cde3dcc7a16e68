//! A bus between the emulated core and the emulator that redirects or corrects some accesses.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rigless::emulator::{Access, AccessKind, Checked, CoreBus, InterruptLine, Queued};
use rigless::time::VirtualNanos;

/// A range of addresses whose accesses the bus sends to other addresses.
///
/// A register that the emulator's part lacks can be modelled only at a free address, because the
/// part's register tables cover the whole address block of a peripheral. The firmware still uses
/// the register's address on the chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Redirect {
    /// Addresses on the chip, which the firmware uses.
    pub(crate) from: Range<u64>,
    /// Address in the emulator that replaces the first address of `from`.
    pub(crate) to: u64,
}

/// Bits of a register that read as 0 while `holds` is true, whatever the emulator's model returns.
#[derive(Clone, Debug)]
pub(crate) struct ClearedBits {
    /// Address of the 32-bit register.
    pub(crate) address: u64,
    pub(crate) bits: u64,
    pub(crate) holds: Arc<AtomicBool>,
}

/// Differences of the emulated part from the chip, which the bus hides from the core.
#[derive(Clone, Debug, Default)]
pub(crate) struct Differences {
    pub(crate) redirects: Vec<Redirect>,
    pub(crate) cleared: Vec<ClearedBits>,
}

/// First address above the regions for code and SRAM in the address map (ARM DDI 0403, B3.1). An
/// access below it comes to this bus only if there is no memory at its address.
const MEMORY_END: u64 = 0x4000_0000;

/// Bus between the core and the emulator during one call of `Processor::run`.
pub(crate) struct Bus<'a> {
    pub(crate) inner: &'a mut dyn CoreBus,
    pub(crate) differences: &'a Differences,
    /// Refused accesses to addresses below [`MEMORY_END`]: address, and program counter if known.
    pub(crate) failed: &'a mut Vec<(u64, Option<u64>)>,
}

/// Defines methods that forward their call unchanged to the field `inner`.
macro_rules! forward {
    (
        &self: $(fn $shared:ident($($s:ident: $S:ty),*) $(-> $R:ty)?;)*
        &mut self: $(fn $exclusive:ident($($e:ident: $E:ty),*) $(-> $Q:ty)?;)*
    ) => {
        $(fn $shared(&self, $($s: $S),*) $(-> $R)? {
            self.inner.$shared($($s),*)
        })*
        $(fn $exclusive(&mut self, $($e: $E),*) $(-> $Q)? {
            self.inner.$exclusive($($e),*)
        })*
    };
}
pub(crate) use forward;

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
    /// Refuses accesses below [`MEMORY_END`], where the emulator's own bus would return 0. Only
    /// addresses without memory come here: the core accesses existing memory directly.
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let reads = access.kind == AccessKind::Read;
        // Pass reads that the core makes on its own, such as vector fetches, on to the emulator.
        if access.address < MEMORY_END && (from_code || !reads) {
            self.failed.push((access.address, access.program_counter));
            return None;
        }
        let value = self.inner.access(self.redirected(access), from_code)?;
        let cleared = self.differences.cleared.iter();
        let held = cleared.filter(|cleared| {
            cleared.address == access.address & !3 && cleared.holds.load(Ordering::Relaxed)
        });
        let shift = 8 * (access.address & 3);
        Some(held.fold(value, |value, held| value & !(held.bits >> shift)))
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

    forward! {
        &self:
        fn time(instructions: u64) -> VirtualNanos;
        &mut self:
        fn queued() -> Vec<Queued>;
        fn carry_on(instructions: u64, event: Option<VirtualNanos>) -> Option<u32>;
        fn acknowledge(line: InterruptLine, instructions: u64) -> Option<u64>;
        fn send_trace(bytes: &[u8]);
    }
}
