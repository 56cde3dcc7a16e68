//! What a virtual board is like when its power comes on.

use ads1299::Alignment;

/// The cable between a board and its host: an image talks over one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cable {
    /// The ST-LINK's, which carries the UART.
    Uart,
    /// A cable at the microcontroller's own USB.
    Usb,
}

/// What a virtual board is like when its power comes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setup {
    /// The ST-LINK's clock, Hz; 0 where it is missing.
    pub clock_hz: u64,
    /// The internal low-speed oscillator, Hz; none leaves it at its typical rate. 17 to 47 kHz on an
    /// STM32F446, 29.4 to 33.6 on an STM32H743 (DS10693 and DS12110, LSI characteristics).
    pub lsi_hz: Option<u64>,
    /// Whether the chain puts a don't-care bit between two chips.
    pub alignment: Alignment,
    /// The cable between the board and the host.
    pub cable: Cable,
    /// Whether the converters have power from the beginning; `Simulation::power_on` switches it on later.
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
