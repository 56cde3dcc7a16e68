//! Starts the application on the board: sets up pins and clocks, then starts the tasks.

use board_stm32::{
    Board, ClockSource, FRAME_BYTES, HseInput, KnownClock, PortMemory, Trigger, UartInterrupt,
    Wires, init_chip, sleep, start_tasks, start_watchdog, stm32f4,
};
use cortex_m_rt::entry;
use embassy_executor::SpawnError;
use embassy_stm32::{
    Peri, bind_interrupts, dma, pac,
    peripherals::{DMA1_CH0, DMA1_CH2, DMA1_CH5, DMA1_CH7, IWDG},
};
use static_cell::ConstStaticCell;

use crate::{parts::Parts, uart::Uart5};

bind_interrupts!(struct Irqs {
    DMA1_STREAM5 => dma::InterruptHandler<DMA1_CH5>;
    DMA1_STREAM2 => dma::InterruptHandler<DMA1_CH2>;
});
bind_interrupts!(struct UartIrqs {
    UART5 => UartInterrupt<Uart5>;
    DMA1_STREAM7 => dma::InterruptHandler<DMA1_CH7>;
    DMA1_STREAM0 => dma::InterruptHandler<DMA1_CH0>;
});

/// Crystal of 8 MHz at the HSE pins. The range is wide because the crystal is measured against HSI,
/// which is off by up to 8 % when warm or cold (DS8626).
const SOURCES: &[KnownClock] = &[(ClockSource::Crystal, 7_360_000..=8_640_000)];

#[entry]
fn main() -> ! {
    stm32f4::freeze_watchdog_in_debug();
    start_watchdog(pac::IWDG);
    let clock = ClockSource::find(
        stm32f4::AFTER_RESET_HZ,
        HseInput::Crystal,
        &mut stm32f4::HseTimer,
        SOURCES,
    );
    let parts = Parts::new(init_chip(stm32f4::config(clock)));
    // Spawning a task twice is an error in the image. Panic, because no task runs yet that could
    // report the error.
    start(parts, clock).expect("every task is spawned once");
    sleep()
}

#[embassy_executor::task]
async fn feed_watchdog(watchdog: Peri<'static, IWDG>) {
    board_stm32::feed_watchdog(watchdog).await;
}

/// Buffer through which the DMA transfers SPI data to and from the converter.
static SPI_BUFFER: ConstStaticCell<[u8; FRAME_BYTES]> = ConstStaticCell::new([0; FRAME_BYTES]);

static PORT_MEMORY: ConstStaticCell<PortMemory> = ConstStaticCell::new(PortMemory::EMPTY);

fn start(parts: Parts, clock: ClockSource) -> Result<(), SpawnError> {
    let reset_cause = stm32f4::take_cause();
    stm32f4::enable_flash_accelerator();

    // START is connected to PD11 and, through 0 Ohm, to ground, so PD11 stays an input.
    let wires = Wires::without_start_and_reset(
        board_stm32::bus!(parts, Irqs, SPI_BUFFER.take()),
        [parts.select0.into()],
        parts.drdy,
        parts.drdy_line,
    );
    let trigger = Trigger { pin: parts.trigger, line: parts.trigger_line };
    let port = board_stm32::uart_port!(parts, Uart5, UartIrqs, PORT_MEMORY.take());
    let spawner = start_tasks(Board {
        name: "ironbci",
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
