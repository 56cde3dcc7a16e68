//! Tests of the acquisition task: orders, a full queue, missed samples and self-tests.

use core::{
    cell::Cell,
    future::poll_fn,
    pin::pin,
    task::{Context, Poll, Waker},
};
use std::{boxed::Box, vec, vec::Vec};

use embassy_sync::zerocopy_channel::Channel;
use link::Streams;
use pipeline::Mains;

use super::*;
use crate::{
    queues::{RawMutex, SampleReceiver, SampleSlot},
    timing::Clock,
};

/// Number of slots in the tests' sample queue, small so that few samples fill it.
const DEPTH: usize = 3;

/// Converter that delivers `left` samples, then waits until the test increases `left`.
struct Counted<'c> {
    left: &'c Cell<u32>,
    delivered: u64,
    missed: u32,
    self_test_result: Option<SelfTest>,
}

impl<'c> Counted<'c> {
    const fn new(left: &'c Cell<u32>) -> Self {
        Self { left, delivered: 0, missed: 0, self_test_result: None }
    }
}

impl Converter for Counted<'_> {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        poll_fn(|_| match self.left.get() {
            0 => Poll::Pending,
            _ => Poll::Ready(()),
        })
        .await;
        self.left.update(|left| left - 1);
        self.delivered += 1;
        sample.counts[0] = i32::try_from(self.delivered).expect("few");
        Conversion { drdy_us: 1_953 * self.delivered, missed: self.missed, ..Conversion::default() }
    }

    fn self_test_result(&self) -> Option<SelfTest> {
        self.self_test_result.clone()
    }
}

fn queue() -> (SampleSender, SampleReceiver) {
    let slots = Box::leak(vec![SampleSlot::default(); DEPTH].into_boxed_slice());
    let channel: &mut Channel<'static, RawMutex, SampleSlot> =
        Box::leak(Box::new(Channel::new(slots)));
    channel.split()
}

fn shared() -> &'static Shared {
    Box::leak(Box::new(Shared::new(Clock { now: || 0, hz: 1_000_000 })))
}

fn start(number: u32) -> Order {
    Order::Start(Run { number, mains: Mains::Hz50, streams: Streams::CODES })
}

/// A queued sample: number of the run if the sample starts one, index of the sample, and whether an
/// overrun marks the sample.
type Queued = (Option<u32>, u64, bool);

/// Runs an acquisition task through `acts`; each act is an optional order, then a number of
/// samples. After the act with an index for which `is_read(index)` is true, empties the queue;
/// otherwise the samples stay queued. Returns, for each act, the samples taken from the queue after
/// the act.
fn handed_over(
    shared: &Shared,
    converter: Counted<'_>,
    left: &Cell<u32>,
    acts: &[(Option<Order>, u32)],
    is_read: impl Fn(usize) -> bool,
) -> Vec<Vec<Queued>> {
    let (sender, mut receiver) = queue();
    let mut acquisition = Box::new(Acquisition::new(Mains::Hz50));
    let mut task = pin!(acquire(converter, shared, (sender, &mut acquisition)));
    let mut context = Context::from_waker(Waker::noop());
    let mut found = Vec::new();
    for (number, (order, samples)) in acts.iter().enumerate() {
        if let Some(order) = order {
            shared.send_order(*order);
        }
        left.set(*samples);
        let _ = task.as_mut().poll(&mut context);
        assert_eq!(left.get(), 0, "the task waits for nothing but samples");
        let mut queued = Vec::new();
        while is_read(number)
            && let Some(slot) = receiver.try_receive()
        {
            let acquired = &slot.acquired;
            let run = acquired.new_run.map(|run| run.number);
            let marks = acquired.marks.union(acquired.lost);
            queued.push((run, acquired.index, marks.overrun));
            receiver.receive_done();
        }
        found.push(queued);
    }
    found
}

#[test]
fn samples_are_queued_from_start_to_stop_and_each_run_counts_from_0() {
    let left = Cell::new(0);
    let shared = shared();
    let converter = Counted::new(&left);
    let acts =
        [(None, 2), (Some(start(1)), 2), (None, 1), (Some(start(2)), 1), (Some(Order::Stop), 3)];
    assert_eq!(
        handed_over(shared, converter, &left, &acts, |_| true),
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
fn samples_that_find_the_queue_full_are_counted_and_marked_and_the_start_of_a_run_is_kept() {
    let left = Cell::new(0);
    let shared = shared();
    let converter = Counted::new(&left);
    // Run 1 fills the queue and loses 2 samples; run 2 then loses its first 2 samples.
    let more = u32::try_from(DEPTH + 2).expect("few");
    let acts = [(Some(start(1)), more), (Some(start(2)), 2), (None, 1)];
    let found = handed_over(shared, converter, &left, &acts, |act| act > 0);
    let first = [(Some(1), 0, false), (None, 1, false), (None, 2, false)];
    assert_eq!(found, [vec![], first.to_vec(), vec![(Some(2), 2, true)]]);
    assert_eq!(shared.counts().overruns, 4);
}

#[test]
fn samples_that_the_converter_missed_are_counted_during_a_run() {
    let left = Cell::new(0);
    let shared = shared();
    let converter = Counted { missed: 2, ..Counted::new(&left) };
    let acts = [(None, 5), (Some(start(1)), 1)];
    let found = handed_over(shared, converter, &left, &acts, |_| true);
    assert_eq!(found[1], [(Some(1), 0, true)]);
    assert_eq!(shared.counts().overruns, 2);
}

#[test]
fn a_self_test_ends_the_run_and_one_without_a_result_reports_a_fault() {
    for result in [Some(SelfTest::default()), None] {
        let left = Cell::new(0);
        let shared = shared();
        let converter = Counted { self_test_result: result.clone(), ..Counted::new(&left) };
        let acts = [(Some(start(1)), 1), (Some(Order::SelfTest), 2)];
        let found = handed_over(shared, converter, &left, &acts, |_| true);
        assert_eq!(found[1], []);
        let published = shared.self_test_result.try_take().expect("a result");
        assert_eq!(published.fault.is_empty(), result.is_some());
    }
}
