//! Record of why the firmware ended, kept in memory across the reset so that the next boot can
//! report it.
//!
//! The board's memory map provides three symbols. `_kept` is the start of memory that neither the
//! linker nor the start-up code uses; `_stack_start` and `_stack_end` are the bounds of the stack.
#![expect(unsafe_code, reason = "symbols of the memory map, and memory that nothing initialises")]

use core::{cell::UnsafeCell, mem::MaybeUninit};

use critical_section::CriticalSection;

use crate::{fault_record::FaultRecord, stack::Stack};

unsafe extern "C" {
    #[link_name = "_kept"]
    safe static KEPT: KeptRecord;
}

unsafe extern "C" {
    /// One past the highest address of the stack; `_stack_end` is the lowest address. Only the
    /// addresses of both symbols are used, never their contents.
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Returns the stack that all tasks and interrupts share.
pub fn stack() -> Stack {
    let [end, start] = [&raw const _stack_end, &raw const _stack_start].map(<*const u32>::addr);
    // SAFETY: the memory map reserves all words from `_stack_end` to `_stack_start` for the stack,
    // and cortex-m-rt has painted them.
    unsafe { Stack::from_bounds(end, start) }
}

/// Returns the record that the firmware left before the last reset, if there is a valid one, and
/// erases it.
pub fn previous_fault() -> Option<FaultRecord> {
    critical_section::with(|section| KEPT.take(section))
}

/// Returns whether the host requested the last reset to enter the microcontroller's own boot
/// loader, and erases this request. A record with another reason stays.
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

/// Stores `record` for the next boot and resets the microcontroller with `reset`.
pub fn end_run(record: FaultRecord, reset: fn() -> !) -> ! {
    critical_section::with(|section| KEPT.put(section, record));
    reset()
}

/// Memory for one record, which a reset leaves unchanged; after power-on its content is random.
#[repr(transparent)]
struct KeptRecord(UnsafeCell<MaybeUninit<FaultRecord>>);

// SAFETY: the cell is accessed only within critical sections, as the `CriticalSection` arguments
// prove.
unsafe impl Sync for KeptRecord {}

impl KeptRecord {
    fn take(&self, _: CriticalSection<'_>) -> Option<FaultRecord> {
        // SAFETY: the critical section excludes every other access. All fields are integers, for
        // which any bits are valid, and the volatile read keeps the compiler from assuming
        // uninitialised memory.
        let record = unsafe { self.0.get().cast::<FaultRecord>().read_volatile() };
        // SAFETY: the critical section excludes every other access. The pointer is valid for a
        // `u32`, because `FaultRecord` is `repr(C)` and begins with a `u32`.
        unsafe { self.0.get().cast::<u32>().write_volatile(0) };
        record.is_valid().then_some(record)
    }

    fn put(&self, _: CriticalSection<'_>, record: FaultRecord) {
        // SAFETY: the critical section excludes every other access. Volatile, so that the compiler
        // keeps the write, although nothing reads the record before the reset.
        unsafe { self.0.get().cast::<FaultRecord>().write_volatile(record) };
    }
}
