//! The clock tree: 168 MHz for the core, 21 MHz for SPI, 48 MHz for USB.

use board_stm32::prioritise;
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

/// What the chip starts with.
pub(crate) fn config() -> Config {
    let mut config = Config::default();
    config.dma_interrupt_priority = prioritise(priority::DRDY);
    let rcc = &mut config.rcc;
    // The ST-LINK gives 8 MHz (UM1724).
    rcc.hse = Some(Hse {
        freq: Hertz(8_000_000),
        mode: HseMode::Bypass,
    });
    // 8 MHz / 4 * 168 = 336 MHz; the core has half of it, and USB a seventh. 180 MHz would want another
    // PLL for USB's 48.
    rcc.pll_src = PllSource::HSE;
    rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.mux.clk48sel = mux::Clk48sel::PLL1_Q;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    // 21 MHz. SPI divides it by 256, 82 kHz for registers, and by 2, 10.5 MHz for bursts: 165 us for a
    // sample. 42 MHz would clock registers at 164 kHz, which is too fast.
    // The UART divides it by 23: 913,043 baud, -0.93 %; 42 MHz / 46 and oversampling by 8 are no nearer.
    // The ST-LINK has 923,077 (36 MHz / 39, from memory): 1.1 % apart of the 3.33 % that a receiver
    // tolerates (RM0390, USART, tolerance of the receiver to clock deviation). A core at 162 MHz would
    // have -0.12 %, and no 48 MHz for USB.
    rcc.apb1_pre = APBPrescaler::DIV8;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

/// Lets the flash's accelerator hide its five wait states (RM0390, FLASH_ACR).
pub(crate) fn accelerate() {
    FLASH.acr().modify(|access| {
        access.set_prften(true);
        access.set_icen(true);
        access.set_dcen(true);
    });
}
