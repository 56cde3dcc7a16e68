//! Panics and faults: each leaves a record for the next boot and resets the chip.
#![expect(unsafe_code, reason = "the fault handler, which checks and reads the stack")]

use core::{arch::naked_asm, panic::PanicInfo};

use cortex_m::peripheral::SCB;
use defmt::{Display2Format, error};
use firmware::{
    FaultRecord,
    failure::{end_run, stack},
};
use link::ResetInto;

/// Bits of CFSR that report that the core could not push the registers at an exception: MSTKERR,
/// MLSPERR, STKERR and LSPERR (ARM DDI 0403, B3.2.15).
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

/// Handles a hard fault. If the stack pointer is outside the stack or has less than 2 KiB left,
/// first sets it back to the start of the stack: a further fault in the handler would lock up the
/// core. The handler needs about 1 KiB, as the stack frames of a compiled image show.
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

/// Records a hard fault. `stacked` is the address at which the core has pushed its registers: r0 to
/// r3, r12, lr, pc, xpsr. An address outside the stack is not read: there may be no memory, and a
/// fault in this handler locks up the core.
unsafe extern "C" fn record(stacked: *const [u32; 8]) -> ! {
    // SAFETY: `SCB::PTR` is the address of the core's own registers, which always exist. Reading
    // them has no side effect.
    let scb = unsafe { &*SCB::PTR };
    let cfsr = scb.cfsr.read();
    if cfsr & STACKING_FAILED != 0 {
        fail(FaultRecord::from_failure(format_args!("stack overflow (CFSR {cfsr:#010x})")))
    }
    if !stack().contains_words(stacked.addr(), 8) {
        fail(FaultRecord::from_failure(format_args!(
            "hard fault, stack pointer {stacked:p} outside the stack (CFSR {cfsr:#010x})"
        )))
    }
    // SAFETY: `stacked` points to aligned words within the stack, as checked above, which the core
    // has just written. This handler's stack frames are below these words or, after the stack
    // pointer was set back, at the other end of the stack.
    let [.., lr, pc, _] = unsafe { stacked.read_volatile() };
    fail(FaultRecord::from_failure(format_args!(
        "hard fault at {pc:#010x}, called from {lr:#010x} (CFSR {cfsr:#010x})"
    )))
}
