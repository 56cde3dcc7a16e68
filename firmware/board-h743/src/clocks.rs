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

/// Clocks at the HSE input from which [`config`] can derive all others.
pub(crate) const SOURCES: &[ClockSource] = &[ClockSource::StLink, ClockSource::StLinkCrystal];

/// Returns the configuration of the clocks. Each clock has the same frequency from every source.
pub(crate) fn config(source: ClockSource) -> Config {
    let mut config = Config::default();
    config.dma_interrupt_priority = nvic_priority(priority::DRDY);
    let rcc = &mut config.rcc;
    if let Some(hz) = source.hz() {
        rcc.hse = Some(Hse {
            freq: Hertz(hz),
            mode: HseMode::Bypass,
        });
    }
    // The PLLs' input is 8 MHz, from HSE or from HSI's 64 MHz divided by 8, or 25 MHz / 3. PLL1
    // makes 960 MHz of it, PLL2 512 MHz; a fraction is in 1/8192.
    let (source, prediv, [pll1, pll2]) = match source {
        ClockSource::StLink => (PllSource::HSE, PllPreDiv::DIV1, WHOLE),
        ClockSource::StLinkCrystal => {
            // embassy computes with whole hertz and rounds a quotient down. With this frequency, 2
            // ppm above the true one, the timers' 240 MHz do not become 239.
            if let Some(hse) = &mut rcc.hse {
                hse.freq = Hertz(8_333_350);
            }
            (PllSource::HSE, PllPreDiv::DIV1, FRACTIONAL)
        }
        ClockSource::NoClock | ClockSource::OtherClock => (PllSource::HSI, PllPreDiv::DIV8, WHOLE),
    };
    // The core's clock is 960 MHz / 2 = 480 MHz: the maximum of the chip's revision V, at the
    // highest core voltage (DS12110, section 7.3.1). 960 MHz / 20 = 48 MHz clocks USB and the random
    // number generator, and is as accurate as the source. The alternative for USB, the oscillator
    // HSI48, is exact to some per cent without the unit CRS, which the chip's errata forbid for the
    // start of frame of USB (ES0392, section 2.2.3).
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
    // SPI's clock is 512 MHz / 20 = 25.6 MHz. For registers, SPI divides it by 256 to 100 kHz, and
    // for bursts by 2 to 12.8 MHz, which is 136 us per sample.
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

/// Factor of a PLL: a whole part, and a fraction in 1/8192.
type Factor = (PllMul, Option<u16>);

/// Factors of PLL1 and PLL2 for an input of 8 MHz: 120 and 64.
const WHOLE: [Factor; 2] = [(PllMul::MUL120, None), (PllMul::MUL64, None)];

/// Factors of PLL1 and PLL2 for an input of 25 MHz / 3: 115.2 and 61.44, less 0.5 ppm.
const FRACTIONAL: [Factor; 2] = [(PllMul::MUL115, Some(1_638)), (PllMul::MUL61, Some(3_604))];
