//! What the host hears.

use core::{
    convert::Infallible,
    future::{Future, poll_fn},
    pin::pin,
    task::{Context, Poll, Waker},
};
use std::{boxed::Box, collections::VecDeque, rc::Rc, vec, vec::Vec};

use device::{Abilities, FrameRing, Identity, Sender};
use embassy_sync::zerocopy_channel::Channel;
use embedded_io_async::ErrorType;
use link::{Decoder, Encoder, ResetCause, Streams, ToDevice, ToHost};
use pipeline::Mains;

use super::*;
use crate::{Clock, HandedIn, Mutex};

/// What a host says, and what it hears.
#[derive(Clone, Default)]
struct Host {
    says: Rc<RefCell<VecDeque<Vec<u8>>>>,
    hears: Rc<RefCell<Vec<u8>>>,
}

impl ErrorType for Host {
    type Error = Infallible;
}

impl Read for Host {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let said = poll_fn(|_| match self.says.borrow_mut().pop_front() {
            None => Poll::Pending,
            Some(said) => Poll::Ready(said),
        })
        .await;
        bytes[..said.len()].copy_from_slice(&said);
        Ok(said.len())
    }
}

impl Write for Host {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.hears.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

fn queue() -> (HandedIn, HandedOut) {
    let room = Box::leak(vec![Handed::default(); 2].into_boxed_slice());
    let channel: &mut Channel<'static, Mutex, Handed> = Box::leak(Box::new(Channel::new(room)));
    channel.split()
}

#[test]
fn what_the_encoder_could_not_hand_on_is_counted_in_what_a_stop_is_answered_with() {
    let shared = Shared::new(Clock {
        now: || 0,
        hz: 1_000_000,
    });
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
    let port = Port {
        input: host.clone(),
        output: host.clone(),
    };
    let machine = Machine {
        stack: None,
        restart: |_| panic!("nobody has asked for it"),
    };
    let start = Start {
        streams: Streams::CODES,
        mains_hz: 50,
    };
    let (_made_in, made) = queue();
    let mut task = pin!(converse(
        port,
        &mut session,
        Some(start),
        (&mut frames, made),
        &shared,
        machine
    ));
    let mut context = Context::from_waker(Waker::noop());
    assert!(task.as_mut().poll(&mut context).is_pending());
    shared.made_lost.store(3, Relaxed);
    let mut buffer = [0; MAX_FRAME];
    let stop = Encoder::starting_at(0).encode(0, &ToDevice::Stop, &mut buffer);
    let stop = stop.expect("it fits").to_vec();
    // Whoever said it wakes the task; this test does.
    host.says.borrow_mut().push_back(stop);
    assert!(task.as_mut().poll(&mut context).is_pending());

    let mut decoder = Decoder::<MAX_FRAME>::new();
    let hears = host.hears.borrow();
    let mut bytes = &hears[..];
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
    // Hello and capabilities, the three, counts and answer.
    assert_eq!(seqs, [0, 1, 5, 6]);
}
