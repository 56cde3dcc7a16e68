//! Addresses and registers of the emulated peripherals.
#![expect(unsafe_code, reason = "registers have addresses")]

/// Frequency of the clock of all peripherals, Hz (ARM DAI 0386 and 0400, application notes of the
/// FPGA images).
pub(crate) const CLOCK_HZ: u32 = 25_000_000;

/// Registers of one peripheral, which start at the address `base`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registers {
    base: usize,
}

/// Timer for the alarms of embassy-time (CMSDK, ARM DDI 0479, section 4.4).
pub(crate) const TIMER0: Registers = Registers { base: 0x4000_0000 };
/// Timer for the edges of DRDY (CMSDK, ARM DDI 0479, section 4.4).
pub(crate) const TIMER1: Registers = Registers { base: 0x4000_1000 };
/// First half of the dual timer: the free-running clock (CMSDK, ARM DDI 0479, section 4.5).
pub(crate) const DUAL_TIMER: Registers = Registers { base: 0x4000_2000 };
/// Second timer of the dual timer: generates the edges of the trigger (CMSDK, ARM DDI 0479, section
/// 4.5).
pub(crate) const DUAL_TIMER_SECOND: Registers = Registers { base: 0x4000_2020 };
/// UART to the host (CMSDK, ARM DDI 0479, section 4.3).
pub(crate) const UART0: Registers = Registers { base: 0x4000_4000 };
/// Watchdog (CMSDK, ARM DDI 0479, section 4.6).
pub(crate) const WATCHDOG: Registers = Registers { base: 0x4000_8000 };

/// Register offsets and values of the watchdog. A write to `CLEAR` reloads the watchdog's counter.
pub(crate) mod watchdog {
    pub(crate) const LOAD: usize = 0x0;
    pub(crate) const CONTROL: usize = 0x8;
    pub(crate) const CLEAR: usize = 0xc;
    /// Value of the control register: the first expiry raises an interrupt (the core's NMI), and
    /// the second one resets the board.
    pub(crate) const INTERRUPT_THEN_RESET: u32 = 0b11;
}

/// Register offsets and values of a timer.
pub(crate) mod timer {
    pub(crate) const CONTROL: usize = 0x0;
    pub(crate) const VALUE: usize = 0x4;
    pub(crate) const RELOAD: usize = 0x8;
    pub(crate) const INTERRUPT: usize = 0xc;
    /// Value of the control register: timer enabled, with interrupt.
    pub(crate) const RUN: u32 = 0b1001;
}

/// Register offsets and values of one half of the dual timer.
pub(crate) mod dual_timer {
    pub(crate) const LOAD: usize = 0x0;
    pub(crate) const VALUE: usize = 0x4;
    pub(crate) const CONTROL: usize = 0x8;
    pub(crate) const CLEAR: usize = 0xc;
    /// Value of the control register: timer enabled, free running, 32 bits, no interrupt.
    pub(crate) const RUN_FREELY: u32 = 0b1000_0010;
    /// Value of the control register: timer enabled, one-shot, 32 bits, with interrupt.
    pub(crate) const RUN_ONCE: u32 = 0b1010_0011;
}

/// Register offsets and bits of a UART.
pub(crate) mod uart {
    pub(crate) const DATA: usize = 0x0;
    pub(crate) const STATE: usize = 0x4;
    pub(crate) const CONTROL: usize = 0x8;
    pub(crate) const INTERRUPT: usize = 0xc;
    pub(crate) const BAUD_DIVIDER: usize = 0x10;
    /// Bit of the state register: the transmit buffer is full.
    pub(crate) const TRANSMIT_FULL: u32 = 1;
    /// Bit of the state register: the receive buffer holds a byte.
    pub(crate) const RECEIVE_FULL: u32 = 2;
}

impl Registers {
    #[inline]
    pub(crate) fn read(self, offset: usize) -> u32 {
        // SAFETY: `base` is the address of one of the peripherals above, and the callers pass the
        // offsets above, at which these peripherals have one-word registers. Reading a register has
        // no effect outside its peripheral.
        unsafe { ((self.base + offset) as *const u32).read_volatile() }
    }

    #[inline]
    pub(crate) fn write(self, offset: usize, value: u32) {
        // SAFETY: `base` is the address of one of the peripherals above, and the callers pass the
        // offsets above, at which these peripherals have one-word registers. No register starts an
        // access to memory.
        unsafe { ((self.base + offset) as *mut u32).write_volatile(value) }
    }
}
