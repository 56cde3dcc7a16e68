//! A part's USB core: where it is, how large it is, and which bits of other peripherals it needs.

use rigless::soc::{Bus, Error, Layout};

/// One USB core of a part.
#[derive(Debug)]
pub struct Instance {
    /// Name of the window that the core's accesses are redirected to.
    pub window: &'static str,
    /// Address of the core's first register.
    pub base: u64,
    /// Bytes from there to the end of the last FIFO's addresses.
    pub size: u64,
    /// First address of the window, where the part has nothing.
    pub window_base: u64,
    /// Number of the core's global interrupt.
    pub interrupts: &'static [u16],
    /// Instance of the part whose clock and reset line are the core's.
    pub global: &'static str,
    /// Endpoints in each direction, with endpoint 0.
    pub endpoints: usize,
    /// Words of FIFO memory.
    pub fifo_words: u32,
    /// Value of `OTG_CID`.
    pub core_id: u32,
    /// Whether the bus clock of the core is on.
    pub is_clocked: fn(&Bus, &Slots) -> bool,
    /// Why the transceiver cannot reach the connector, if so: its supply or its pins.
    pub unwired: fn(&Bus, &Slots) -> Option<&'static str>,
}

/// Slots of the other peripherals that a core depends on.
#[derive(Clone, Copy, Debug)]
pub struct Slots {
    rcc: usize,
    pwr: usize,
    gpioa: usize,
}

impl Slots {
    /// The slots of the part with this `bus`.
    ///
    /// # Errors
    ///
    /// If the part has no RCC, PWR or GPIOA.
    pub fn new(bus: &Bus) -> Result<Self, Error> {
        Ok(Self {
            rcc: bus.slot("RCC")?,
            pwr: bus.slot("PWR")?,
            gpioa: bus.slot("GPIOA")?,
        })
    }
}

/// The STM32H743's core on PA11 and PA12, which ST calls OTG_FS or USB2: RM0433 rev 9, table 8 (address),
/// table 147 (interrupt), 57.3 (9 endpoints, 4 KiB of FIFO).
///
/// The manual's value of `OTG_CID` differs between revisions; embassy's driver, which runs on this part,
/// knows 0x2300 as a core with `VBDEN`.
pub const H743_USB2: Instance = Instance {
    window: "USB2_OTG_FS",
    base: 0x4008_0000,
    size: 0x4_0000,
    window_base: 0x4400_0000,
    interrupts: &[101],
    global: "OTG2_HS_GLOBAL",
    endpoints: 9,
    fifo_words: 1_024,
    core_id: 0x2300,
    is_clocked: h743::is_clocked,
    unwired: h743::unwired,
};

/// The STM32F446's OTG_FS on PA11 and PA12: RM0390 rev 6, table 1 (address), table 38 (interrupt), 31.3 (6
/// endpoints, 1.25 KiB of FIFO), 31.16.15 (`OTG_CID`).
pub const F446_OTG_FS: Instance = Instance {
    window: "F446_OTG_FS",
    base: 0x5000_0000,
    size: 0x4_0000,
    window_base: 0x5400_0000,
    interrupts: &[67],
    global: "OTG_FS_GLOBAL",
    endpoints: 6,
    fifo_words: 320,
    core_id: 0x2000,
    is_clocked: f446::is_clocked,
    unwired: f446::unwired,
};

/// Whether PA11 and PA12 carry alternate function 10, from GPIOA's `MODER` and `AFRH`.
fn pins_are_usb(moder: u64, afrh: u64) -> bool {
    // Two bits a pin, alternate function is 0b10; four bits a pin from pin 8 on.
    moder >> 22 & 0xF == 0b1010 && afrh >> 12 & 0xFF == 0xAA
}

const PINS: &str = "PA11 and PA12 are not alternate function 10 (OTG_FS_DM, OTG_FS_DP)";

/// What register `register` of the peripheral in `slot` holds.
fn held<L: Layout>(bus: &Bus, slot: usize, register: L) -> u64 {
    bus.slots()[slot].registers().get(register)
}

mod h743 {
    use rigless::soc::Bus;
    use rigless::soc::stm32h743::generated::{gpioa, pwr, rcc};

    use super::{PINS, Slots, held, pins_are_usb};

    /// `RCC_AHB1ENR.USB2OTGEN`, RM0433 8.7.40.
    pub(super) fn is_clocked(bus: &Bus, slots: &Slots) -> bool {
        held(bus, slots.rcc, rcc::Register::Ahb1enr) & 1 << 27 != 0
    }

    pub(super) fn unwired(bus: &Bus, slots: &Slots) -> Option<&'static str> {
        if held(bus, slots.pwr, pwr::Register::Cr3) & 1 << 24 == 0 {
            return Some("PWR_CR3.USB33DEN is clear (RM0433 6.8.4)");
        }
        let moder = held(bus, slots.gpioa, gpioa::Register::Moder);
        let afrh = held(bus, slots.gpioa, gpioa::Register::Afrh);
        (!pins_are_usb(moder, afrh)).then_some(PINS)
    }
}

mod f446 {
    use rigless::soc::Bus;
    use rigless::soc::stm32f427::generated::{gpioa, rcc};

    use super::{PINS, Slots, held, pins_are_usb};

    /// `RCC_AHB2ENR.OTGFSEN`, RM0390 6.3.11.
    pub(super) fn is_clocked(bus: &Bus, slots: &Slots) -> bool {
        held(bus, slots.rcc, rcc::Register::Ahb2enr) & 1 << 7 != 0
    }

    pub(super) fn unwired(bus: &Bus, slots: &Slots) -> Option<&'static str> {
        let moder = held(bus, slots.gpioa, gpioa::Register::Moder);
        let afrh = held(bus, slots.gpioa, gpioa::Register::Afrh);
        (!pins_are_usb(moder, afrh)).then_some(PINS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_pins_must_carry_the_alternate_function() {
        assert!(pins_are_usb(0b1010 << 22, 0xAA << 12));
        assert!(!pins_are_usb(0b1011 << 22, 0xAA << 12), "PA11 is analogue");
        assert!(
            !pins_are_usb(0b1010 << 22, 0x0A << 12),
            "PA12 is function 0"
        );
    }
}
