//! The start: queues, executors, tasks.

use ads1299::Configured;
use defmt::{info, warn};
use defmt_rtt as _;
use device::{FrameRing, Identity, Sender, Session};
use embassy_executor::{SendSpawner, SpawnError};
use embassy_stm32::{interrupt, uid};
use embassy_sync::zerocopy_channel::{self, Channel};
use embassy_time::{Instant, TICK_HZ};
use firmware::{Clock, FaultRecord, Made, Mutex, Shared, Taken, deadlines};
use link::ResetCause;
use pipeline::{Acquisition, Encoder, Mains, SignalQuality};
use static_cell::{ConstStaticCell, StaticCell};

use crate::{
    Port, Wires,
    converter::{Adc, power_up},
    failure,
    interrupts::{self, ACQUIRE, CONVERSE, ENCODE},
};

pub(crate) type Frames = Sender<FrameRing<{ deadlines::FRAMES_WAITING }>>;
pub(crate) type MadeOut = zerocopy_channel::Receiver<'static, Mutex, Made>;

/// What the tasks tell each other. Stages are timed by the device's clock: the core's own counter stops
/// while the core sleeps.
pub static SHARED: Shared = Shared::new(Clock {
    now: ticks,
    #[expect(clippy::cast_possible_truncation, reason = "1 MHz")]
    hz: TICK_HZ as u32,
});

/// The device's clock, lower half.
#[expect(clippy::cast_possible_truncation, reason = "it wraps")]
fn ticks() -> u32 {
    Instant::now().as_ticks() as u32
}

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

/// What a board gives.
pub struct Board {
    /// Its name.
    pub name: &'static str,
    /// Version and commit of the image.
    pub firmware: &'static str,
    /// Why it has started.
    pub reset_cause: ResetCause,
    /// Differs from boot to boot.
    pub session_id: u32,
    /// To the converters.
    pub wires: Wires,
    /// To the host.
    pub port: Port,
}

/// What the device says of itself.
struct Name {
    firmware: &'static str,
    board: &'static str,
    session_id: u32,
    reset_cause: ResetCause,
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
    let name = Name {
        firmware: board.firmware,
        board: board.name,
        session_id: board.session_id,
        reset_cause: before.map_or(board.reset_cause, |before| before.cause()),
    };
    interrupts::begin();

    let taken = TAKEN.init_with(|| core::array::from_fn(|_| Taken::default()));
    let (taken_in, taken_out) = TAKEN_CHANNEL.init(Channel::new(taken)).split();
    let made = MADE.init_with(|| core::array::from_fn(|_| Made::default()));
    let (made_in, made_out) = MADE_CHANNEL.init(Channel::new(made)).split();

    let conversation = CONVERSE.start(interrupt::UART5);
    conversation.spawn(converse(board.port, name, before, FRAMES.take(), made_out)?);
    let encoding = ENCODE.start(interrupt::SAI1);
    encoding.spawn(encode(taken_out, made_in, ENCODER.take(), QUALITY.take())?);
    let acquisition = ACQUIRE.start(interrupt::UART4);
    acquisition.spawn(acquire(board.wires, taken_in, ACQUISITION.take())?);
    Ok(conversation)
}

/// What is left for `main`: to halt the core between interrupts.
pub fn sleep() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

#[embassy_executor::task]
async fn acquire(
    wires: Wires,
    taken: zerocopy_channel::Sender<'static, Mutex, Taken>,
    acquisition: &'static mut Acquisition,
) {
    let (mut chain, mut drdy) = wires.into_chain();
    let mut configured: Option<Configured<'_, _, _, _, _>> = power_up(&mut chain).await;
    let adc = Adc::start(configured.as_mut(), &mut drdy).await;
    firmware::acquire(adc, &SHARED, taken, acquisition).await;
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
    port: Port,
    name: Name,
    before: Option<FaultRecord>,
    frames: &'static mut Frames,
    made: MadeOut,
) {
    let is_sound = firmware::model_is_sound();
    let identity = Identity {
        firmware: name.firmware,
        board: name.board,
        chip_uid: uid::uid(),
        session_id: name.session_id,
        reset_cause: name.reset_cause,
        fault: if is_sound {
            before.as_ref().map_or("", FaultRecord::text)
        } else {
            firmware::MODEL_DAMAGED
        },
    };
    let mut session = Session::new(identity, device::Abilities::CODES, Mains::default());
    if !is_sound {
        session.refuse_starts();
    }
    port.converse(&mut session, frames, made).await;
}
