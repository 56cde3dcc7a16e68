//! Memory that a reset does not touch.
#![expect(
    unsafe_code,
    reason = "memory that nobody initialises may hold anything"
)]

use core::{cell::UnsafeCell, mem::MaybeUninit};

use critical_section::CriticalSection;

use crate::FaultRecord;

/// A place for a [`FaultRecord`] that outlives a reset: memory that neither the linker nor the start-up
/// gives to anything else. A board's memory map names it, and the board declares it as an external
/// static.
#[repr(transparent)]
pub struct Kept(UnsafeCell<MaybeUninit<FaultRecord>>);

// SAFETY: only reached within critical sections, which `CriticalSection` stands for.
unsafe impl Sync for Kept {}

impl Kept {
    /// What the run before has left, once.
    pub fn take(&self, _: CriticalSection<'_>) -> Option<FaultRecord> {
        // SAFETY: the critical section keeps everybody else away. All fields are integers, for which
        // any bits are values, and reading volatile keeps the compiler from knowing that none were
        // written.
        let record = unsafe { self.0.get().cast::<FaultRecord>().read_volatile() };
        // SAFETY: as above.
        unsafe { self.0.get().cast::<u32>().write_volatile(0) };
        record.is_sound().then_some(record)
    }

    /// Leaves a record to the next run.
    pub fn put(&self, _: CriticalSection<'_>, record: FaultRecord) {
        // SAFETY: as above; volatile, because nobody reads it in this run.
        unsafe { self.0.get().cast::<FaultRecord>().write_volatile(record) };
    }
}
