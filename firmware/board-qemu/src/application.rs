//! The board's start: peripherals, queues, executors, tasks.

use core::sync::atomic::Ordering::Relaxed;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use device::{Abilities, Identity, Producer, Session};
use embassy_executor::SpawnError;
use embassy_time::{Duration, Timer};
use firmware::{
    Clock, FaultRecord, Frames, HandedIn, HandedOut, Machine, Memory, Port, Shared, StampedIn,
    StampedOut, deadlines,
};
use link::{ResetCause, Start, Streams};
use pipeline::{Acquisition, Mains};

use crate::{
    arguments::Arguments,
    commands, drdy,
    failure::{self, Failure},
    host_file::HostFile,
    interrupts::{self, ACQUIRE, CONVERSE, ENCODE, Interrupt},
    recording::{ENDED, Recording},
    registers::CLOCK_HZ,
    time_driver, trigger,
    uart::{self, Receiver, Transmitter},
};

/// From the end of the file to the end of the emulation: the last frames leave, and the watchdog, which
/// misses the samples, does not end yet.
const FAREWELL: Duration = Duration::from_millis(60);

pub(crate) static SHARED: Shared = Shared::new(Clock {
    now: time_driver::ticks,
    hz: CLOCK_HZ,
});
static MEMORY: Memory = Memory::new();

/// What this board can do.
const ABILITIES: Abilities = Abilities {
    streams: Streams::ALL,
    self_test: false,
    bootloader: false,
};

#[embassy_executor::task]
async fn acquire(recording: Recording, share: (StampedIn, &'static mut Acquisition)) {
    firmware::acquire(recording, &SHARED, share).await;
}

#[embassy_executor::task]
async fn encode(share: (StampedOut, HandedIn, &'static mut Producer)) {
    firmware::encode(&SHARED, share).await;
}

#[embassy_executor::task]
async fn converse(
    before: Option<FaultRecord>,
    start: Option<Start>,
    share: (&'static mut Frames, HandedOut),
) {
    let is_sound = firmware::model_is_sound();
    let fault = firmware::start_fault(is_sound, "", before.as_ref());
    let identity = identity(before.as_ref(), &fault);
    let mut session = Session::new(identity, ABILITIES, Mains::default());
    if !is_sound {
        session.refuse_starts();
    }
    let port = Port {
        input: Receiver,
        output: Transmitter,
    };
    let machine = Machine {
        stack: Some(failure::stack()),
        restart: failure::restart,
    };
    firmware::converse(port, &mut session, start, share, &SHARED, machine).await;
}

/// Ends the emulation a while after the file.
#[embassy_executor::task]
async fn end() {
    while !ENDED.load(Relaxed) {
        Timer::after(deadlines::STEP).await;
    }
    Timer::after(FAREWELL).await;
    let counts = SHARED.counts();
    hprintln!("samples {}", counts.samples);
    hprintln!("overruns {}", counts.overruns);
    debug::exit(debug::EXIT_SUCCESS);
}

/// Says what the host's file says.
#[embassy_executor::task]
async fn say(file: HostFile, boot: u32) {
    commands::say(file, boot).await;
}

/// Feeds the watchdog while all tasks move.
#[embassy_executor::task]
async fn watch() {
    failure::begin_watchdog();
    firmware::keep_alive(&SHARED, failure::feed_watchdog).await;
}

/// Fails as asked, after a second.
#[embassy_executor::task]
async fn fail(how: Failure) {
    Timer::after_secs(1).await;
    how.happen();
}

fn identity<'f>(before: Option<&FaultRecord>, fault: &'f str) -> Identity<'f> {
    Identity {
        firmware: env!("CARGO_PKG_VERSION"),
        board: "qemu-mps2",
        chip_uid: *b"qemu-mps2\0\0\0",
        session_id: if before.is_some() { 2 } else { 1 },
        reset_cause: before.map_or(ResetCause::PowerOn, FaultRecord::cause),
        fault,
    }
}

#[entry]
fn main() -> ! {
    let spawned = begin();
    if spawned.is_err() {
        hprintln!("a task could not be spawned");
        debug::exit(debug::EXIT_FAILURE);
    }
    loop {
        // Halts the emulated core; WFE, which the thread executor uses, does not.
        cortex_m::asm::wfi();
    }
}

/// Not part of `main`, whose frame stays on the stack for ever, under all tasks.
#[inline(never)]
fn begin() -> Result<(), SpawnError> {
    let arguments = Arguments::of_emulator();
    let before = failure::of_the_run_before();
    let start = [("start", Streams::CODES), ("start-all", Streams::ALL)]
        .into_iter()
        .find(|(word, _)| arguments.has(word))
        .map(|(_, streams)| Start {
            streams,
            mains_hz: 0,
        });
    let recording = Recording::open();
    if let Some(mut core) = cortex_m::Peripherals::take() {
        interrupts::prioritise(&mut core.NVIC);
    }
    time_driver::begin();
    uart::begin();

    let shares = MEMORY.take();
    let conversation = CONVERSE.start(Interrupt::Converse);
    conversation.spawn(converse(before, start, shares.converse)?);
    conversation.spawn(end()?);
    conversation.spawn(watch()?);
    if let Some(file) = open_for(&arguments, "commands", commands::COMMANDS) {
        let boot = if before.is_some() { 2 } else { 1 };
        conversation.spawn(say(file, boot)?);
    }
    let encoding = ENCODE.start(Interrupt::Encode);
    if before.is_none()
        && let Some(failure) = Failure::ALL
            .into_iter()
            .find(|how| arguments.has(how.word()))
    {
        encoding.spawn(fail(failure)?);
    }
    encoding.spawn(encode(shares.encode)?);
    let acquisition = ACQUIRE.start(Interrupt::Acquire);
    acquisition.spawn(acquire(recording, shares.acquire)?);
    let origin = drdy::begin();
    if let Some(file) = open_for(&arguments, "trigger", trigger::EDGES) {
        trigger::begin(file, origin);
    }
    Ok(())
}

/// The host's file, where the emulator was started with the word for it.
fn open_for(arguments: &Arguments, word: &str, name: &core::ffi::CStr) -> Option<HostFile> {
    arguments.has(word).then(|| HostFile::open(name)).flatten()
}
