//! What happens when something fails: a record for the next run, and a reset.
#![expect(unsafe_code, reason = "exception handlers, and memory with a place")]

use core::{arch::naked_asm, panic::PanicInfo};

use cortex_m::peripheral::SCB;
use defmt::{Display2Format, error};
use firmware::{FaultRecord, Kept, Stack};
use link::ResetInto;

/// Stacking an exception's registers has failed: MSTKERR and MLSPERR, STKERR and LSPERR of CFSR
/// (ARM DDI 0403, B3.2.15).
const STACKING_FAILED: u32 = 1 << 4 | 1 << 5 | 1 << 12 | 1 << 13;

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

/// Whether the run before has ended so that the microcontroller's own loader runs, once. Any other end
/// stays what it was.
pub(crate) fn asks_for_loader() -> bool {
    critical_section::with(|section| {
        let Some(record) = KEPT.take(section) else {
            return false;
        };
        let asks = record.asks_for_bootloader();
        if !asks {
            KEPT.put(section, record);
        }
        asks
    })
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
    error!("{}", Display2Format(info));
    fail(FaultRecord::failed(info))
}

/// Starts the stack from its beginning where the pointer is outside it or has less than 2 KiB left: a
/// handler that pushes there would lock the core up. What it pushes is about half of that, from the
/// frames of an image.
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

/// `stacked` is where the core has put its registers: r0 to r3, r12, lr, pc, xpsr. Where that is not in
/// the stack nothing is read: it may be no memory at all, and a fault in here locks the core up.
unsafe extern "C" fn record(stacked: *const [u32; 8]) -> ! {
    // SAFETY: the core's own registers; reading them changes nothing.
    let scb = unsafe { &*SCB::PTR };
    let cfsr = scb.cfsr.read();
    if cfsr & STACKING_FAILED != 0 {
        fail(FaultRecord::failed(format_args!(
            "stack overflow (CFSR {cfsr:#010x})"
        )))
    }
    if !stack().contains_words(stacked.addr(), 8) {
        fail(FaultRecord::failed(format_args!(
            "hard fault, stack pointer {stacked:p} outside the stack (CFSR {cfsr:#010x})"
        )))
    }
    // SAFETY: aligned words of the stack, where the core has just written; what this handler pushes is
    // below, or at the other end of the stack.
    let [.., lr, pc, _] = unsafe { stacked.read_volatile() };
    fail(FaultRecord::failed(format_args!(
        "hard fault at {pc:#010x}, called from {lr:#010x} (CFSR {cfsr:#010x})"
    )))
}
