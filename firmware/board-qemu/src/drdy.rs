//! The converter's DRDY, by timer 1: exactly as many edges a second as the model's ADC.

use core::{cell::Cell, future::poll_fn, task::Poll};

use critical_section::Mutex;
use embassy_sync::waitqueue::AtomicWaker;
use model::ADC_RATE_HZ;

use crate::{
    registers::{CLOCK_HZ, TIMER1, timer},
    time_driver::{TICKS_PER_US, all_ticks},
};

#[derive(Clone, Copy)]
struct Edges {
    /// Ticks of the first one.
    first: u64,
    /// Edges so far, and those of them that somebody waited for.
    came: u64,
    taken: u64,
}

static EDGES: Mutex<Cell<Edges>> = Mutex::new(Cell::new(Edges {
    first: 0,
    came: 0,
    taken: 0,
}));
static WAKER: AtomicWaker = AtomicWaker::new();

/// When edge number `index` is due, in ticks: the n-th lies at n / rate behind the first.
fn due(first: u64, index: u64) -> u64 {
    first + index * u64::from(CLOCK_HZ) / u64::from(ADC_RATE_HZ)
}

/// Lets the converter run; the first edge comes after a period, at these ticks. It falls on a whole
/// microsecond, so that the device times of all edges are those of any clock, but for where it began.
pub(crate) fn begin() -> u64 {
    critical_section::with(|section| {
        let edges = EDGES.borrow(section);
        let first = all_ticks() + due(0, 1);
        edges.set(Edges {
            first: first.next_multiple_of(u64::from(TICKS_PER_US)),
            ..edges.get()
        });
        arm(edges.get());
        edges.get().first
    })
}

/// Timer 1 has rung: an edge.
pub(crate) fn edge() {
    critical_section::with(|section| {
        let edges = EDGES.borrow(section);
        edges.set(Edges {
            came: edges.get().came + 1,
            ..edges.get()
        });
        arm(edges.get());
    });
    WAKER.wake();
}

/// Lets timer 1 ring at the next edge: once, because QEMU 7.2 lets a periodic timer ring at half its
/// rate under `-icount`.
fn arm(edges: Edges) {
    let wait = due(edges.first, edges.came)
        .saturating_sub(all_ticks())
        .max(1);
    TIMER1.write(timer::CONTROL, 0);
    TIMER1.write(timer::INTERRUPT, 1);
    let wait = u32::try_from(wait).unwrap_or(u32::MAX);
    TIMER1.write(timer::RELOAD, 0);
    TIMER1.write(timer::VALUE, wait);
    TIMER1.write(timer::CONTROL, timer::RUN);
}

/// An edge.
pub(crate) struct Edge {
    /// Device time, microseconds since boot, as a timer's capture would have it.
    pub(crate) us: u64,
    /// The same on the free-running timer, ticks; wraps.
    pub(crate) ticks: u32,
    /// Edges before it for which nobody came in time.
    pub(crate) missed: u64,
}

/// Waits for the next edge that was not taken; gives the newest.
pub(crate) async fn next() -> Edge {
    poll_fn(|context| {
        WAKER.register(context.waker());
        let (before, now) = critical_section::with(|section| {
            let edges = EDGES.borrow(section);
            let before = edges.get();
            edges.set(Edges {
                taken: before.came,
                ..before
            });
            (before.taken, edges.get())
        });
        if now.came == before {
            return Poll::Pending;
        }
        let edge = due(now.first, now.came - 1);
        #[expect(clippy::cast_possible_truncation, reason = "it wraps")]
        let ticks = edge as u32;
        Poll::Ready(Edge {
            us: edge / u64::from(TICKS_PER_US),
            ticks,
            missed: now.came - before - 1,
        })
    })
    .await
}
