//! The board's start.

use board_stm32::{Board, Bus, Loader, Port, SHARED, Trigger, Wires, begin, sleep};
use cortex_m_rt::entry;
use embassy_executor::SpawnError;
use embassy_stm32::{
    Peri, bind_interrupts, dma,
    exti::{ExtiInput, TriggerEdge},
    gpio::{Level, Output, Pull, Speed},
    peripherals::{DMA1_CH0, DMA1_CH1, IWDG1, RNG},
    rng::{self, Rng},
    spi::Spi,
    wdg::IndependentWatchdog,
};
use firmware::deadlines;

use crate::{clocks, memory, parts::Parts, reset};

bind_interrupts!(struct Irqs {
    DMA1_STREAM0 => dma::InterruptHandler<DMA1_CH0>;
    DMA1_STREAM1 => dma::InterruptHandler<DMA1_CH1>;
    RNG => rng::InterruptHandler<RNG>;
});

#[cfg(feature = "uart")]
bind_interrupts!(struct UartIrqs {
    USART3 => embassy_stm32::usart::BufferedInterruptHandler<embassy_stm32::peripherals::USART3>;
});

#[entry]
fn main() -> ! {
    // Before anything is what it was not at the reset.
    Loader::Stm32H743.run_if_asked(|| {});
    let parts = Parts::of(embassy_stm32::init(clocks::config()));
    // There are no tasks yet that could answer for a failure.
    start(parts).expect("every task is spawned once");
    sleep()
}

/// Feeds the watchdog while all tasks move; it starts when they have moved for the first time, because
/// the converters take longer to come up than it waits.
#[embassy_executor::task]
async fn watch(watchdog: Peri<'static, IWDG1>) {
    let us = u32::try_from(deadlines::WATCHDOG.as_micros()).unwrap_or(u32::MAX);
    let mut watchdog = IndependentWatchdog::new(watchdog, us);
    // Starting it again does no harm.
    firmware::keep_alive(&SHARED, || {
        watchdog.unleash();
        watchdog.pet();
    })
    .await;
}

fn start(parts: Parts) -> Result<(), SpawnError> {
    let reset_cause = reset::cause();
    reset::spare_the_debugger();
    let core = cortex_m::Peripherals::take().expect("nobody has taken them");
    let buffer = memory::begin(core);

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
        bus: Bus::new(spi, buffer),
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
        interrupt::USART3.set_priority(board_stm32::prioritise(deadlines::priority::CONVERSE));
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
        name: "NUCLEO-H743ZI2",
        firmware: env!("CORTICODE_FIRMWARE"),
        reset_cause,
        session_id: Rng::new(parts.rng, Irqs).next_u32(),
        wires,
        trigger,
        port,
    })?;
    spawner.spawn(watch(parts.watchdog)?);
    Ok(())
}
