//! Starts the application on the emulated board: peripherals, queues, executors and tasks.

use core::sync::atomic::Ordering::Relaxed;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use device::{Abilities, BothEncoders, Encoders as _, Identity, Producer, Session, streams_with};
use embassy_executor::SpawnError;
use embassy_time::{Duration, Timer};
use firmware::{
    FaultRecord, Frames, Machine, Memory, OutputReceiver, OutputSender, Port, SampleReceiver,
    SampleSender, deadlines,
    failure::{previous_fault, stack},
};
use link::{ResetCause, Start, Streams};
use pipeline::{Acquisition, Mains};

use crate::failure;
use crate::interrupts::{self, ACQUIRE, CONVERSE, ENCODE, Interrupt, SHARED};
use crate::sample_source::{FILE_ENDED, SampleSource};
use crate::semihosting::{Arguments, HostFile};
use crate::uart::{self, Receiver, Transmitter};
use crate::{commands, drdy, time_driver, trigger};

/// Time from the end of the file of samples to the end of the emulation, in which the last frames
/// are sent. Shorter than the watchdog's period: without samples, nothing feeds the watchdog.
const DRAIN_TIMEOUT: Duration = Duration::from_millis(60);

static MEMORY: Memory<BothEncoders> = Memory::new(BothEncoders::EMPTY);

const ABILITIES: Abilities = Abilities {
    streams: streams_with::<BothEncoders>(),
    self_test: false,
    bootloader: false,
    clock: true,
    impedance: false,
};

#[embassy_executor::task]
async fn acquire(source: SampleSource, memory: (SampleSender, &'static mut Acquisition)) {
    firmware::acquire(source, &SHARED, memory).await;
}

#[embassy_executor::task]
async fn encode(
    memory: (SampleReceiver, OutputSender, &'static mut Producer<&'static mut BothEncoders>),
) {
    firmware::encode(&SHARED, memory).await;
}

#[embassy_executor::task]
async fn converse(
    previous: Option<FaultRecord>,
    start: Option<Start>,
    memory: (&'static mut Frames, OutputReceiver),
) {
    let is_sound = BothEncoders::model_is_sound();
    let fault = firmware::start_fault(is_sound, "", previous.as_ref());
    let previous = previous.as_ref();
    let identity = Identity {
        firmware: env!("CARGO_PKG_VERSION"),
        board: "qemu-mps2",
        chip_uid: *b"qemu-mps2\0\0\0",
        session_id: if previous.is_some() { 2 } else { 1 },
        reset_cause: previous.map_or(ResetCause::PowerOn, FaultRecord::reset_cause),
        fault: &fault,
    };
    let mut session = Session::new(identity, ABILITIES, Mains::default());
    if !is_sound {
        session.refuse_starts();
    }
    let port = Port { input: Receiver, output: Transmitter };
    let machine = Machine { stack: Some(stack()), restart: failure::restart };
    firmware::converse(port, &mut session, start, memory, &SHARED, machine).await;
}

/// Ends the emulation [`DRAIN_TIMEOUT`] after the end of the file of samples; first prints the
/// number of samples that were read, and the number for which the encoder's queue had no room.
#[embassy_executor::task]
async fn end() {
    while !FILE_ENDED.load(Relaxed) {
        Timer::after(deadlines::STEP).await;
    }
    Timer::after(DRAIN_TIMEOUT).await;
    let counts = SHARED.counts();
    hprintln!("samples {}", counts.samples);
    hprintln!("overruns {}", counts.overruns);
    debug::exit(debug::EXIT_SUCCESS);
}

#[embassy_executor::task]
async fn play_commands(file: HostFile, boot: u32) {
    commands::play(file, boot).await;
}

#[embassy_executor::task]
async fn feed_watchdog() {
    failure::start_watchdog();
    firmware::keep_alive(&SHARED.progress, failure::feed_watchdog).await;
}

#[entry]
fn main() -> ! {
    let started = start();
    if started.is_err() {
        hprintln!("a task could not be spawned");
        debug::exit(debug::EXIT_FAILURE);
    }
    loop {
        // QEMU halts the emulated core at WFI, but not at WFE, which embassy's thread executor
        // would use.
        cortex_m::asm::wfi();
    }
}

/// Starts peripherals and tasks. Not inlined into `main`, whose stack frame stays in use while the
/// tasks run and should be small.
#[inline(never)]
fn start() -> Result<(), SpawnError> {
    let arguments = Arguments::read();
    let previous = previous_fault();
    let network = Streams::CODES | Streams::AUDIT;
    let start = [
        ("start", Streams::CODES),
        ("start-all", Streams::ALL.without(Streams::PACKED)),
        ("start-packed", Streams::ALL.without(network)),
    ]
    .into_iter()
    .find(|(argument, _)| arguments.has(argument))
    .map(|(_, streams)| Start { streams, mains_hz: 0 });
    let source = SampleSource::open();
    if let Some(mut core) = cortex_m::Peripherals::take() {
        interrupts::init(&mut core.NVIC);
    }
    time_driver::start();
    uart::start();

    let memory = MEMORY.init();
    let conversation = CONVERSE.start(Interrupt::Converse);
    conversation.spawn(converse(previous, start, memory.converse)?);
    conversation.spawn(end()?);
    conversation.spawn(feed_watchdog()?);
    if let Some(file) = open_if_requested(&arguments, "commands", commands::COMMANDS) {
        let boot = if previous.is_some() { 2 } else { 1 };
        conversation.spawn(play_commands(file, boot)?);
    }
    let encoding = ENCODE.start(Interrupt::Encode);
    encoding.spawn(encode(memory.encode)?);
    let acquisition = ACQUIRE.start(Interrupt::Acquire);
    acquisition.spawn(acquire(source, memory.acquire)?);
    let origin = drdy::start();
    if let Some(file) = open_if_requested(&arguments, "trigger", trigger::EDGES) {
        trigger::start(file, origin);
    }
    Ok(())
}

/// Opens the file `name` on the PC. Returns `None` if `argument` is not among the emulator's
/// arguments, or the file does not exist.
fn open_if_requested(
    arguments: &Arguments,
    argument: &str,
    name: &core::ffi::CStr,
) -> Option<HostFile> {
    arguments.has(argument).then(|| HostFile::open(name)).flatten()
}
