//! The peripherals' registers.
#![expect(unsafe_code, reason = "registers have addresses")]

/// The clock of all peripherals, Hz (ARM DAI 0386 and 0400, the FPGA images' application notes).
pub(crate) const CLOCK_HZ: u32 = 25_000_000;

/// Registers of a peripheral.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registers {
    base: usize,
}

/// Timer 0 and 1 (CMSDK, ARM DDI 0479, section 4.4): control, value, reload, interrupt.
pub(crate) const TIMER0: Registers = Registers { base: 0x4000_0000 };
pub(crate) const TIMER1: Registers = Registers { base: 0x4000_1000 };
/// First half of the dual timer (section 4.5): load, value, control.
pub(crate) const DUAL_TIMER: Registers = Registers { base: 0x4000_2000 };
/// And the second one.
pub(crate) const DUAL_TIMER_SECOND: Registers = Registers { base: 0x4000_2020 };
/// UART 0 (section 4.3): data, state, control, interrupt, baud divider.
pub(crate) const UART0: Registers = Registers { base: 0x4000_4000 };
/// Watchdog (section 4.6): load, value, control, interrupt clear.
pub(crate) const WATCHDOG: Registers = Registers { base: 0x4000_8000 };

/// Of the watchdog, which counts down: what it begins with, how, and beginning anew.
pub(crate) mod watchdog {
    pub(crate) const LOAD: usize = 0x0;
    pub(crate) const CONTROL: usize = 0x8;
    pub(crate) const CLEAR: usize = 0xc;
    /// The first time it ends, an interrupt (the core's NMI); the second time, a reset.
    pub(crate) const INTERRUPT_THEN_RESET: u32 = 0b11;
}

/// Of a timer.
pub(crate) mod timer {
    pub(crate) const CONTROL: usize = 0x0;
    pub(crate) const VALUE: usize = 0x4;
    pub(crate) const RELOAD: usize = 0x8;
    pub(crate) const INTERRUPT: usize = 0xc;
    /// Enabled, with interrupt.
    pub(crate) const RUN: u32 = 0b1001;
}

/// Of a half of the dual timer.
pub(crate) mod dual_timer {
    pub(crate) const LOAD: usize = 0x0;
    pub(crate) const VALUE: usize = 0x4;
    pub(crate) const CONTROL: usize = 0x8;
    pub(crate) const CLEAR: usize = 0xc;
    /// Enabled, free running, 32 bits, no interrupt.
    pub(crate) const RUN_FREELY: u32 = 0b1000_0010;
    /// Enabled, 32 bits, with interrupt, and still after it.
    pub(crate) const RING_ONCE: u32 = 0b1010_0011;
}

/// Of a UART.
pub(crate) mod uart {
    pub(crate) const DATA: usize = 0x0;
    pub(crate) const STATE: usize = 0x4;
    pub(crate) const CONTROL: usize = 0x8;
    pub(crate) const INTERRUPT: usize = 0xc;
    pub(crate) const BAUD_DIVIDER: usize = 0x10;
    /// State: no room to send; something received.
    pub(crate) const SENDING: u32 = 1;
    pub(crate) const RECEIVED: u32 = 2;
}

impl Registers {
    #[inline]
    pub(crate) fn read(self, offset: usize) -> u32 {
        // SAFETY: the constants above are peripherals of the board, whose registers are words; reads
        // of those that are used here have no effect beyond the peripheral.
        unsafe { ((self.base + offset) as *const u32).read_volatile() }
    }

    #[inline]
    pub(crate) fn write(self, offset: usize, value: u32) {
        // SAFETY: as above; none of them reaches memory.
        unsafe { ((self.base + offset) as *mut u32).write_volatile(value) }
    }
}
