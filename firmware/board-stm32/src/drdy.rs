//! Edges of DRDY, with the device time at which their interrupt ran.

use core::{cell::Cell, future::poll_fn, task::Poll};

use ads1299::{Drdy, DrdyEdge};
use critical_section::{CriticalSection, Mutex};
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Instant, Timer, with_deadline};

use crate::interrupts;

/// Bit mask of EXTI lines 5 to 9, which share the interrupt `EXTI9_5`. Only DRDY's line is
/// unmasked.
const LINES: u32 = 0b11_1110_0000;

#[derive(Clone, Copy)]
struct Edges {
    /// Device time at which the interrupt of the latest edge ran, microseconds since boot.
    last_us: u64,
    /// Number of edges of DRDY since boot; wraps.
    count: u32,
    /// Value of `count` when a task last took the edges.
    taken: u32,
}

static EDGES: Mutex<Cell<Edges>> = Mutex::new(Cell::new(Edges { last_us: 0, count: 0, taken: 0 }));
static WAKER: AtomicWaker = AtomicWaker::new();

/// Handles a falling edge of DRDY. Called by DRDY's interrupt, the most urgent interrupt after the
/// time driver's.
///
/// # Timing
/// The time stamp is late by the interrupt's latency, by the rest of a critical section if one is
/// active, and by the time driver's interrupt, some 100 instructions.
pub(crate) fn on_edge() {
    let us = Instant::now().as_micros();
    interrupts::clear_pending(LINES);
    critical_section::with(|section| {
        let edges = EDGES.borrow(section);
        let before = edges.get();
        edges.set(Edges { last_us: us, count: before.count.wrapping_add(1), ..before });
    });
    WAKER.wake();
}

/// Marks all edges so far as taken. Returns the state before the call.
fn take_edges(section: CriticalSection<'_>) -> Edges {
    let edges = EDGES.borrow(section);
    let before = edges.get();
    edges.set(Edges { taken: before.count, ..before });
    before
}

/// Calls `before_wait`, then waits for an edge that was not taken yet and returns the newest one.
async fn next_edge(before_wait: &impl Fn()) -> DrdyEdge {
    before_wait();
    poll_fn(|context| {
        WAKER.register(context.waker());
        let before = critical_section::with(take_edges);
        match before.count.wrapping_sub(before.taken) {
            0 => Poll::Pending,
            new => Poll::Ready(DrdyEdge { us: before.last_us, missed: new - 1 }),
        }
    })
    .await
}

/// DRDY input that stamps edges with the device time. Before every wait for an edge, it calls the
/// function in its field.
pub(crate) struct DrdyEdges<F>(pub(crate) F);

impl<F: Fn()> Drdy for DrdyEdges<F> {
    fn now_us(&self) -> u64 {
        Instant::now().as_micros()
    }

    async fn next_until(&mut self, us: u64) -> Option<DrdyEdge> {
        let next = next_edge(&self.0);
        with_deadline(Instant::from_micros(us), next).await.ok()
    }

    async fn wait_until(&mut self, us: u64) {
        (self.0)();
        Timer::at(Instant::from_micros(us)).await;
    }

    fn forget(&mut self) {
        critical_section::with(take_edges);
    }
}
