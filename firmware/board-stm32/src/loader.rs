//! The microcontroller's own loader, in memory that the factory has written.
#![expect(unsafe_code, reason = "runs a program that is not ours")]

use cortex_m::{asm, peripheral::SCB};

use crate::failure;

/// Whose loader it is.
#[derive(Clone, Copy, Debug)]
pub enum Loader {
    /// Of an STM32H743.
    Stm32H743,
    /// Of an STM32F446.
    Stm32F446,
}

impl Loader {
    /// Where its vectors are (AN2606). On the STM32H743 that is not where the system memory begins.
    const fn vectors(self) -> u32 {
        match self {
            Self::Stm32H743 => 0x1ff0_9800,
            Self::Stm32F446 => 0x1fff_0000,
        }
    }

    /// Runs the loader where the run before has ended for it, and else comes back; `prepare` is called
    /// just before. A board's first act: the loader wants everything as a reset leaves it.
    pub fn run_if_asked(self, prepare: impl FnOnce()) {
        if !failure::asks_for_loader() {
            return;
        }
        prepare();
        let vectors = self.vectors();
        // SAFETY: the core's own registers, of which this program has given none away yet.
        let scb = unsafe { &*SCB::PTR };
        // SAFETY: no interrupt is enabled, and none of this program's vectors is used any more.
        unsafe { scb.vtor.write(vectors) };
        asm::dsb();
        // SAFETY: the chip's factory has written stack and entry there; this program ends here, and none
        // of its peripherals is in use.
        unsafe { asm::bootload(vectors as *const u32) }
    }
}
