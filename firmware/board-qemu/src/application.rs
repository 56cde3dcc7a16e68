//! The board's start: peripherals, queues, executors, tasks.

use core::sync::atomic::Ordering::Relaxed;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use device::{FrameRing, Identity, Sender, Session};
use embassy_executor::SpawnError;
use embassy_sync::zerocopy_channel::{self, Channel};
use embassy_time::{Duration, Timer};
use firmware::{Clock, FaultRecord, Made, Mutex, Port, Shared, Taken, deadlines};
use link::{ResetCause, Start, Streams};
use pipeline::{Acquisition, Encoder, Mains, SignalQuality};
use static_cell::{ConstStaticCell, StaticCell};

use crate::{
    arguments::Arguments,
    drdy,
    failure::{self, Failure},
    interrupts::{self, ACQUIRE, CONVERSE, ENCODE, Interrupt},
    recording::{ENDED, Recording},
    registers::CLOCK_HZ,
    time_driver,
    uart::{self, Receiver, Transmitter},
};

/// From the end of the file to the end of the emulation: the last frames leave, and the watchdog, which
/// misses the samples, does not end yet.
const FAREWELL: Duration = Duration::from_millis(60);

type Frames = Sender<FrameRing<{ deadlines::FRAMES_WAITING }>>;

static SHARED: Shared = Shared::new(Clock {
    now: time_driver::ticks,
    hz: CLOCK_HZ,
});
static FRAMES: ConstStaticCell<Frames> = ConstStaticCell::new(Sender::new(FrameRing::new()));
static ENCODER: ConstStaticCell<Encoder<'static>> = ConstStaticCell::new(Encoder::new());
static ACQUISITION: ConstStaticCell<Acquisition> =
    ConstStaticCell::new(Acquisition::new(Mains::Hz50));
static QUALITY: ConstStaticCell<SignalQuality> =
    ConstStaticCell::new(SignalQuality::new(Mains::Hz50));
static TAKEN: StaticCell<[Taken; deadlines::SAMPLES_WAITING]> = StaticCell::new();
static TAKEN_CHANNEL: StaticCell<Channel<'static, Mutex, Taken>> = StaticCell::new();
static MADE: StaticCell<[Made; deadlines::MADE_WAITING]> = StaticCell::new();
static MADE_CHANNEL: StaticCell<Channel<'static, Mutex, Made>> = StaticCell::new();

#[embassy_executor::task]
async fn acquire(
    recording: Recording,
    taken: zerocopy_channel::Sender<'static, Mutex, Taken>,
    acquisition: &'static mut Acquisition,
) {
    firmware::acquire(recording, &SHARED, taken, acquisition).await;
}

#[embassy_executor::task]
async fn encode(
    taken: zerocopy_channel::Receiver<'static, Mutex, Taken>,
    made: zerocopy_channel::Sender<'static, Mutex, Made>,
    encoder: &'static mut Encoder<'static>,
    quality: &'static mut SignalQuality,
) {
    firmware::encode(&SHARED, taken, made, encoder, quality).await;
}

#[embassy_executor::task]
async fn converse(
    before: Option<FaultRecord>,
    start: Option<Start>,
    frames: &'static mut Frames,
    made: zerocopy_channel::Receiver<'static, Mutex, Made>,
) {
    let is_sound = firmware::model_is_sound();
    let mut session = Session::new(
        identity(before.as_ref(), is_sound),
        device::Abilities::CODES,
        Mains::default(),
    );
    if !is_sound {
        session.refuse_starts();
    }
    firmware::converse(
        Port {
            input: Receiver,
            output: Transmitter,
        },
        &mut session,
        start,
        frames,
        &SHARED,
        Some(failure::stack()),
        made,
    )
    .await;
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

fn identity(before: Option<&FaultRecord>, is_sound: bool) -> Identity<'_> {
    let fault = before.map_or("", FaultRecord::text);
    Identity {
        firmware: env!("CARGO_PKG_VERSION"),
        board: "qemu-mps2",
        chip_uid: *b"qemu-mps2\0\0\0",
        session_id: if before.is_some() { 2 } else { 1 },
        reset_cause: before.map_or(ResetCause::PowerOn, FaultRecord::cause),
        fault: if is_sound {
            fault
        } else {
            firmware::MODEL_DAMAGED
        },
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
    let start = arguments.has("start").then_some(Start {
        streams: Streams::CODES,
        mains_hz: 0,
    });
    let recording = Recording::open();
    if let Some(mut core) = cortex_m::Peripherals::take() {
        interrupts::prioritise(&mut core.NVIC);
    }
    time_driver::begin();
    uart::begin();

    let taken = TAKEN.init_with(|| core::array::from_fn(|_| Taken::default()));
    let (taken_in, taken_out) = TAKEN_CHANNEL.init(Channel::new(taken)).split();
    let made = MADE.init_with(|| core::array::from_fn(|_| Made::default()));
    let (made_in, made_out) = MADE_CHANNEL.init(Channel::new(made)).split();

    let conversation = CONVERSE.start(Interrupt::Converse);
    conversation.spawn(converse(before, start, FRAMES.take(), made_out)?);
    conversation.spawn(end()?);
    conversation.spawn(watch()?);
    let encoding = ENCODE.start(Interrupt::Encode);
    if before.is_none()
        && let Some(failure) = Failure::ALL
            .into_iter()
            .find(|how| arguments.has(how.word()))
    {
        encoding.spawn(fail(failure)?);
    }
    encoding.spawn(encode(taken_out, made_in, ENCODER.take(), QUALITY.take())?);
    let acquisition = ACQUIRE.start(Interrupt::Acquire);
    acquisition.spawn(acquire(recording, taken_in, ACQUISITION.take())?);
    drdy::begin();
    Ok(())
}
