//! Starts the application: queues, executors, tasks, the image's encoders and the shared state.

use ads1299::SelfTest;
use defmt::{info, warn};
use defmt_rtt as _;
use device::Encoders as _;
use device::{Abilities, CHIPS, Identity, Producer, Session, streams_with};
use embassy_executor::{SendSpawner, SpawnError};
use embassy_stm32::pac::iwdg::vals::{Key, Pr};
use embassy_stm32::wdg::{self, IndependentWatchdog};
use embassy_stm32::{Peri, interrupt, pac, uid};
use embassy_time::{Instant, TICK_HZ};
use firmware::failure::{previous_fault, stack};
use firmware::{
    Clock, FaultRecord, Frames, Machine, Memory, OutputReceiver, OutputSender, SampleReceiver,
    SampleSender, Shared, deadlines,
};
use link::{ResetCause, Streams};
use pipeline::{Acquisition, Mains};
use static_cell::StaticCell;

use crate::clock_source::ClockSource;
use crate::converter::{Adc, Wires};
use crate::failure;
use crate::interrupts::{self, ACQUIRE, CONVERSE, ENCODE};
use crate::port::Port;
use crate::trigger::Trigger;

const _: () = assert!(
    !<ImageEncoders as device::Encoders>::STREAMS.is_empty(),
    "the model has none of the encoders of this image: select the feature `network` or `packed` that it has"
);
static MEMORY: Memory<ImageEncoders> = Memory::new(ImageEncoders::EMPTY);
static TEST: StaticCell<SelfTest<CHIPS>> = StaticCell::new();
static ADC: StaticCell<Adc> = StaticCell::new();

/// What these boards offer to a host. Over the UART they refuse raw samples: these need 101 kB/s,
/// and the UART carries only 92 kB/s. Compressed raw samples need about half of the 101 kB/s.
const ABILITIES: Abilities = Abilities {
    streams: {
        let too_fast = if cfg!(feature = "uart") { Streams::RAW } else { Streams::empty() };
        streams_with::<ImageEncoders>().without(too_fast)
    },
    self_test: true,
    bootloader: cfg!(feature = "loader"),
    clock: true,
    impedance: cfg!(feature = "impedance"),
};

/// What `start_tasks` must know about a board: its names, parts and state after the reset.
pub struct Board {
    /// Name of the board, reported to the host in the frame `Hello`.
    pub name: &'static str,
    /// Version and commit of the image.
    pub firmware: &'static str,
    /// Cause of the last reset according to the chip's flags. A fault record from before the reset
    /// overrides it.
    pub reset_cause: ResetCause,
    /// Source of the core's clock.
    pub clock: ClockSource,
    /// Number that distinguishes this boot from others.
    pub session_id: u32,
    /// Pins and SPI of the converters.
    pub wires: Wires,
    /// Input for the trigger of an experiment.
    pub trigger: Trigger,
    /// Port to the host.
    pub port: Port,
    /// Memory for a packed model that the host uploads.
    #[cfg(feature = "model-slot")]
    pub slot: &'static mut device::ModelSlot,
}

/// Starts the tasks. Returns a spawner for further tasks at the conversation's priority. Not
/// inlined: `main`'s stack frame stays in use while the tasks run and should be small.
///
/// # Errors
/// If a task is spawned twice, which is an error in the image.
#[inline(never)]
pub fn start_tasks(board: Board) -> Result<SendSpawner, SpawnError> {
    info!("{=str}, Corticode {=str}", board.name, board.firmware);
    let previous = previous_fault();
    if let Some(previous) = &previous {
        warn!("the previous run failed: {=str}", previous.text());
    }
    let clock_fault = board.clock.fault();
    info!("clock: {=str}", board.clock.name());
    if !clock_fault.is_empty() {
        warn!("{=str}", clock_fault);
    }
    let identity = Identity {
        firmware: board.firmware,
        board: board.name,
        chip_uid: uid::uid(),
        session_id: board.session_id,
        reset_cause: previous.as_ref().map_or(board.reset_cause, FaultRecord::reset_cause),
        fault: clock_fault,
    };
    // After a reset with any other cause, the converters have already had power for long enough to
    // start.
    let is_cold = matches!(
        board.reset_cause,
        ResetCause::PowerOn | ResetCause::BrownOut | ResetCause::NotKnown
    );
    interrupts::init();
    board.trigger.start_capture();

    #[cfg(feature = "model-slot")]
    SHARED.slot.provide(board.slot);
    let memory = MEMORY.init();
    let adc = converters(board.wires);
    let conversation = CONVERSE.start(interrupt::USART6);
    conversation.spawn(converse(board.port, identity, previous, memory.converse)?);
    let encoding = ENCODE.start(interrupt::I2C3_EV);
    encoding.spawn(encode(memory.encode)?);
    let acquisition = ACQUIRE.start(interrupt::UART4);
    acquisition.spawn(acquire(adc, is_cold, memory.acquire)?);
    Ok(conversation)
}

/// Initialises the converters' memory. [`self_test`] and this function are not inlined, so that
/// their large temporaries have left the stack when the first task runs.
#[inline(never)]
fn converters(wires: Wires) -> &'static mut Adc {
    let test = self_test();
    ADC.init_with(|| Adc::new(wires, test))
}

#[inline(never)]
fn self_test() -> &'static mut SelfTest<CHIPS> {
    TEST.init_with(SelfTest::new)
}

/// Starts the watchdog with [`deadlines::START_UP`], the long period, before anything waits for a
/// clock or a supply. The first feeding sets the short period.
pub fn start_watchdog(watchdog: pac::iwdg::Iwdg) {
    watchdog.kr().write(|key| key.set_key(Key::START));
    watchdog.kr().write(|key| key.set_key(Key::ENABLE));
    // The reload register keeps its value after a reset, 0xFFF.
    watchdog.pr().write(|prescaler| prescaler.set_pr(Pr::DIVIDE_BY32));
}

/// Feeds the running watchdog while all tasks make progress. The period stays at
/// [`deadlines::START_UP`] until every task has made progress once, because the converters take
/// more than a second to start.
pub async fn feed_watchdog(watchdog: Peri<'static, impl wdg::Instance>) -> ! {
    let us = u32::try_from(deadlines::WATCHDOG.as_micros()).unwrap_or(u32::MAX);
    let mut stopped = Some(watchdog);
    let mut fed = None;
    firmware::keep_alive(&SHARED.progress, || {
        if let Some(watchdog) = stopped.take() {
            fed = Some(IndependentWatchdog::new(watchdog, us));
        }
        if let Some(watchdog) = &mut fed {
            watchdog.pet();
        }
    })
    .await
}

/// Halts the core between interrupts. `main` ends in this loop, because all tasks run in
/// interrupts.
pub fn sleep() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

#[embassy_executor::task]
async fn acquire(
    adc: &'static mut Adc,
    is_cold: bool,
    memory: (SampleSender, &'static mut Acquisition),
) {
    adc.start(is_cold).await;
    firmware::acquire(adc, &SHARED, memory).await;
}

#[embassy_executor::task]
async fn encode(
    memory: (SampleReceiver, OutputSender, &'static mut Producer<&'static mut ImageEncoders>),
) {
    firmware::encode(&SHARED, memory).await;
}

#[embassy_executor::task]
async fn converse(
    port: Port,
    identity: Identity<'static>,
    previous: Option<FaultRecord>,
    memory: (&'static mut Frames, OutputReceiver),
) {
    let is_sound = ImageEncoders::model_is_sound();
    let fault = firmware::start_fault(is_sound, identity.fault, previous.as_ref());
    let identity = Identity { fault: &fault, ..identity };
    let mut session = Session::new(identity, ABILITIES, Mains::default());
    if !is_sound {
        session.refuse_starts();
    }
    let machine = Machine { stack: Some(stack()), restart: failure::restart };
    port.converse(&mut session, memory, machine).await;
}

/// Memory of the image's encoders: the network and the packed code.
#[cfg(all(feature = "network", feature = "packed"))]
pub(crate) type ImageEncoders = device::BothEncoders;

/// Memory of the image's encoder, if the image has the network alone.
#[cfg(all(feature = "network", not(feature = "packed")))]
pub(crate) type ImageEncoders = pipeline::EncoderMemory;

/// Memory of the image's encoder, if the image has the packed code alone.
#[cfg(all(feature = "packed", not(feature = "network")))]
pub(crate) type ImageEncoders = pipeline::PackedMemory;

#[cfg(not(any(feature = "network", feature = "packed")))]
compile_error!("an image without encoders: select the feature `network`, `packed` or both");

/// Shared state of the tasks. The device's clock measures the durations of the stages, because the
/// cycle counter stops while the core sleeps.
pub(crate) static SHARED: Shared = Shared::new(Clock {
    now: ticks,
    #[expect(clippy::cast_possible_truncation, reason = "1 MHz")]
    hz: TICK_HZ as u32,
});

/// Returns the lower 32 bits of the device's clock, ticks of 1 us; wraps.
#[expect(clippy::cast_possible_truncation, reason = "it wraps")]
fn ticks() -> u32 {
    Instant::now().as_ticks() as u32
}
