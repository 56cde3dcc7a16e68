//! Runs the microcontroller's own boot loader, which is in the system memory, and resets the chip
//! after the boot loader has updated the program.
#![expect(unsafe_code, reason = "runs another program")]

use cortex_m::{asm, peripheral::SCB};
use firmware::failure::take_bootloader_request;

/// Boot loader that the manufacturer has built into a chip.
#[derive(Clone, Copy, Debug)]
pub enum Loader {
    /// Boot loader of the STM32H743, which is not at the start of the system memory.
    Stm32H743,
    /// Boot loader of the STM32F446, which is at the start of the system memory.
    Stm32F446,
}

impl Loader {
    /// Returns the address of the boot loader's vector table (AN2606).
    const fn vectors(self) -> u32 {
        match self {
            Self::Stm32H743 => 0x1ff0_9800,
            Self::Stm32F446 => 0x1fff_0000,
        }
    }

    /// If the host requested the boot loader before the last reset, calls `prepare` and runs the
    /// boot loader; in this case, the function does not return. If the boot loader has started this
    /// program, as it does after an update, resets the chip. Otherwise does nothing. `main` must
    /// call this function first, because the boot loader expects the chip in the state after a
    /// reset.
    pub fn run_if_requested(self, prepare: impl FnOnce()) {
        // SAFETY: `SCB::PTR` is the address of the core's own registers, which no other code of
        // this program uses yet.
        let scb = unsafe { &*SCB::PTR };
        let vectors = self.vectors();
        if !take_bootloader_request() {
            // The boot loader jumps here without a reset: its interrupts, clocks and USB core are
            // in use, and its vector table, somewhere in the system memory, stays set (AN3156,
            // leave DFU mode).
            if scb.vtor.read() >> 20 == vectors >> 20 {
                SCB::sys_reset();
            }
            return;
        }
        prepare();
        // SAFETY: no interrupt is enabled, and none of this program's vectors is used any more.
        unsafe { scb.vtor.write(vectors) };
        asm::dsb();
        // SAFETY: at `vectors`, the factory has programmed the loader's initial stack pointer and
        // entry point. This program ends here, and none of its peripherals is in use.
        unsafe { asm::bootload(vectors as *const u32) }
    }
}
