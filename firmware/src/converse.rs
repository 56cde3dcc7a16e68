//! The task between port and pipeline: commands in, frames out.

use core::{
    cell::{Cell, RefCell},
    pin::pin,
    sync::atomic::Ordering::Relaxed,
};

use device::{Order, Payload, Session};
use embassy_futures::join::join5;
use embassy_sync::{blocking_mutex::raw::NoopRawMutex, signal::Signal};
use embassy_time::{Instant, Timer, with_timeout};
use embedded_io_async::{Read, Write};
use link::{MAX_FRAME, ResetInto, Stage, Start};

use crate::{Frames, Handed, HandedOut, Shared, Stack, deadlines};

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

/// What the microcontroller itself can tell and do.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Its stack, where somebody has painted it.
    pub stack: Option<Stack>,
    /// Starts it anew.
    pub restart: fn(ResetInto) -> !,
}

/// Introduces the device, answers commands and sends what is made, for ever; begins with `start`, if a
/// board starts without a host.
///
/// Reading, making and writing are one task of one priority: they share session and frames without
/// locks. A port that takes nothing costs the oldest whole frames, which are counted.
pub async fn converse(
    Port { input, output }: Port<impl Read, impl Write>,
    session: &mut Session<'_>,
    start: Option<Start>,
    (frames, made): (&mut Frames, HandedOut),
    shared: &Shared,
    machine: Machine,
) -> ! {
    session.introduce(now_us(), frames);
    if let Some(start) = start {
        let (_, order) = session.start(start, now_us(), frames);
        if let Some(order) = order {
            shared.order(order);
        }
    }
    let conversation = Conversation {
        state: RefCell::new((session, frames)),
        made_ticks: Cell::new(None),
        waiting: Signal::new(),
        shared,
        machine,
    };
    conversation.waiting.signal(());
    // In place: what is moved takes room on the stack as well, for ever.
    join5(
        pin!(conversation.read(input)),
        pin!(conversation.make(made)),
        pin!(conversation.write(output)),
        pin!(conversation.tell_of_converters()),
        pin!(conversation.tell_of_self_test()),
    )
    .await;
    unreachable!("none of the five ends")
}

/// What reading, making and writing share.
struct Conversation<'c, 'i> {
    state: RefCell<(&'c mut Session<'i>, &'c mut Frames)>,
    /// When the newest code was handed on, until the port has taken it.
    made_ticks: Cell<Option<u32>>,
    /// Frames wait.
    waiting: Signal<NoopRawMutex, ()>,
    shared: &'c Shared,
    machine: Machine,
}

impl Conversation<'_, '_> {
    /// Obeys what the host commands.
    async fn read(&self, mut input: impl Read) {
        let mut packet = [0; PACKET];
        loop {
            let Ok(length) = input.read(&mut packet).await else {
                // The port is closed: it comes back, or it does not.
                Timer::after(TICK).await;
                continue;
            };
            let restart = self.receive(&packet[..length]);
            self.waiting.signal(());
            if let Some(into) = restart {
                Timer::after(deadlines::FAREWELL).await;
                (self.machine.restart)(into);
            }
        }
    }

    /// Hands bytes to the session; gives what the device shall start anew with, if it shall.
    fn receive(&self, bytes: &[u8]) -> Option<ResetInto> {
        let (session, frames) = &mut *self.state.borrow_mut();
        // What a Stop is answered with counts what was lost before it.
        self.skip_lost(frames);
        let counts = self.shared.counts();
        let mut restart = None;
        session.receive(bytes, now_us(), counts, frames, |order| match order {
            Order::Reset(into) => restart = Some(into),
            order => self.shared.order(order),
        });
        restart
    }

    /// Makes frames of what the encoder hands on.
    async fn make(&self, mut made: HandedOut) {
        loop {
            self.shared.progress.conversed();
            let Ok(handed) = with_timeout(TICK, made.receive()).await else {
                continue;
            };
            self.put(handed);
            made.receive_done();
            self.waiting.signal(());
        }
    }

    /// No part of its caller: what a message takes of the stack must not lie in the task's frame.
    #[inline(never)]
    fn put(&self, handed: &Handed) {
        let (session, frames) = &mut *self.state.borrow_mut();
        self.skip_lost(frames);
        if handed.made.ends_second() && session.is_streaming() {
            let at_us = handed.made.at_us;
            session.send_stats(at_us, self.shared.counts(), frames);
            let timing = self.shared.timing.report(self.machine.stack);
            session.send_timing(&timing, at_us, frames);
        }
        session.send(&handed.made, frames);
        if let Payload::Code(..) = handed.made.payload {
            self.made_ticks.set(Some(handed.ticks));
        }
    }

    /// Numbers and counts what the encoder could not hand on.
    fn skip_lost(&self, frames: &mut Frames) {
        for _ in 0..self.shared.made_lost.swap(0, Relaxed) {
            frames.skip();
        }
    }

    /// Writes frames to the port.
    async fn write(&self, mut output: impl Write) {
        let mut buffer = [0; MAX_FRAME];
        loop {
            self.waiting.wait().await;
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
            if let Some(begin) = self.made_ticks.take() {
                self.shared.timing.end(Stage::Send, begin);
            }
        }
    }

    /// Tells of the converters what the acquisition leaves notes of.
    async fn tell_of_converters(&self) {
        loop {
            let converters = self.shared.converters.wait().await;
            {
                let (session, frames) = &mut *self.state.borrow_mut();
                session.update_converters(converters, now_us(), frames);
            }
            self.waiting.signal(());
        }
    }

    /// Tells what came of a self-test.
    async fn tell_of_self_test(&self) {
        loop {
            let result = self.shared.self_test.wait().await;
            {
                let (session, frames) = &mut *self.state.borrow_mut();
                session.send_self_test(&result, now_us(), frames);
            }
            self.waiting.signal(());
        }
    }
}

fn now_us() -> u64 {
    Instant::now().as_micros()
}

#[cfg(test)]
mod tests;
