//! What differs between the USB cores of the two microcontrollers: addresses, sizes, and the bits
//! of other peripherals on which the core depends.

use rigless::soc::{Bus, Error, Layout};

/// Parameters of the USB core in one type of microcontroller.
#[derive(Debug)]
pub(crate) struct Instance {
    /// Name of the window in the emulator: a range of addresses that the model of the core serves.
    pub(crate) window: &'static str,
    /// Address of the core's first register on the chip.
    pub(crate) base: u64,
    /// Size in bytes of the core's address range, which includes the FIFOs.
    pub(crate) size: u64,
    /// First address of the window, in a range of addresses that the microcontroller does not use.
    pub(crate) window_base: u64,
    /// Numbers of the core's interrupts in the NVIC; only the global interrupt is used.
    pub(crate) interrupts: &'static [u16],
    /// Name of the emulator's own peripheral for this core, to which it passes the core's clock and
    /// reset line.
    pub(crate) global: &'static str,
    /// Number of endpoints per direction, endpoint 0 included.
    pub(crate) endpoints: usize,
    /// Size of the core's FIFO memory in words.
    pub(crate) fifo_words: u32,
    /// Value of the identification register `OTG_CID`.
    pub(crate) core_id: u32,
    /// Function that returns whether the core's bus clock is on, and the reason (supply or pins)
    /// why the transceiver is not connected to the cable; `None` if it is connected.
    pub(crate) supply: fn(&Bus, &Slots) -> (bool, Option<&'static str>),
}

/// Slots of the emulator in which it keeps the peripherals that the core depends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slots {
    rcc: usize,
    pwr: usize,
    gpioa: usize,
}

impl Slots {
    /// Finds the slots on the emulated bus of a microcontroller.
    ///
    /// # Errors
    ///
    /// If the part has no RCC, PWR or GPIOA.
    pub(crate) fn new(bus: &Bus) -> Result<Self, Error> {
        Ok(Self { rcc: bus.slot("RCC")?, pwr: bus.slot("PWR")?, gpioa: bus.slot("GPIOA")? })
    }
}

/// OTG_FS (USB2) of the STM32H743 on PA11 and PA12. Sources: RM0433 rev 9, table 8 (address), table
/// 147 (interrupt), 57.3 (9 endpoints, 4 KiB of FIFO).
///
/// The value of `OTG_CID` differs between revisions of the manual. embassy's driver takes 0x2300
/// for a core that has `VBDEN` in `OTG_GCCFG`, as in this microcontroller.
pub(crate) const H743_USB2: Instance = Instance {
    window: "USB2_OTG_FS",
    base: 0x4008_0000,
    size: 0x4_0000,
    window_base: 0x4400_0000,
    interrupts: &[101],
    global: "OTG2_HS_GLOBAL",
    endpoints: 9,
    fifo_words: 1_024,
    core_id: 0x2300,
    supply: h743_supply,
};

/// OTG_FS of the STM32F446 on PA11 and PA12. Sources: RM0390 rev 6, table 1 (address), table 38
/// (interrupt), 31.3 (6 endpoints, 1.25 KiB of FIFO), 31.16.15 (`OTG_CID`).
pub(crate) const F446_OTG_FS: Instance = Instance {
    window: "F446_OTG_FS",
    base: 0x5000_0000,
    size: 0x4_0000,
    window_base: 0x5400_0000,
    interrupts: &[67],
    global: "OTG_FS_GLOBAL",
    endpoints: 6,
    fifo_words: 320,
    core_id: 0x2000,
    supply: f446_supply,
};

/// Returns whether GPIOA's `MODER` and `AFRH` connect PA11 and PA12 to USB (function 10).
fn pins_are_usb(moder: u64, afrh: u64) -> bool {
    // MODER has two bits per pin, and 0b10 selects the alternate function; AFRH has four bits per
    // pin and starts with pin 8.
    moder >> 22 & 0xF == 0b1010 && afrh >> 12 & 0xFF == 0xAA
}

const PINS: &str = "PA11 and PA12 are not alternate function 10 (OTG_FS_DM, OTG_FS_DP)";

/// Returns the value of a register of the peripheral that is in the emulator's slot `slot`.
fn register_value<L: Layout>(bus: &Bus, slot: usize, register: L) -> u64 {
    bus.slots()[slot].registers().get(register)
}

/// Implements [`Instance::supply`] by `RCC_AHB1ENR.USB2OTGEN` (RM0433 8.7.40), `PWR_CR3.USB33DEN`
/// and the pins' settings.
fn h743_supply(bus: &Bus, slots: &Slots) -> (bool, Option<&'static str>) {
    use rigless::soc::stm32h743::generated::{gpioa, pwr, rcc};

    let is_clocked = register_value(bus, slots.rcc, rcc::Register::Ahb1enr) & 1 << 27 != 0;
    if register_value(bus, slots.pwr, pwr::Register::Cr3) & 1 << 24 == 0 {
        let unwired = "PWR_CR3.USB33DEN is clear (RM0433 6.8.4)";
        return (is_clocked, Some(unwired));
    }
    let moder = register_value(bus, slots.gpioa, gpioa::Register::Moder);
    let afrh = register_value(bus, slots.gpioa, gpioa::Register::Afrh);
    (is_clocked, (!pins_are_usb(moder, afrh)).then_some(PINS))
}

/// Implements [`Instance::supply`] by `RCC_AHB2ENR.OTGFSEN` (RM0390 6.3.11) and the pins' settings.
fn f446_supply(bus: &Bus, slots: &Slots) -> (bool, Option<&'static str>) {
    use rigless::soc::stm32f427::generated::{gpioa, rcc};

    let is_clocked = register_value(bus, slots.rcc, rcc::Register::Ahb2enr) & 1 << 7 != 0;
    let moder = register_value(bus, slots.gpioa, gpioa::Register::Moder);
    let afrh = register_value(bus, slots.gpioa, gpioa::Register::Afrh);
    (is_clocked, (!pins_are_usb(moder, afrh)).then_some(PINS))
}
