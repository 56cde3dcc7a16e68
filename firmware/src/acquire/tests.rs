//! What the acquisition does about orders, full queues and tests.

use core::{
    cell::Cell,
    future::{Future, poll_fn},
    pin::pin,
    task::{Context, Poll, Waker},
};
use std::{boxed::Box, vec, vec::Vec};

use embassy_sync::zerocopy_channel::Channel;
use link::{SelfTest, Streams};
use pipeline::Mains;

use super::*;
use crate::{Clock, Mutex, Stamped, StampedOut};

/// Samples that the queue of a test holds.
const ROOM: usize = 3;

/// A converter that gives as many samples as it is told, and waits then.
struct Counted<'c> {
    left: &'c Cell<u32>,
    given: u64,
    missed: u32,
    tested: Option<SelfTest>,
}

impl Converter for Counted<'_> {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        poll_fn(|_| match self.left.get() {
            0 => Poll::Pending,
            _ => Poll::Ready(()),
        })
        .await;
        self.left.update(|left| left - 1);
        self.given += 1;
        sample.counts[0] = i32::try_from(self.given).expect("few");
        Conversion {
            drdy_us: 1_953 * self.given,
            missed: self.missed,
            ..Conversion::default()
        }
    }

    fn tested(&self) -> Option<SelfTest> {
        self.tested.clone()
    }
}

/// An acquisition at rest, and what it hands on.
fn queue() -> (StampedIn, StampedOut) {
    let room = Box::leak(vec![Stamped::default(); ROOM].into_boxed_slice());
    let channel: &mut Channel<'static, Mutex, Stamped> = Box::leak(Box::new(Channel::new(room)));
    channel.split()
}

fn shared() -> &'static Shared {
    Box::leak(Box::new(Shared::new(Clock {
        now: || 0,
        hz: 1_000_000,
    })))
}

fn start(number: u32) -> Order {
    Order::Start(Run {
        number,
        mains: Mains::Hz50,
        streams: Streams::CODES,
    })
}

/// Runs an acquisition through what a test does: orders, how many samples come then, and what waits
/// for the encoder at the end of each: run, index and overrun mark of every sample.
fn handed_on(
    shared: &Shared,
    converter: Counted<'_>,
    left: &Cell<u32>,
    acts: &[(Option<Order>, u32)],
) -> Vec<Vec<(Option<u32>, u64, bool)>> {
    let (taken, mut out) = queue();
    let mut acquisition = Box::new(Acquisition::new(Mains::Hz50));
    let mut task = pin!(acquire(converter, shared, (taken, &mut acquisition)));
    let mut context = Context::from_waker(Waker::noop());
    let mut found = Vec::new();
    for (order, samples) in acts {
        if let Some(order) = order {
            shared.order(*order);
        }
        left.set(*samples);
        let _ = task.as_mut().poll(&mut context);
        assert_eq!(left.get(), 0, "it does not wait for anything else");
        let mut of_now = Vec::new();
        while let Some(slot) = out.try_receive() {
            let taken = &slot.taken;
            let run = taken.new_run.map(|run| run.number);
            of_now.push((run, taken.index, taken.marks.overrun));
            out.receive_done();
        }
        found.push(of_now);
    }
    found
}

#[test]
fn samples_are_handed_on_from_a_start_to_a_stop_and_a_run_begins_at_0() {
    let left = Cell::new(0);
    let shared = shared();
    let converter = Counted {
        left: &left,
        given: 0,
        missed: 0,
        tested: None,
    };
    let acts = [
        (None, 2),
        (Some(start(1)), 2),
        (None, 1),
        (Some(start(2)), 1),
        (Some(Order::Stop), 3),
    ];
    assert_eq!(
        handed_on(shared, converter, &left, &acts),
        [
            vec![],
            vec![(Some(1), 0, false), (None, 1, false)],
            vec![(None, 2, false)],
            vec![(Some(2), 0, false)],
            vec![],
        ]
    );
    assert_eq!(shared.counts().samples, 4);
    assert_eq!(shared.counts().overruns, 0);
}

#[test]
fn what_an_encoder_has_no_room_for_is_counted_and_marked_and_a_start_is_not_lost_with_it() {
    let left = Cell::new(0);
    let shared = shared();
    let converter = Counted {
        left: &left,
        given: 0,
        missed: 0,
        tested: None,
    };
    // The queue is full when the second run begins, whose first two samples find no room.
    let acts = [(start(1), ROOM + 2), (start(2), 2)];
    let (taken, mut out) = queue();
    let mut acquisition = Box::new(Acquisition::new(Mains::Hz50));
    let mut task = pin!(acquire(converter, shared, (taken, &mut acquisition)));
    let mut context = Context::from_waker(Waker::noop());
    for (order, samples) in acts {
        shared.order(order);
        left.set(u32::try_from(samples).expect("few"));
        let _ = task.as_mut().poll(&mut context);
    }
    for index in 0..ROOM as u64 {
        assert_eq!(out.try_receive().map(|slot| slot.taken.index), Some(index));
        out.receive_done();
    }
    left.set(1);
    let _ = task.as_mut().poll(&mut context);
    let slot = out.try_receive().expect("there is room again");
    assert_eq!(slot.taken.new_run.map(|run| run.number), Some(2));
    assert_eq!((slot.taken.index, slot.taken.marks.overrun), (2, true));
    assert_eq!(shared.counts().overruns, 4);
}

#[test]
fn samples_that_the_converter_missed_count_while_something_streams() {
    let left = Cell::new(0);
    let shared = shared();
    let converter = Counted {
        left: &left,
        given: 0,
        missed: 2,
        tested: None,
    };
    let found = handed_on(shared, converter, &left, &[(None, 5), (Some(start(1)), 1)]);
    assert_eq!(found[1], [(Some(1), 0, true)]);
    assert_eq!(shared.counts().overruns, 2);
}

#[test]
fn a_self_test_ends_what_streams_and_one_that_tests_nothing_is_not_passed() {
    for tested in [Some(SelfTest::default()), None] {
        let left = Cell::new(0);
        let shared = shared();
        let converter = Counted {
            left: &left,
            given: 0,
            missed: 0,
            tested: tested.clone(),
        };
        let acts = [(Some(start(1)), 1), (Some(Order::SelfTest), 2)];
        let found = handed_on(shared, converter, &left, &acts);
        assert_eq!(found[1], []);
        let result = shared.self_test.try_take().expect("a result");
        assert_eq!(result.fault.is_empty(), tested.is_some());
    }
}
