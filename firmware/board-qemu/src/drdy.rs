//! DRDY of the simulated converter: timer 1 generates the edges at the model's exact sampling rate.

use core::{cell::Cell, future::poll_fn, task::Poll};

use critical_section::Mutex;
use embassy_sync::waitqueue::AtomicWaker;
use model::ADC_RATE_HZ;

use crate::{
    registers::{CLOCK_HZ, TIMER1, timer},
    time_driver::{TICKS_PER_US, ticks_since_boot},
};

#[derive(Clone, Copy)]
struct Edges {
    /// Time of the first edge on the free-running timer, ticks.
    first: u64,
    /// Number of edges since the converter was started.
    count: u64,
    /// Value of `count` when [`next_edge`] last returned.
    taken: u64,
}

static EDGES: Mutex<Cell<Edges>> = Mutex::new(Cell::new(Edges { first: 0, count: 0, taken: 0 }));
static WAKER: AtomicWaker = AtomicWaker::new();

/// Returns the time of edge number `index` in ticks, rounded down; edge 0 is at `first`.
fn due(first: u64, index: u64) -> u64 {
    first + index * u64::from(CLOCK_HZ) / u64::from(ADC_RATE_HZ)
}

/// Starts the converter. Returns the time of the first edge in ticks: one sampling period from now,
/// rounded up to a whole microsecond. The device times of two emulations therefore differ by the
/// same constant at every edge.
pub(crate) fn start() -> u64 {
    critical_section::with(|section| {
        let edges = EDGES.borrow(section);
        let first = ticks_since_boot() + due(0, 1);
        edges.set(Edges { first: first.next_multiple_of(u64::from(TICKS_PER_US)), ..edges.get() });
        arm(edges.get());
        edges.get().first
    })
}

/// Counts an edge of DRDY; called when timer 1 expires.
pub(crate) fn on_edge() {
    critical_section::with(|section| {
        let edges = EDGES.borrow(section);
        edges.set(Edges { count: edges.get().count + 1, ..edges.get() });
        arm(edges.get());
    });
    WAKER.wake();
}

/// Sets timer 1 to expire once, at the next edge. A periodic timer cannot be used: under `-icount`,
/// QEMU 7.2 runs it at half its rate.
fn arm(edges: Edges) {
    let wait = due(edges.first, edges.count).saturating_sub(ticks_since_boot()).max(1);
    TIMER1.write(timer::CONTROL, 0);
    TIMER1.write(timer::INTERRUPT, 1);
    let wait = u32::try_from(wait).unwrap_or(u32::MAX);
    TIMER1.write(timer::RELOAD, 0);
    TIMER1.write(timer::VALUE, wait);
    TIMER1.write(timer::CONTROL, timer::RUN);
}

/// Newest edge of DRDY, as [`next_edge`] returns it.
pub(crate) struct Edge {
    /// Device time of the edge, microseconds since boot. Computed from the edge's number, so an
    /// interrupt that runs late does not change it.
    pub(crate) us: u64,
    /// Time of the edge on the free-running timer, ticks; wraps.
    pub(crate) ticks: u32,
    /// Number of edges between the edge of the previous call and this edge.
    pub(crate) missed: u64,
}

/// Waits for an edge that no earlier call has returned or counted as missed; returns the newest.
pub(crate) async fn next_edge() -> Edge {
    poll_fn(|context| {
        WAKER.register(context.waker());
        let (before, now) = critical_section::with(|section| {
            let edges = EDGES.borrow(section);
            let before = edges.get();
            edges.set(Edges { taken: before.count, ..before });
            (before.taken, edges.get())
        });
        if now.count == before {
            return Poll::Pending;
        }
        let edge = due(now.first, now.count - 1);
        #[expect(clippy::cast_possible_truncation, reason = "it wraps")]
        let ticks = edge as u32;
        Poll::Ready(Edge {
            us: edge / u64::from(TICKS_PER_US),
            ticks,
            missed: now.count - before - 1,
        })
    })
    .await
}
