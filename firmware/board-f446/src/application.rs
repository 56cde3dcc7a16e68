//! Starts the application on the board: sets up pins, clocks and memory, then starts the tasks.

use board_stm32::{
    Board, ClockSource, FRAME_BYTES, HseInput, KnownClock, Loader, Trigger, init_chip, sleep,
    start_tasks, start_watchdog, stm32f4,
};
use cortex_m_rt::entry;
use embassy_executor::SpawnError;
use embassy_stm32::{
    Peri, bind_interrupts, dma, pac,
    peripherals::{DMA1_CH3, DMA1_CH4, IWDG},
    rcc::mux,
};
use static_cell::ConstStaticCell;

use crate::parts::Parts;

bind_interrupts!(struct Irqs {
    DMA1_STREAM4 => dma::InterruptHandler<DMA1_CH4>;
    DMA1_STREAM3 => dma::InterruptHandler<DMA1_CH3>;
});

#[cfg(feature = "uart")]
use {
    crate::uart::Usart2,
    board_stm32::{PortMemory, UartInterrupt},
    embassy_stm32::peripherals::{DMA1_CH5, DMA1_CH6},
};
#[cfg(feature = "uart")]
bind_interrupts!(struct UartIrqs {
    USART2 => UartInterrupt<Usart2>;
    DMA1_STREAM6 => dma::InterruptHandler<DMA1_CH6>;
    DMA1_STREAM5 => dma::InterruptHandler<DMA1_CH5>;
});

/// Clock that the NUCLEO-F446RE's ST-LINK supplies at the HSE input (UM1724, section 6.7.1). The
/// range is wide because the oscillator HSI, against which the clock is measured, is up to 8 % off
/// when warm or cold (as on the STM32F407, DS8626).
const SOURCES: &[KnownClock] = &[(ClockSource::StLink, 7_360_000..=8_640_000)];

#[entry]
fn main() -> ! {
    // The boot loader comes first, because it needs the chip in the state in which the reset left
    // it.
    Loader::Stm32F446.run_if_requested(stm32f4::map_system_memory);
    stm32f4::freeze_watchdog_in_debug();
    start_watchdog(pac::IWDG);
    let clock = ClockSource::find(
        stm32f4::AFTER_RESET_HZ,
        HseInput::Clock,
        &mut stm32f4::HseTimer,
        SOURCES,
    );
    let mut config = stm32f4::config(clock);
    config.rcc.mux.clk48sel = mux::Clk48sel::PLL1_Q;
    let parts = Parts::new(init_chip(config));
    // Spawning a task twice is an error in the image. Panic, because no task runs yet that could
    // report the error.
    start(parts, clock).expect("every task is spawned once");
    sleep()
}

#[embassy_executor::task]
async fn feed_watchdog(watchdog: Peri<'static, IWDG>) {
    board_stm32::feed_watchdog(watchdog).await;
}

/// Buffer through which the DMA transfers SPI data to and from the converters.
static SPI_BUFFER: ConstStaticCell<[u8; FRAME_BYTES]> = ConstStaticCell::new([0; FRAME_BYTES]);

#[cfg(feature = "uart")]
static PORT_MEMORY: ConstStaticCell<PortMemory> = ConstStaticCell::new(PortMemory::EMPTY);

fn start(parts: Parts, clock: ClockSource) -> Result<(), SpawnError> {
    let reset_cause = stm32f4::take_cause();
    stm32f4::enable_flash_accelerator();

    let bus = board_stm32::bus!(parts, Irqs, SPI_BUFFER.take());
    let wires = board_stm32::chain_wires!(parts, bus);
    let trigger = Trigger { pin: parts.trigger, line: parts.trigger_line };
    #[cfg(not(feature = "uart"))]
    let port = board_stm32::Port { otg: parts.usb, dp: parts.usb_dp, dm: parts.usb_dm };
    #[cfg(feature = "uart")]
    let port = board_stm32::uart_port!(parts, Usart2, UartIrqs, PORT_MEMORY.take());
    let spawner = start_tasks(Board {
        name: "NUCLEO-F446RE",
        firmware: env!("CORTICODE_FIRMWARE"),
        reset_cause,
        clock,
        session_id: stm32f4::session_id(parts.adc),
        wires,
        trigger,
        port,
    })?;
    spawner.spawn(feed_watchdog(parts.watchdog)?);
    Ok(())
}
