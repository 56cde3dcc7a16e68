//! Configuration of the chip's clocks: 480 MHz for the core, 25.6 MHz for SPI, 48 MHz for USB.

use board_stm32::{ClockSource, KnownClock, nvic_priority};
use embassy_stm32::{
    Config,
    rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource,
        Sysclk, VoltageScale, mux,
    },
    time::Hertz,
};
use firmware::deadlines::priority;

/// Frequency of the core directly after a reset, when it runs from the oscillator HSI, Hz (RM0433,
/// RCC).
pub(crate) const AFTER_RESET_HZ: u32 = 64_000_000;

/// Clocks at the HSE input from which [`config`] can derive all others. They are measured with HSI,
/// which is accurate to 1.5 % (DS12110, section 7.3.9); the range of the ST-LINK's crystal follows
/// from this accuracy. The range of the ST-LINK's RC oscillator is wider. A frequency between the
/// two ranges counts as neither clock.
pub(crate) const SOURCES: &[KnownClock] = &[
    (ClockSource::StLink, 7_760_000..=8_160_000),
    (ClockSource::StLinkCrystal, 8_200_000..=8_470_000),
];

/// Returns the configuration of the clocks. Their frequencies do not depend on the source.
pub(crate) fn config(source: ClockSource) -> Config {
    let mut config = Config::default();
    config.dma_interrupt_priority = nvic_priority(priority::DRDY);
    let rcc = &mut config.rcc;
    let inputs = Inputs::of(source);
    if let Some(hz) = inputs.hse_hz {
        rcc.hse = Some(Hse { freq: Hertz(hz), mode: HseMode::Bypass });
    }
    let Inputs { source, prediv, pll1, pll2, .. } = inputs;
    // The core's clock is 960 MHz / 2 = 480 MHz: the maximum of the chip's revision V, at the
    // highest core voltage (DS12110, section 7.3.1). 960 MHz / 20 = 48 MHz clocks USB and the
    // random number generator, and is as accurate as the source. The alternative for USB, the
    // oscillator HSI48, is accurate only to a few per cent without the unit CRS. embassy-stm32
    // 0.6.0 synchronises CRS to USB1, but PA11 and PA12 belong to USB2 (RM0433, CRS_CFGR, SYNCSRC);
    // for some revisions the errata list the synchronisation by USB (ES0392, section 2.2.3).
    rcc.pll1 = Some(Pll {
        source,
        prediv,
        mul: pll1.0,
        fracn: pll1.1,
        divp: Some(PllDiv::DIV2),
        divq: Some(PllDiv::DIV20),
        divr: None,
    });
    rcc.hsi48 = None;
    rcc.mux.usbsel = mux::Usbsel::PLL1_Q;
    rcc.mux.rngsel = mux::Rngsel::PLL1_Q;
    rcc.voltage_scale = VoltageScale::Scale0;
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV2;
    rcc.apb1_pre = APBPrescaler::DIV2;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.apb3_pre = APBPrescaler::DIV2;
    rcc.apb4_pre = APBPrescaler::DIV2;
    // SPI's input clock is 512 MHz / 20 = 25.6 MHz. SPI divides it by 256 for registers (100 kHz)
    // and by 2 for bursts (12.8 MHz, 136 us per sample).
    rcc.pll2 = Some(Pll {
        source,
        prediv,
        mul: pll2.0,
        fracn: pll2.1,
        divp: Some(PllDiv::DIV20),
        divq: None,
        divr: None,
    });
    rcc.mux.spi123sel = mux::Saisel::PLL2_P;
    config
}

/// Input clock of the PLLs, and the factors by which PLL1 raises it to 960 MHz and PLL2 to 512 MHz.
struct Inputs {
    source: PllSource,
    prediv: PllPreDiv,
    /// Frequency of HSE in Hz as passed to embassy, which must compute exactly 960 MHz from it.
    /// embassy uses whole hertz and single precision: with 1 Hz less, the timers' 240 MHz would
    /// become 239.
    hse_hz: Option<u32>,
    pll1: Factor,
    pll2: Factor,
}

/// Factor of a PLL: a whole part, and a fraction in 1/8192.
type Factor = (PllMul, Option<u16>);

impl Inputs {
    const fn of(source: ClockSource) -> Self {
        match source {
            // PLL1 multiplies 8 MHz by 120, PLL2 by 64.
            ClockSource::StLink => Self {
                source: PllSource::HSE,
                prediv: PllPreDiv::DIV1,
                hse_hz: Some(8_000_000),
                pll1: (PllMul::MUL120, None),
                pll2: (PllMul::MUL64, None),
            },
            // PLL1 multiplies 25 MHz / 9 by 345.6, PLL2 by 184.32 less 0.3 ppm.
            ClockSource::StLinkCrystal => Self {
                source: PllSource::HSE,
                prediv: PllPreDiv::DIV3,
                hse_hz: Some(8_333_334),
                pll1: (PllMul::MUL345, Some(4_915)),
                pll2: (PllMul::MUL184, Some(2_621)),
            },
            // PLL1 multiplies 64 MHz / 20 by 300, PLL2 by 160. The board has no crystal at HSE.
            ClockSource::NoClock | ClockSource::OtherClock | ClockSource::Crystal => Self {
                source: PllSource::HSI,
                prediv: PllPreDiv::DIV20,
                hse_hz: None,
                pll1: (PllMul::MUL300, None),
                pll2: (PllMul::MUL160, None),
            },
        }
    }
}
