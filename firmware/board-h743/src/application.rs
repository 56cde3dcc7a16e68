//! Starts the application on the board: sets up pins, clocks and memory, then starts the tasks.

use board_stm32::{
    Board, ClockSource, HseInput, Loader, Trigger, init_chip, sleep, start_tasks, start_watchdog,
};
use cortex_m_rt::entry;
use embassy_executor::SpawnError;
use embassy_stm32::{
    Peri, bind_interrupts, dma, pac,
    peripherals::{DMA1_CH0, DMA1_CH1, IWDG1, RNG},
    rng::{self, Rng},
};

use crate::{clocks, hse_timer, memory, parts::Parts, reset};

bind_interrupts!(struct Irqs {
    DMA1_STREAM0 => dma::InterruptHandler<DMA1_CH0>;
    DMA1_STREAM1 => dma::InterruptHandler<DMA1_CH1>;
    RNG => rng::InterruptHandler<RNG>;
});

#[cfg(feature = "uart")]
use {
    crate::uart::Usart3,
    board_stm32::UartInterrupt,
    embassy_stm32::peripherals::{DMA1_CH2, DMA1_CH3},
};
#[cfg(feature = "uart")]
bind_interrupts!(struct UartIrqs {
    USART3 => UartInterrupt<Usart3>;
    DMA1_STREAM2 => dma::InterruptHandler<DMA1_CH2>;
    DMA1_STREAM3 => dma::InterruptHandler<DMA1_CH3>;
});

#[entry]
fn main() -> ! {
    // The boot loader comes first, because it needs the chip in the state in which the reset left
    // it.
    Loader::Stm32H743.run_if_requested(|| {});
    reset::freeze_watchdog_in_debug();
    start_watchdog(pac::IWDG1);
    let clock = ClockSource::find(
        clocks::AFTER_RESET_HZ,
        HseInput::Clock,
        &mut hse_timer::Timer,
        clocks::SOURCES,
    );
    let parts = Parts::new(init_chip(clocks::config(clock)));
    // Spawning a task twice is an error in the image. Panic, because no task runs yet that could
    // report the error.
    start(parts, clock).expect("every task is spawned once");
    sleep()
}

#[embassy_executor::task]
async fn feed_watchdog(watchdog: Peri<'static, IWDG1>) {
    board_stm32::feed_watchdog(watchdog).await;
}

fn start(parts: Parts, clock: ClockSource) -> Result<(), SpawnError> {
    let reset_cause = reset::take_cause();
    let core = cortex_m::Peripherals::take().expect("nothing else takes them");
    let (memory, slot) = memory::init(core);

    let bus = board_stm32::bus!(parts, Irqs, &mut memory.converters);
    let wires = board_stm32::chain_wires!(parts, bus);
    let trigger = Trigger { pin: parts.trigger, line: parts.trigger_line };
    #[cfg(not(feature = "uart"))]
    let port = board_stm32::Port { otg: parts.usb, dp: parts.usb_dp, dm: parts.usb_dm };
    #[cfg(feature = "uart")]
    let port = board_stm32::uart_port!(parts, Usart3, UartIrqs, &mut memory.port);
    let spawner = start_tasks(Board {
        name: "NUCLEO-H743ZI2",
        firmware: env!("CORTICODE_FIRMWARE"),
        reset_cause,
        clock,
        session_id: Rng::new(parts.rng, Irqs).next_u32(),
        wires,
        trigger,
        port,
        slot,
    })?;
    spawner.spawn(feed_watchdog(parts.watchdog)?);
    Ok(())
}
