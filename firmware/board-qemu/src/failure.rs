//! What happens when something fails: a record for the next run, and a reset; and how near the stack is
//! to its end.
#![expect(unsafe_code, reason = "exception handlers, and memory with a place")]

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use firmware::{FaultRecord, Kept, Stack, deadlines};
use link::ResetInto;

use crate::{
    registers::{WATCHDOG, watchdog},
    time_driver::TICKS_PER_US,
};

unsafe extern "C" {
    /// The memory map keeps a place for it that nothing else uses.
    #[link_name = "_kept"]
    safe static KEPT: Kept;
}

unsafe extern "C" {
    /// The stack's ends in the memory map; of these only the addresses mean anything.
    static _stack_start: u32;
    static _stack_end: u32;
}

/// The stack of everything.
pub(crate) fn stack() -> Stack {
    let [end, start] = [&raw const _stack_end, &raw const _stack_start].map(<*const u32>::addr);
    // SAFETY: the memory map gives the region to the stack alone, and cortex-m-rt has painted it.
    unsafe { Stack::between(end, start) }
}

/// What the run before has left, once.
pub(crate) fn of_the_run_before() -> Option<FaultRecord> {
    critical_section::with(|section| KEPT.take(section))
}

/// Lets the watchdog count: it interrupts after its time, and resets after the same again.
pub(crate) fn begin_watchdog() {
    // Not half of it: a start that falls between two looks at the tasks may cost one feed.
    let us = u32::try_from(deadlines::WATCHDOG.as_micros()).unwrap_or(u32::MAX);
    WATCHDOG.write(watchdog::LOAD, us * TICKS_PER_US);
    WATCHDOG.write(watchdog::CONTROL, watchdog::INTERRUPT_THEN_RESET);
}

/// Lets the watchdog count from its beginning again.
pub(crate) fn feed_watchdog() {
    WATCHDOG.write(watchdog::CLEAR, 1);
}

fn fail(record: FaultRecord) -> ! {
    critical_section::with(|section| KEPT.put(section, record));
    SCB::sys_reset()
}

/// Starts anew, because the host has asked for it.
pub(crate) fn restart(into: ResetInto) -> ! {
    fail(FaultRecord::asked(into))
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    fail(FaultRecord::failed(info))
}

/// The watchdog's first end: a task hangs.
#[exception]
unsafe fn NonMaskableInt() {
    fail(FaultRecord::hung("a task made no progress: watchdog"))
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    let (pc, lr) = (frame.pc(), frame.lr());
    fail(FaultRecord::failed(format_args!(
        "hard fault at {pc:#010x}, called from {lr:#010x}"
    )))
}

/// A way to fail, for the sake of what comes after.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Failure {
    /// The encoder's executor never comes back.
    Hang,
    /// A task panics.
    Panic,
    /// A task executes what is no instruction.
    Fault,
}

impl Failure {
    pub(crate) const ALL: [Self; 3] = [Self::Hang, Self::Panic, Self::Fault];

    /// The argument that asks for it.
    pub(crate) const fn word(self) -> &'static str {
        match self {
            Self::Hang => "hang",
            Self::Panic => "panic",
            Self::Fault => "fault",
        }
    }

    /// Lets it happen.
    pub(crate) fn happen(self) {
        match self {
            Self::Hang => loop {
                cortex_m::asm::nop();
            },
            Self::Panic => panic!("asked to panic"),
            Self::Fault => cortex_m::asm::udf(),
        }
    }
}
