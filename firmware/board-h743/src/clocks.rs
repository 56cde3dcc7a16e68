//! Configuration of the chip's clocks: 480 MHz for the core, 25.6 MHz for SPI, 48 MHz for USB.

use board_stm32::{ClockSource, nvic_priority};
use embassy_stm32::{
    Config,
    rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource,
        Sysclk, VoltageScale, mux,
    },
    time::Hertz,
};
use firmware::deadlines::priority;

/// Frequency of the core after a reset, Hz; it then runs from the oscillator HSI (RM0433, RCC).
pub(crate) const AFTER_RESET_HZ: u32 = 64_000_000;

/// Returns the configuration of the clocks. Each clock has the same frequency whether the ST-LINK's
/// clock or the internal oscillator is the source.
pub(crate) fn config(source: ClockSource) -> Config {
    let mut config = Config::default();
    config.dma_interrupt_priority = nvic_priority(priority::DRDY);
    let rcc = &mut config.rcc;
    // The PLLs' input is 8 MHz: the ST-LINK's clock (UM2407), or HSI's 64 MHz divided by 8.
    let (source, prediv) = match source {
        ClockSource::StLink => {
            rcc.hse = Some(Hse {
                freq: Hertz(8_000_000),
                mode: HseMode::Bypass,
            });
            (PllSource::HSE, PllPreDiv::DIV1)
        }
        ClockSource::Internal => (PllSource::HSI, PllPreDiv::DIV8),
    };
    // The core's clock is 8 MHz * 120 / 2 = 480 MHz: the maximum of the chip's revision V, at the
    // highest core voltage (DS12110, section 6.3.1). PLL1's 960 MHz / 20 = 48 MHz clocks USB and
    // the random number generator, and is as accurate as the ST-LINK's crystal. The alternative for
    // USB, the oscillator HSI48, would need synchronisation by the unit CRS. But embassy-stm32
    // 0.6.0 synchronises CRS to the start of frame of USB1, and PA11 and PA12 belong to USB2
    // (RM0433, CRS_CFGR, SYNCSRC).
    rcc.pll1 = Some(Pll {
        source,
        prediv,
        mul: PllMul::MUL120,
        fracn: None,
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
    // SPI's clock is 8 MHz * 64 / 20 = 25.6 MHz. For registers, SPI divides it by 256 to 100 kHz,
    // and for bursts by 2 to 12.8 MHz, which is 136 us per sample.
    rcc.pll2 = Some(Pll {
        source,
        prediv,
        mul: PllMul::MUL64,
        fracn: None,
        divp: Some(PllDiv::DIV20),
        divq: None,
        divr: None,
    });
    rcc.mux.spi123sel = mux::Saisel::PLL2_P;
    config
}
