//! The task between port and pipeline: commands in, frames out.

use core::{
    cell::{Cell, RefCell},
    pin::pin,
    sync::atomic::Ordering::Relaxed,
};

use device::{FrameRing, Sender, Session};
use embassy_futures::join::join3;
use embassy_sync::{blocking_mutex::raw::NoopRawMutex, signal::Signal, zerocopy_channel::Receiver};
use embassy_time::{Instant, Timer, with_timeout};
use embedded_io_async::{Read, Write};
use link::{MAX_FRAME, Stage, Start};

use crate::{Made, Mutex, Shared, Stack, deadlines};

/// Frames on their way to the port.
type Frames = Sender<FrameRing<{ deadlines::FRAMES_WAITING }>>;

/// Bytes that are read from the port at once: a packet of USB at full speed.
const PACKET: usize = 64;

/// How often the conversation shows that it is alive.
const TICK: embassy_time::Duration = embassy_time::Duration::from_millis(20);

/// Both directions of a port.
#[derive(Debug)]
pub struct Port<Input, Output> {
    /// From the host.
    pub input: Input,
    /// To the host.
    pub output: Output,
}

/// Introduces the device, answers commands and sends what is made, for ever; begins with `start`, if a
/// board starts without a host.
///
/// Reading, making and writing are one task of one priority: they share session and frames without
/// locks. A port that takes nothing costs the oldest whole frames, which are counted.
pub async fn converse(
    Port {
        mut input,
        mut output,
    }: Port<impl Read, impl Write>,
    session: &mut Session<'_>,
    start: Option<Start>,
    frames: &mut Frames,
    shared: &Shared,
    stack: Option<Stack>,
    mut made: Receiver<'_, Mutex, Made>,
) -> ! {
    session.introduce(now_us(), frames);
    if let Some(start) = start {
        let (_, order) = session.start(start, now_us(), frames);
        if let Some(order) = order {
            shared.order(order);
        }
    }
    let state = RefCell::new((session, frames));
    // When the newest code was handed on, until the port has taken it.
    let made_ticks = Cell::new(None);
    let waiting = Signal::<NoopRawMutex, ()>::new();
    waiting.signal(());

    let mut packet = [0; PACKET];
    let mut buffer = [0; MAX_FRAME];
    let read = async {
        loop {
            let Ok(length) = input.read(&mut packet).await else {
                // The port is closed: it comes back, or it does not.
                Timer::after(TICK).await;
                continue;
            };
            let (session, frames) = &mut *state.borrow_mut();
            let counts = shared.counts();
            session.receive(&packet[..length], now_us(), counts, frames, |order| {
                shared.order(order);
            });
            waiting.signal(());
        }
    };
    let make = async {
        loop {
            shared.progress.conversed();
            let Ok(what) = with_timeout(TICK, made.receive()).await else {
                continue;
            };
            {
                let (session, frames) = &mut *state.borrow_mut();
                for _ in 0..shared.made_lost.swap(0, Relaxed) {
                    frames.skip();
                }
                put(session, frames, what, shared, stack);
                if let Made::Code { made_ticks: at, .. } = what {
                    made_ticks.set(Some(*at));
                }
            }
            made.receive_done();
            waiting.signal(());
        }
    };
    let write = async {
        loop {
            waiting.wait().await;
            loop {
                let frame = {
                    let (_, frames) = &mut *state.borrow_mut();
                    frames.queue().take(&mut buffer).map(<[u8]>::len)
                };
                let Some(length) = frame else { break };
                if output.write_all(&buffer[..length]).await.is_err() {
                    let (_, frames) = &mut *state.borrow_mut();
                    device::FrameQueue::count_dropped(frames.queue());
                }
            }
            let _ = output.flush().await;
            if let Some(begin) = made_ticks.take() {
                shared.timing.end(Stage::Send, begin);
            }
        }
    };
    // In place: what is moved takes room on the stack as well, for ever.
    join3(pin!(read), pin!(make), pin!(write)).await;
    unreachable!("none of the three ends")
}

/// Puts what is of the present run into a frame: a start or a stop may have overtaken it.
fn put(
    session: &mut Session<'_>,
    frames: &mut Frames,
    what: &Made,
    shared: &Shared,
    stack: Option<Stack>,
) {
    match what {
        Made::Code {
            run,
            code,
            marks,
            step_us,
            ..
        } if session.is_of_now(*run) => session.code(code, *marks, *step_us, frames),
        Made::Quality {
            run,
            quality,
            at_us,
        } if session.is_of_now(*run) => {
            session.send_stats(*at_us, shared.counts(), frames);
            session.timing(&shared.timing.report(stack), *at_us, frames);
            session.quality(quality, *at_us, frames);
        }
        Made::Nothing | Made::Code { .. } | Made::Quality { .. } => {}
    }
}

fn now_us() -> u64 {
    Instant::now().as_micros()
}
