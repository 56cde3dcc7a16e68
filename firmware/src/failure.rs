//! End of a run of the firmware: the record of why it ended, kept across the reset for the next run.
//!
//! The board's memory map provides three symbols: `_kept`, start of memory that neither the linker nor the
//! start-up code uses, and `_stack_start` and `_stack_end`, the bounds of the stack.
#![expect(
    unsafe_code,
    reason = "symbols of the memory map, and memory that nothing initialises"
)]

use core::{cell::UnsafeCell, mem::MaybeUninit};

use critical_section::CriticalSection;

use crate::{fault_record::FaultRecord, stack::Stack};

unsafe extern "C" {
    #[link_name = "_kept"]
    safe static KEPT: KeptRecord;
}

unsafe extern "C" {
    /// One past the highest address of the stack. Only the addresses of these two symbols are used.
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Returns the stack that all tasks and interrupts share.
pub fn stack() -> Stack {
    let [end, start] = [&raw const _stack_end, &raw const _stack_start].map(<*const u32>::addr);
    // SAFETY: the memory map reserves the region for the stack, and cortex-m-rt has painted it.
    unsafe { Stack::from_bounds(end, start) }
}

/// Returns the record that the previous run left, and erases it.
pub fn previous_fault() -> Option<FaultRecord> {
    critical_section::with(|section| KEPT.take(section))
}

/// Returns whether the previous run ended with a request for the microcontroller's own boot loader, and
/// erases the request. A record of any other end stays.
pub fn take_bootloader_request() -> bool {
    critical_section::with(|section| {
        let Some(record) = KEPT.take(section) else {
            return false;
        };
        let is_request = record.requests_bootloader();
        if !is_request {
            KEPT.put(section, record);
        }
        is_request
    })
}

/// Leaves a record for the next run and resets the microcontroller.
pub fn end_run(record: FaultRecord, reset: fn() -> !) -> ! {
    critical_section::with(|section| KEPT.put(section, record));
    reset()
}

/// Memory that a reset leaves unchanged. After power-on its content is random.
#[repr(transparent)]
struct KeptRecord(UnsafeCell<MaybeUninit<FaultRecord>>);

// SAFETY: accessed only within critical sections, as the `CriticalSection` arguments prove.
unsafe impl Sync for KeptRecord {}

impl KeptRecord {
    fn take(&self, _: CriticalSection<'_>) -> Option<FaultRecord> {
        // SAFETY: the critical section excludes every other access. All fields are integers, for which any
        // bits are valid, and the volatile read keeps the compiler from assuming uninitialised memory.
        let record = unsafe { self.0.get().cast::<FaultRecord>().read_volatile() };
        // SAFETY: the critical section excludes every other access; the record begins with an aligned word.
        unsafe { self.0.get().cast::<u32>().write_volatile(0) };
        record.is_valid().then_some(record)
    }

    fn put(&self, _: CriticalSection<'_>, record: FaultRecord) {
        // SAFETY: the critical section excludes every other access. Volatile, because this run never reads
        // the record.
        unsafe { self.0.get().cast::<FaultRecord>().write_volatile(record) };
    }
}
