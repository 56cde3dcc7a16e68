//! Clock tree: 168 MHz for the core, 21 MHz for SPI, 48 MHz for USB.

use board_stm32::{ClockSource, nvic_priority};
use embassy_stm32::{
    Config,
    pac::FLASH,
    rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv,
        PllSource, Sysclk, mux,
    },
    time::Hertz,
};
use firmware::deadlines::priority;

/// Frequency of the core after a reset, Hz: the internal oscillator HSI (RM0390, RCC).
pub(crate) const AFTER_RESET_HZ: u32 = 16_000_000;

/// Returns the configuration of the clocks. Both sources lead to the same frequencies.
pub(crate) fn config(source: ClockSource) -> Config {
    let mut config = Config::default();
    config.dma_interrupt_priority = nvic_priority(priority::DRDY);
    let rcc = &mut config.rcc;
    // The PLL's input is 2 MHz: a quarter of the ST-LINK's 8 MHz (UM1724), or an eighth of HSI's 16 MHz.
    let (source, prediv) = match source {
        ClockSource::StLink => {
            rcc.hse = Some(Hse {
                freq: Hertz(8_000_000),
                mode: HseMode::Bypass,
            });
            (PllSource::HSE, PllPreDiv::DIV4)
        }
        ClockSource::Internal => (PllSource::HSI, PllPreDiv::DIV8),
    };
    // 2 MHz * 168 = 336 MHz; the core runs at half of that, and USB at a seventh. A core at 180 MHz would
    // need another PLL for USB's 48 MHz.
    rcc.pll_src = source;
    rcc.pll = Some(Pll {
        prediv,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.mux.clk48sel = mux::Clk48sel::PLL1_Q;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    // APB1, the bus of SPI and UART, runs at 21 MHz. SPI divides that by 256, to 82 kHz for registers, and by
    // 2, to 10.5 MHz for bursts: 165 us per sample. From 42 MHz registers would be clocked at 164 kHz, which
    // is too fast.
    // The UART divides 21 MHz by 23: 913,043 baud, 0.93 % below the nominal 921,600. 42 MHz / 46 and
    // oversampling by 8 are no closer. The ST-LINK runs at 923,077 baud (36 MHz / 39, from memory, not
    // checked against a document). The two ends differ by 1.1 %, and a receiver tolerates 3.33 % (RM0390,
    // USART, tolerance of the receiver to clock deviation). With a core at 162 MHz the UART would be 0.12 %
    // below the nominal rate, but USB would have no 48 MHz.
    rcc.apb1_pre = APBPrescaler::DIV8;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

/// Enables prefetch and caches of the flash, which hide its five wait states (RM0390, FLASH_ACR).
pub(crate) fn enable_flash_accelerator() {
    FLASH.acr().modify(|access| {
        access.set_prften(true);
        access.set_icen(true);
        access.set_dcen(true);
    });
}
