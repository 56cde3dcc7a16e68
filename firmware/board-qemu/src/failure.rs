//! Panics, faults and the watchdog: each failure leaves a record for the next boot and resets the
//! board. No test makes this image fail; `tests/virtual-board/tests/boards/failures.rs` tests the
//! failures of the images for the boards, which have their own handlers in `board-stm32`.
#![expect(unsafe_code, reason = "exception handlers")]

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use firmware::{FaultRecord, deadlines, failure::end_run};
use link::ResetInto;

use crate::{
    registers::{WATCHDOG, watchdog},
    time_driver::TICKS_PER_US,
};

/// Starts the watchdog. Its first expiry raises [`NonMaskableInt`], and the second one resets the
/// board.
pub(crate) fn start_watchdog() {
    // The first expiry must come after the watchdog's whole period, not half of it: if the watchdog
    // starts between two progress checks, the first check may not feed it.
    let us = u32::try_from(deadlines::WATCHDOG.as_micros()).unwrap_or(u32::MAX);
    WATCHDOG.write(watchdog::LOAD, us * TICKS_PER_US);
    WATCHDOG.write(watchdog::CONTROL, watchdog::INTERRUPT_THEN_RESET);
}

/// Restarts the watchdog's period.
pub(crate) fn feed_watchdog() {
    WATCHDOG.write(watchdog::CLEAR, 1);
}

fn fail(record: FaultRecord) -> ! {
    end_run(record, SCB::sys_reset)
}

/// Resets the board on the host's command.
pub(crate) fn restart(into: ResetInto) -> ! {
    fail(FaultRecord::from_restart(into))
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    fail(FaultRecord::from_failure(info))
}

/// Handles the first expiry of the watchdog, which means that a task hangs.
#[exception]
unsafe fn NonMaskableInt() {
    fail(FaultRecord::from_hang("a task made no progress: watchdog"))
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    let (pc, lr) = (frame.pc(), frame.lr());
    fail(FaultRecord::from_failure(format_args!(
        "hard fault at {pc:#010x}, called from {lr:#010x}"
    )))
}
