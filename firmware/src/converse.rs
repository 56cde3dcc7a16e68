//! Conversation task: executes the commands that the port receives, and writes frames for the host
//! to the port.

use core::{
    cell::{Cell, RefCell},
    pin::pin,
    sync::atomic::Ordering::Relaxed,
};

use device::{MAX_FRAME, Order, Output, Session};
use embassy_futures::join::join5;
use embassy_sync::{blocking_mutex::raw::NoopRawMutex, signal::Signal};
use embassy_time::{Instant, Timer, with_timeout};
use embedded_io_async::{Read, Write};
use link::{ResetInto, Stage, Start};

use crate::{
    deadlines,
    memory::Frames,
    queues::OutputReceiver,
    shared::{FILTERS, Shared},
    stack::Stack,
};

/// Largest number of bytes read from the port in one call: one bulk packet of full-speed USB.
const PACKET: usize = 64;

/// Time limit for each wait for an output, so that the conversation task reports progress at least
/// this often. Also the delay before a closed port is read again.
const TICK: embassy_time::Duration = embassy_time::Duration::from_millis(20);

/// Both directions of a board's port to the host.
#[derive(Debug)]
pub struct Port<Input, Output> {
    /// Reader of the bytes from the host.
    pub input: Input,
    /// Writer of the bytes to the host.
    pub output: Output,
}

/// What the conversation needs from the microcontroller: its stack, to report how much of it is
/// used, and a way to reset the microcontroller.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Stack whose largest use the `Timing` message reports; `None` if the start-up code has not
    /// painted the stack.
    pub stack: Option<Stack>,
    /// Resets the microcontroller on the host's command.
    pub restart: fn(ResetInto) -> !,
}

/// Runs the conversation: introduces the device, replies to commands and sends outputs. With
/// `start`, a run starts without a command from the host.
///
/// Reading, forwarding and writing are futures of one task, so they share the session and the
/// frames without locks. When the port accepts no bytes, the oldest whole frames are dropped and
/// counted.
pub async fn converse(
    Port { input, output }: Port<impl Read, impl Write>,
    session: &mut Session<'_>,
    start: Option<Start>,
    (frames, outputs): (&mut Frames, OutputReceiver),
    shared: &Shared,
    machine: Machine,
) -> ! {
    session.introduce(now_us(), frames);
    if let Some(start) = start {
        let (_, order) = session.start(start, now_us(), frames);
        if let Some(order) = order {
            shared.send_order(order);
        }
    }
    let conversation = Conversation {
        state: RefCell::new((session, frames)),
        code_ticks: Cell::new(None),
        frames_waiting: Signal::new(),
        shared,
        machine,
    };
    conversation.frames_waiting.signal(());
    // Pinned here: if the futures were moved into `join5`, the task's stack frame would hold a
    // second copy of each for as long as the task runs.
    join5(
        pin!(conversation.receive_commands(input)),
        pin!(conversation.forward_outputs(outputs)),
        pin!(conversation.write_frames(output)),
        pin!(conversation.report_converters()),
        pin!(conversation.report_self_test()),
    )
    .await;
    unreachable!("none of the five ends")
}

/// State that the futures of the conversation share.
struct Conversation<'c, 'i> {
    state: RefCell<(&'c mut Session<'i>, &'c mut Frames)>,
    /// Time at which the newest code, block or features were queued, ticks; `None` if the port has
    /// accepted them.
    code_ticks: Cell<Option<u32>>,
    /// Set when there may be new frames to write.
    frames_waiting: Signal<NoopRawMutex, ()>,
    shared: &'c Shared,
    machine: Machine,
}

impl Conversation<'_, '_> {
    /// Reads commands from the port and executes them.
    async fn receive_commands(&self, mut input: impl Read) {
        let mut packet = [0; PACKET];
        loop {
            let Ok(length) = input.read(&mut packet).await else {
                // The port is closed. Read it again later, because it may open again.
                Timer::after(TICK).await;
                continue;
            };
            let restart = self.handle_bytes(&packet[..length]);
            self.frames_waiting.signal(());
            if let Some(into) = restart {
                Timer::after(deadlines::DRAIN_TIMEOUT).await;
                (self.machine.restart)(into);
            }
        }
    }

    /// Passes bytes to the session. If they complete a reset command, returns what to start after
    /// the reset.
    fn handle_bytes(&self, bytes: &[u8]) -> Option<ResetInto> {
        let (session, frames) = &mut *self.state.borrow_mut();
        // Skip the lost frames first: the reply to a Stop command counts the frames lost before the
        // command.
        self.skip_lost(frames);
        let counts = self.shared.counts();
        let mut restart = None;
        let slot = &mut &self.shared.slot;
        session.receive(bytes, now_us(), counts, slot, frames, |order| match order {
            Order::Reset(into) => restart = Some(into),
            Order::SetRate(rate) => self.shared.set_rate(rate),
            Order::SetExclusion(policy) => self.shared.exclusion.signal(policy),
            Order::SetImpedance(on) if cfg!(feature = "impedance") => {
                self.shared.set_excitation(on);
            }
            order => {
                if cfg!(feature = "impedance") && matches!(order, Order::Stop) {
                    self.shared.set_excitation(false);
                }
                self.shared.send_order(order);
            }
        });
        if let Some(filters) = session.take_filters() {
            FILTERS.signal(filters);
        }
        restart
    }

    /// Converts the encoder's outputs to frames.
    async fn forward_outputs(&self, mut outputs: OutputReceiver) {
        loop {
            self.shared.progress.mark_conversed();
            let Ok((output, queued_ticks)) = with_timeout(TICK, outputs.receive()).await else {
                continue;
            };
            self.send_output(&output, queued_ticks);
            outputs.receive_done();
            self.frames_waiting.signal(());
        }
    }

    /// Queues the frame of one output.
    ///
    /// At the end of each second of a run, queues `Stats` and `Timing` before the output, with the
    /// time stamp of the output, as the wire format specifies.
    ///
    /// Not inlined, to keep the messages off the task's stack frame.
    #[inline(never)]
    fn send_output(&self, output: &Output<'_>, queued_ticks: u32) {
        let (session, frames) = &mut *self.state.borrow_mut();
        self.skip_lost(frames);
        if output.ends_second() && session.is_streaming() {
            let at_us = output.at_us;
            session.send_stats(at_us, self.shared.counts(), frames);
            let timing = self.shared.timing.report(self.machine.stack);
            session.send_timing(timing, at_us, frames);
        }
        session.send(output, frames);
        if output.payload.is_of_hop() {
            self.code_ticks.set(Some(queued_ticks));
        }
    }

    /// Skips one frame number, and counts one dropped frame, for each output that the encoder could
    /// not queue.
    fn skip_lost(&self, frames: &mut Frames) {
        for _ in 0..self.shared.outputs_lost.swap(0, Relaxed) {
            frames.skip();
        }
    }

    /// Writes the frames that wait in memory to the port.
    async fn write_frames(&self, mut output: impl Write) {
        let mut buffer = [0; MAX_FRAME];
        loop {
            self.frames_waiting.wait().await;
            loop {
                let frame = {
                    let (_, frames) = &mut *self.state.borrow_mut();
                    frames.queue().pop(&mut buffer).map(<[u8]>::len)
                };
                let Some(length) = frame else { break };
                if output.write_all(&buffer[..length]).await.is_err() {
                    let (_, frames) = &mut *self.state.borrow_mut();
                    device::FrameQueue::count_dropped(frames.queue());
                }
            }
            let _ = output.flush().await;
            if let Some(start_ticks) = self.code_ticks.take() {
                self.shared.timing.record(Stage::Send, start_ticks);
            }
        }
    }

    /// Passes each status of the converters to the session, which sends it during a run, or if the
    /// fault has changed.
    async fn report_converters(&self) {
        loop {
            let status = self.shared.converter_status.wait().await;
            {
                let (session, frames) = &mut *self.state.borrow_mut();
                session.update_converters(status, now_us(), frames);
            }
            self.frames_waiting.signal(());
        }
    }

    /// Sends the result of a self-test whenever the acquisition publishes one.
    async fn report_self_test(&self) {
        loop {
            let result = self.shared.self_test_result.wait().await;
            {
                let (session, frames) = &mut *self.state.borrow_mut();
                session.send_self_test(result, now_us(), frames);
            }
            self.frames_waiting.signal(());
        }
    }
}

fn now_us() -> u64 {
    Instant::now().as_micros()
}

#[cfg(test)]
mod tests;
