//! The board's start.

use board_stm32::{Board, Bus, FRAME_BYTES, Loader, Port, SHARED, Trigger, Wires, begin, sleep};
use cortex_m_rt::entry;
use embassy_executor::SpawnError;
use embassy_stm32::{
    Peri,
    adc::{Adc, SampleTime},
    bind_interrupts, dma,
    exti::{ExtiInput, TriggerEdge},
    gpio::{Level, Output, Pull, Speed},
    peripherals::{ADC1, DMA1_CH3, DMA1_CH4, IWDG},
    spi::Spi,
    wdg::IndependentWatchdog,
};
use firmware::deadlines;
use static_cell::ConstStaticCell;

use crate::{clocks, parts::Parts, reset};

bind_interrupts!(struct Irqs {
    DMA1_STREAM4 => dma::InterruptHandler<DMA1_CH4>;
    DMA1_STREAM3 => dma::InterruptHandler<DMA1_CH3>;
});

#[cfg(feature = "uart")]
bind_interrupts!(struct UartIrqs {
    USART2 => embassy_stm32::usart::BufferedInterruptHandler<embassy_stm32::peripherals::USART2>;
});

#[entry]
fn main() -> ! {
    // Before anything is what it was not at the reset.
    Loader::Stm32F446.run_if_asked(reset::map_system_memory);
    let parts = Parts::of(embassy_stm32::init(clocks::config()));
    // There are no tasks yet that could answer for a failure.
    start(parts).expect("every task is spawned once");
    sleep()
}

/// Feeds the watchdog while all tasks move; it starts when they have moved for the first time, because
/// the converters take longer to come up than it waits.
#[embassy_executor::task]
async fn watch(watchdog: Peri<'static, IWDG>) {
    let us = u32::try_from(deadlines::WATCHDOG.as_micros()).unwrap_or(u32::MAX);
    let mut watchdog = IndependentWatchdog::new(watchdog, us);
    // Starting it again does no harm.
    firmware::keep_alive(&SHARED, || {
        watchdog.unleash();
        watchdog.pet();
    })
    .await;
}

/// Where the converters' DMA reads and writes.
static BUFFER: ConstStaticCell<[u8; FRAME_BYTES]> = ConstStaticCell::new([0; FRAME_BYTES]);

fn start(parts: Parts) -> Result<(), SpawnError> {
    let reset_cause = reset::cause();
    reset::spare_the_debugger();
    clocks::accelerate();

    let spi = Spi::new(
        parts.spi,
        parts.sclk,
        parts.mosi,
        parts.miso,
        parts.spi_tx,
        parts.spi_rx,
        Irqs,
        Bus::config(),
    );
    let wires = Wires {
        bus: Bus::new(spi, BUFFER.take()),
        selects: [
            Output::new(parts.select0, Level::High, Speed::High),
            Output::new(parts.select1, Level::High, Speed::High),
            Output::new(parts.select2, Level::High, Speed::High),
            Output::new(parts.select3, Level::High, Speed::High),
            Output::new(parts.select4, Level::High, Speed::High),
            Output::new(parts.select5, Level::High, Speed::High),
            Output::new(parts.select6, Level::High, Speed::High),
            Output::new(parts.select7, Level::High, Speed::High),
        ],
        start: Output::new(parts.start, Level::Low, Speed::Low),
        reset: Output::new(parts.reset, Level::High, Speed::Low),
        drdy: ExtiInput::new_blocking(parts.drdy, parts.drdy_line, Pull::Up, TriggerEdge::Falling),
    };
    let trigger = Trigger {
        pin: parts.trigger,
        line: parts.trigger_line,
    };
    #[cfg(not(feature = "uart"))]
    let port = Port {
        otg: parts.usb,
        dp: parts.usb_dp,
        dm: parts.usb_dm,
    };
    #[cfg(feature = "uart")]
    let port = Port::new(|sending, received| {
        use embassy_stm32::{
            interrupt::{self, InterruptExt},
            usart::BufferedUart,
        };
        interrupt::USART2.set_priority(board_stm32::prioritise(deadlines::priority::CONVERSE));
        BufferedUart::new(
            parts.uart,
            parts.uart_rx,
            parts.uart_tx,
            sending,
            received,
            UartIrqs,
            Port::config(),
        )
    });
    let spawner = begin(Board {
        name: "NUCLEO-F446RE",
        firmware: env!("CORTICODE_FIRMWARE"),
        reset_cause,
        session_id: session_id(parts.adc),
        wires,
        trigger,
        port,
    })?;
    spawner.spawn(watch(parts.watchdog)?);
    Ok(())
}

/// From the noise of the chip's own thermometer, because it has no generator of random numbers: the lowest
/// bits of 64 readings, mixed as FNV-1a does. Enough to tell a boot from the one before, and no secret.
fn session_id(adc: Peri<'static, ADC1>) -> u32 {
    let mut adc = Adc::new(adc);
    let mut thermometer = adc.enable_temperature();
    (0..64).fold(0x811c_9dc5, |id: u32, _| {
        let reading = adc.blocking_read(&mut thermometer, SampleTime::CYCLES3);
        (id ^ u32::from(reading)).wrapping_mul(0x0100_0193)
    })
}
