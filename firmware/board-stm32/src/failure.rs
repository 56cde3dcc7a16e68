//! Panics and faults: each leaves a record for the next run and resets the chip.
#![expect(
    unsafe_code,
    reason = "the fault handler, which checks and reads the stack"
)]

use core::{arch::naked_asm, panic::PanicInfo};

use cortex_m::peripheral::SCB;
use defmt::{Display2Format, error};
use firmware::{
    FaultRecord,
    failure::{end_run, stack},
};
use link::ResetInto;

/// Bits of CFSR that report a failure to stack an exception's registers: MSTKERR, MLSPERR, STKERR and
/// LSPERR (ARM DDI 0403, B3.2.15).
const STACKING_FAILED: u32 = 1 << 4 | 1 << 5 | 1 << 12 | 1 << 13;

fn fail(record: FaultRecord) -> ! {
    end_run(record, SCB::sys_reset)
}

/// Resets the chip on the host's command.
pub(crate) fn restart(into: ResetInto) -> ! {
    fail(FaultRecord::from_restart(into))
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    error!("{}", Display2Format(info));
    fail(FaultRecord::from_failure(info))
}

/// Handles a hard fault. Sets the stack pointer back to the start of the stack if it is outside the stack or
/// has less than 2 KiB left, because a further fault in the handler would lock the core up. The stack frames
/// in an image show that the handler needs about half of that.
#[unsafe(export_name = "HardFault")]
#[unsafe(naked)]
unsafe extern "C" fn hard_fault() -> ! {
    naked_asm!(
        "mrs r0, msp",
        "ldr r1, =_stack_end",
        "add r1, r1, #2048",
        "ldr r2, =_stack_start",
        "cmp r0, r1",
        "blo 2f",
        "cmp r0, r2",
        "bls 3f",
        "2:",
        "msr msp, r2",
        "3:",
        "b {record}",
        record = sym record,
    )
}

/// Records a hard fault. `stacked` is where the core has stacked its registers: r0 to r3, r12, lr, pc, xpsr.
/// An address outside the stack is not read: there may be no memory, and a fault here locks the core up.
unsafe extern "C" fn record(stacked: *const [u32; 8]) -> ! {
    // SAFETY: the core's own registers; reading them has no side effect.
    let scb = unsafe { &*SCB::PTR };
    let cfsr = scb.cfsr.read();
    if cfsr & STACKING_FAILED != 0 {
        fail(FaultRecord::from_failure(format_args!(
            "stack overflow (CFSR {cfsr:#010x})"
        )))
    }
    if !stack().contains_words(stacked.addr(), 8) {
        fail(FaultRecord::from_failure(format_args!(
            "hard fault, stack pointer {stacked:p} outside the stack (CFSR {cfsr:#010x})"
        )))
    }
    // SAFETY: aligned words of the stack that the core has just written. This handler pushes below them, or
    // at the other end of the stack.
    let [.., lr, pc, _] = unsafe { stacked.read_volatile() };
    fail(FaultRecord::from_failure(format_args!(
        "hard fault at {pc:#010x}, called from {lr:#010x} (CFSR {cfsr:#010x})"
    )))
}
