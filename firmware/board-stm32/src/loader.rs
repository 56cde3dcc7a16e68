//! Jump into the microcontroller's own boot loader, in its system memory.
#![expect(unsafe_code, reason = "runs another program")]

use cortex_m::{asm, peripheral::SCB};
use firmware::failure::take_bootloader_request;

/// Boot loader of a chip.
#[derive(Clone, Copy, Debug)]
pub enum Loader {
    /// STM32H743.
    Stm32H743,
    /// STM32F446.
    Stm32F446,
}

impl Loader {
    /// Address of the boot loader's vector table (AN2606). On the STM32H743 it is not the start of the
    /// system memory.
    const fn vectors(self) -> u32 {
        match self {
            Self::Stm32H743 => 0x1ff0_9800,
            Self::Stm32F446 => 0x1fff_0000,
        }
    }

    /// Calls `prepare` and runs the boot loader if the previous run ended with a request for the loader;
    /// returns otherwise. `main` calls this first, because the boot loader expects the chip as a reset leaves
    /// it.
    pub fn run_if_requested(self, prepare: impl FnOnce()) {
        if !take_bootloader_request() {
            return;
        }
        prepare();
        let vectors = self.vectors();
        // SAFETY: the core's own registers, which no other code of this program uses yet.
        let scb = unsafe { &*SCB::PTR };
        // SAFETY: no interrupt is enabled, and none of this program's vectors is used any more.
        unsafe { scb.vtor.write(vectors) };
        asm::dsb();
        // SAFETY: the factory has programmed the loader's stack pointer and entry point at this address. This
        // program ends here, and none of its peripherals is in use.
        unsafe { asm::bootload(vectors as *const u32) }
    }
}
