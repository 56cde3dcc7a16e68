//! The start: queues, executors, tasks.

use ads1299::SelfTest;
use defmt::{info, warn};
use defmt_rtt as _;
use device::{Abilities, Identity, Producer, Session};
use embassy_executor::{SendSpawner, SpawnError};
use embassy_stm32::{
    Peri, interrupt, uid,
    wdg::{self, IndependentWatchdog},
};
use embassy_time::{Instant, TICK_HZ};
use firmware::{
    Clock, FaultRecord, Frames, HandedIn, HandedOut, Machine, Memory, Shared, StampedIn,
    StampedOut, deadlines,
};
use link::{ResetCause, Streams};
use pipeline::{Acquisition, Mains};
use static_cell::StaticCell;

use crate::{
    CHIPS, ClockSource, Port, Trigger, Wires,
    converter::Adc,
    failure,
    interrupts::{self, ACQUIRE, CONVERSE, ENCODE},
};

/// What the tasks tell each other. Stages are timed by the device's clock: the core's own counter stops
/// while the core sleeps.
pub(crate) static SHARED: Shared = Shared::new(Clock {
    now: ticks,
    #[expect(clippy::cast_possible_truncation, reason = "1 MHz")]
    hz: TICK_HZ as u32,
});

/// The device's clock, lower half.
#[expect(clippy::cast_possible_truncation, reason = "it wraps")]
fn ticks() -> u32 {
    Instant::now().as_ticks() as u32
}

static MEMORY: Memory = Memory::new();
static TEST: StaticCell<SelfTest<CHIPS>> = StaticCell::new();
static ADC: StaticCell<Adc> = StaticCell::new();

/// What these boards can do. The UART carries 92 kB/s, and raw samples are 101.
const ABILITIES: Abilities = Abilities {
    streams: if cfg!(feature = "uart") {
        Streams::ALL.without(Streams::RAW)
    } else {
        Streams::ALL
    },
    self_test: true,
    bootloader: true,
};

/// What a board gives.
pub struct Board {
    /// Its name.
    pub name: &'static str,
    /// Version and commit of the image.
    pub firmware: &'static str,
    /// Why it has started.
    pub reset_cause: ResetCause,
    /// What its clocks are derived from.
    pub clock: ClockSource,
    /// Differs from boot to boot.
    pub session_id: u32,
    /// To the converters.
    pub wires: Wires,
    /// From whatever the host's experiment has to mark.
    pub trigger: Trigger,
    /// To the host.
    pub port: Port,
}

/// What the device says of itself.
struct Name {
    firmware: &'static str,
    board: &'static str,
    session_id: u32,
    reset_cause: ResetCause,
    clock: ClockSource,
}

/// Starts the tasks; gives the spawner of the conversation's priority.
///
/// # Errors
/// A task could not be spawned: a fault of the image.
///
/// Not part of `main`, whose frame stays on the stack for ever, under all tasks.
#[inline(never)]
pub fn begin(board: Board) -> Result<SendSpawner, SpawnError> {
    info!("{=str}, Corticode {=str}", board.name, board.firmware);
    let before = failure::of_the_run_before();
    if let Some(before) = &before {
        warn!("the run before failed: {=str}", before.text());
    }
    let clock_fault = board.clock.fault();
    if !clock_fault.is_empty() {
        warn!("{=str}", clock_fault);
    }
    let name = Name {
        firmware: board.firmware,
        board: board.name,
        session_id: board.session_id,
        reset_cause: before
            .as_ref()
            .map_or(board.reset_cause, FaultRecord::cause),
        clock: board.clock,
    };
    // After all other resets the converters have had their supply for long.
    let is_cold = matches!(
        board.reset_cause,
        ResetCause::PowerOn | ResetCause::BrownOut | ResetCause::NotKnown
    );
    interrupts::begin();
    board.trigger.begin();

    let shares = MEMORY.take();
    let adc = converters(board.wires);
    let conversation = CONVERSE.start(interrupt::UART5);
    conversation.spawn(converse(board.port, name, before, shares.converse)?);
    let encoding = ENCODE.start(interrupt::SAI1);
    encoding.spawn(encode(shares.encode)?);
    let acquisition = ACQUIRE.start(interrupt::UART4);
    acquisition.spawn(acquire(adc, is_cold, shares.acquire)?);
    Ok(conversation)
}

/// The converters' memory. What it is made of passes over the stack, each part for itself: that is over
/// before the first task runs.
#[inline(never)]
fn converters(wires: Wires) -> &'static mut Adc {
    let test = test();
    ADC.init_with(|| Adc::new(wires, test))
}

#[inline(never)]
fn test() -> &'static mut SelfTest<CHIPS> {
    TEST.init_with(SelfTest::new)
}

/// Feeds the watchdog while all tasks move; it starts when they have moved for the first time, because
/// the converters take longer to come up than it waits.
pub async fn watch(watchdog: Peri<'static, impl wdg::Instance>) -> ! {
    let us = u32::try_from(deadlines::WATCHDOG.as_micros()).unwrap_or(u32::MAX);
    let mut watchdog = IndependentWatchdog::new(watchdog, us);
    // Starting it again does no harm.
    firmware::keep_alive(&SHARED, || {
        watchdog.unleash();
        watchdog.pet();
    })
    .await
}

/// What is left for `main`: to halt the core between interrupts.
pub fn sleep() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

#[embassy_executor::task]
async fn acquire(
    adc: &'static mut Adc,
    is_cold: bool,
    share: (StampedIn, &'static mut Acquisition),
) {
    adc.begin(is_cold).await;
    firmware::acquire(adc, &SHARED, share).await;
}

#[embassy_executor::task]
async fn encode(share: (StampedOut, HandedIn, &'static mut Producer)) {
    firmware::encode(&SHARED, share).await;
}

#[embassy_executor::task]
async fn converse(
    port: Port,
    name: Name,
    before: Option<FaultRecord>,
    share: (&'static mut Frames, HandedOut),
) {
    let is_sound = firmware::model_is_sound();
    let fault = firmware::start_fault(is_sound, name.clock.fault(), before.as_ref());
    let identity = Identity {
        firmware: name.firmware,
        board: name.board,
        chip_uid: uid::uid(),
        session_id: name.session_id,
        reset_cause: name.reset_cause,
        fault: &fault,
    };
    let mut session = Session::new(identity, ABILITIES, Mains::default());
    if !is_sound {
        session.refuse_starts();
    }
    let machine = Machine {
        stack: Some(failure::stack()),
        restart: failure::restart,
    };
    port.converse(&mut session, share, machine).await;
}
