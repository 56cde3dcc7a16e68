//! Edges of DRDY and when they came.

use core::{cell::Cell, future::poll_fn, task::Poll};

use ads1299::{Drdy, DrdyEdge};
use critical_section::{CriticalSection, Mutex};
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Instant, Timer, with_deadline};
use embedded_hal::digital::{self, ErrorKind, ErrorType};
use embedded_hal_async::digital::Wait;

use crate::{interrupts, trigger};

/// The lines of the interrupt `EXTI9_5`; DRDY is the only one of them that is enabled.
const LINES: u32 = 0b11_1110_0000;

#[derive(Clone, Copy)]
struct Seen {
    /// When the last one came, microseconds since boot.
    us: u64,
    /// Edges so far, and those of them that somebody waited for.
    came: u32,
    taken: u32,
}

static SEEN: Mutex<Cell<Seen>> = Mutex::new(Cell::new(Seen {
    us: 0,
    came: 0,
    taken: 0,
}));
static WAKER: AtomicWaker = AtomicWaker::new();

/// DRDY has fallen; called by its interrupt, the most urgent one after the time driver.
///
/// # Timing
/// The stamp is late by the time from the edge to here: the entry of an interrupt, a critical section
/// that may be open, and the time driver's interrupt, some 100 instructions.
pub(crate) fn edge() {
    let us = Instant::now().as_micros();
    interrupts::acknowledge(LINES);
    critical_section::with(|section| {
        let seen = SEEN.borrow(section);
        let before = seen.get();
        seen.set(Seen {
            us,
            came: before.came.wrapping_add(1),
            ..before
        });
    });
    WAKER.wake();
}

/// Takes all edges that came; gives what was before.
fn take(section: CriticalSection<'_>) -> Seen {
    let seen = SEEN.borrow(section);
    let before = seen.get();
    seen.set(Seen {
        taken: before.came,
        ..before
    });
    before
}

/// Waits for the next edge that was not taken; returns the newest. The trigger may have new edges until
/// it has come.
async fn next() -> DrdyEdge {
    trigger::allow();
    poll_fn(|context| {
        WAKER.register(context.waker());
        let before = critical_section::with(take);
        match before.came.wrapping_sub(before.taken) {
            0 => Poll::Pending,
            new => Poll::Ready(DrdyEdge {
                us: before.us,
                missed: new - 1,
            }),
        }
    })
    .await
}

/// DRDY, stamped in device time.
pub(crate) struct Edges;

impl Drdy for Edges {
    fn now_us(&self) -> u64 {
        Instant::now().as_micros()
    }

    async fn next_until(&mut self, us: u64) -> Option<DrdyEdge> {
        with_deadline(Instant::from_micros(us), next()).await.ok()
    }

    /// The trigger may have new edges meanwhile.
    async fn wait_until(&mut self, us: u64) {
        trigger::allow();
        Timer::at(Instant::from_micros(us)).await;
    }

    fn forget(&mut self) {
        critical_section::with(take);
    }
}

/// DRDY as the driver's self-test waits for it: for its falling edges alone, of which it notes the times.
#[derive(Debug, Default)]
pub(crate) struct Falls {
    /// Of the last one, microseconds since boot.
    pub(crate) us: Cell<u64>,
}

/// Nobody waits for anything but an edge that falls: the input is set for no other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnlyFalls;

impl digital::Error for OnlyFalls {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ErrorType for &Falls {
    type Error = OnlyFalls;
}

impl Wait for &Falls {
    /// The next one: those that came before are forgotten.
    async fn wait_for_falling_edge(&mut self) -> Result<(), OnlyFalls> {
        critical_section::with(take);
        self.us.set(next().await.us);
        Ok(())
    }

    async fn wait_for_high(&mut self) -> Result<(), OnlyFalls> {
        Err(OnlyFalls)
    }

    async fn wait_for_low(&mut self) -> Result<(), OnlyFalls> {
        Err(OnlyFalls)
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), OnlyFalls> {
        Err(OnlyFalls)
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), OnlyFalls> {
        Err(OnlyFalls)
    }
}
