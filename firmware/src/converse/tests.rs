//! Tests, with a simulated host, that the conversation task counts lost outputs.

use core::{
    convert::Infallible,
    future::poll_fn,
    pin::pin,
    task::{Context, Poll, Waker},
};
use std::{boxed::Box, collections::VecDeque, rc::Rc, vec::Vec};

use device::{Abilities, FrameRing, Identity, Sender};
use embassy_sync::zerocopy_channel::Channel;
use embedded_io_async::ErrorType;
use link::{Decoder, Encoder, ResetCause, Streams, ToDevice, ToHost};
use pipeline::Mains;

use super::*;
use crate::{
    queues::{BulkSlot, OutputSender, OutputSlot, output_queue},
    timing::Clock,
};

/// Simulated host, which implements both directions of the device's port.
#[derive(Clone, Default)]
struct Host {
    /// Commands that the device has not read yet.
    commands: Rc<RefCell<VecDeque<Vec<u8>>>>,
    /// Bytes that the device has written.
    received: Rc<RefCell<Vec<u8>>>,
}

impl ErrorType for Host {
    type Error = Infallible;
}

impl Read for Host {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let command = poll_fn(|_| match self.commands.borrow_mut().pop_front() {
            None => Poll::Pending,
            Some(command) => Poll::Ready(command),
        })
        .await;
        bytes[..command.len()].copy_from_slice(&command);
        Ok(command.len())
    }
}

impl Write for Host {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.received.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

fn queue() -> (OutputSender, OutputReceiver) {
    let slots = Box::leak(Box::new([OutputSlot::EMPTY; 2]));
    let bulk = Box::leak(Box::new([BulkSlot::empty()]));
    output_queue(Box::leak(Box::new(Channel::new(slots))), Box::leak(Box::new(Channel::new(bulk))))
}

#[test]
fn the_answer_to_a_stop_counts_the_outputs_that_the_encoder_could_not_queue() {
    let shared = Shared::new(Clock { now: || 0, hz: 1_000_000 });
    let host = Host::default();
    let identity = Identity {
        firmware: "",
        board: "",
        chip_uid: [0; 12],
        session_id: 1,
        reset_cause: ResetCause::PowerOn,
        fault: "",
    };
    let mut session = Session::new(identity, Abilities::CODES, Mains::Hz50);
    let mut frames: Box<Frames> = Box::new(Sender::new(FrameRing::new()));
    let port = Port { input: host.clone(), output: host.clone() };
    let machine = Machine { stack: None, restart: |_| panic!("the host sends no reset command") };
    let start = Start { streams: Streams::CODES, mains_hz: 50 };
    let (_sender, outputs) = queue();
    let mut task =
        pin!(converse(port, &mut session, Some(start), (&mut frames, outputs), &shared, machine));
    let mut context = Context::from_waker(Waker::noop());
    assert!(task.as_mut().poll(&mut context).is_pending());
    shared.outputs_lost.store(3, Relaxed);
    let mut buffer = [0; MAX_FRAME];
    let stop = Encoder::starting_at(0).encode(0, &ToDevice::Stop, &mut buffer);
    let stop = stop.expect("it fits").to_vec();
    // No waker is needed here, because the test itself polls the task until it is done.
    host.commands.borrow_mut().push_back(stop);
    assert!(task.as_mut().poll(&mut context).is_pending());

    let mut decoder = Decoder::<MAX_FRAME>::new();
    let received = host.received.borrow();
    let mut bytes = &received[..];
    let mut dropped = Vec::new();
    let mut seqs = Vec::new();
    while let Some(frame) = decoder.next::<ToHost<'_>>(&mut bytes) {
        let frame = frame.expect("a sound frame");
        seqs.push(frame.header.seq);
        if let ToHost::Stats(stats) = frame.message {
            dropped.push(stats.frames_dropped);
        }
    }
    assert_eq!(dropped, [3]);
    // Frame numbers: Hello 0, Capabilities 1, lost outputs 2 to 4 (never sent), Stats 5, Ack 6.
    assert_eq!(seqs, [0, 1, 5, 6]);
}
