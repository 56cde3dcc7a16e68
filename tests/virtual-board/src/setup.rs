//! Settings of a virtual board at power-on: clocks, cable and converters.

use ads1299::Alignment;

/// Cable between a board and its host; each image supports only one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cable {
    /// The ST-LINK's cable, which carries the UART.
    Uart,
    /// A cable to the microcontroller's own USB port.
    Usb,
}

/// Configuration of a virtual board at power-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setup {
    /// Frequency of the external clock from the ST-LINK, in Hz; 0 for none.
    pub clock_hz: u64,
    /// Frequency of the internal low-speed oscillator, in Hz; `None` for the typical frequency. The range
    /// of the chip is 17 to 47 kHz (STM32F446) or 29.4 to 33.6 kHz (STM32H743; DS10693 and DS12110, LSI
    /// characteristics).
    pub lsi_hz: Option<u64>,
    /// Whether the chips send a don't-care bit between the data of two chips (`Spaced`) or not (`Packed`).
    pub alignment: Alignment,
    /// Cable to the host; must be the one that the image uses.
    pub cable: Cable,
    /// True if the converters have power from the start. Otherwise they have none until
    /// `Simulation::power_on` is called.
    pub converters_on: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            clock_hz: 8_000_000,
            lsi_hz: None,
            alignment: Alignment::Spaced,
            cable: Cable::Uart,
            converters_on: true,
        }
    }
}
