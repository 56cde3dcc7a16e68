//! Configuration of the chip's clocks: 168 MHz for the core, 21 MHz for SPI, 48 MHz for USB.

use embassy_stm32::{
    Config,
    pac::{DBGMCU, FLASH},
    rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv,
        PllSource, Sysclk,
    },
    time::Hertz,
};
use firmware::deadlines::priority;

use crate::clock_source::ClockSource;
use crate::interrupts::nvic_priority;

/// Frequency of the core directly after a reset, when it runs from the oscillator HSI, Hz (RM0390
/// and RM0090, RCC).
pub const AFTER_RESET_HZ: u32 = 16_000_000;

/// Returns the configuration of the clocks. The frequencies are the same with 8 MHz at the HSE
/// input as with the internal oscillator.
pub fn config(source: ClockSource) -> Config {
    let mut config = Config::default();
    config.dma_interrupt_priority = nvic_priority(priority::DRDY);
    let rcc = &mut config.rcc;
    // The PLL's input is 2 MHz: the 8 MHz at the HSE input divided by 4, or HSI's 16 MHz divided by
    // 8.
    let hse = |mode| Hse { freq: Hertz(8_000_000), mode };
    rcc.hse = match source {
        ClockSource::Crystal => Some(hse(HseMode::Oscillator)),
        ClockSource::StLink => Some(hse(HseMode::Bypass)),
        _ => None,
    };
    let (source, prediv) = if rcc.hse.is_some() {
        (PllSource::HSE, PllPreDiv::DIV4)
    } else {
        (PllSource::HSI, PllPreDiv::DIV8)
    };
    // The PLL runs at 2 MHz * 168 = 336 MHz; half of that clocks the core, and a seventh clocks
    // USB. 168 MHz are the maximum of the STM32F407. With the STM32F446 at its maximum of 180 MHz,
    // USB's 48 MHz would need another PLL.
    rcc.pll_src = source;
    rcc.pll = Some(Pll {
        prediv,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    // APB1, the bus of SPI and UART, runs at 21 MHz. For bursts, SPI divides this by 2 to 10.5 MHz,
    // which is 165 us per sample. For registers, SPI divides it by 256, its largest divider, to 82
    // kHz; the resistors at the converters' DOUT allow at most 105 kHz. From an APB1 of 42 MHz the
    // slowest SPI clock would be 164 kHz, which is too fast.
    //
    // The UART divides 21 MHz by 23: 913,043 baud, 0.93 % below the nominal 921,600. Neither 42 MHz
    // / 46 nor oversampling by 8 comes closer. The ST-LINK/V2-1's rate is derived, not measured:
    // its STM32F103 clocks a UART with at most 36 or 72 MHz, from which the nearest rate is 923,077
    // baud (36 MHz / 39 or 72 MHz / 78). The two ends then differ by 1.1 %, and a receiver
    // tolerates 3.33 % (RM0390, USART, tolerance of the receiver to clock deviation). With a core
    // at 162 MHz the UART would be 0.12 % below the nominal rate, but USB would have no 48 MHz.
    rcc.apb1_pre = APBPrescaler::DIV8;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

/// Device and revision ids (DBGMCU_IDCODE) of the STM32F405 and STM32F407 in revision A, which does
/// not prefetch correctly: STM32CubeF4 enables the prefetch from revision Z on. Because of an
/// erratum, these chips can report the device id 0x411 (as handled in OpenOCD's `stm32f2x.c`).
const WITHOUT_PREFETCH: [(u16, u16); 2] = [(0x411, 0x1000), (0x413, 0x1000)];

/// Enables the caches of the flash and, where it works, the prefetch. Both hide the flash's five
/// wait states (RM0390 and RM0090, FLASH_ACR).
pub fn enable_flash_accelerator() {
    let id = DBGMCU.idcode().read();
    let prefetches = !WITHOUT_PREFETCH.contains(&(id.dev_id(), id.rev_id()));
    FLASH.acr().modify(|access| {
        access.set_prften(prefetches);
        access.set_icen(true);
        access.set_dcen(true);
    });
}
