//! Simulated chain in virtual time, accessed through the driver's own traits.
//!
//! The digital model has power-on and reset times, commands that need SDATAC first, four tCLK
//! between bytes and before deselection, reset values, read-only registers, a reference that
//! settles in 150 ms, settling after START and after a write of CONFIG1, and a frame that the next
//! sample overwrites even while it is read. `miso.rs` models the read-back resistors, `analogue.rs`
//! electrodes, gains, test signal, lead-off, the impedance of electrodes and noise.
//!
//! Not modelled are SRB1 and the impedance of its electrode, the bias amplifier, the sinc filter on
//! other signals than the test signal and the excitation, capacitances, the circuits of a board,
//! and commands and settings that the driver never sends, such as a lead-off current at the
//! negative inputs.

mod analogue;
mod board;
mod chip;
mod miso;
mod options;
mod wires;

use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::vec::Vec;

use board::Board;
use wires::Role;

use crate::chain::Chain;

pub use board::Event;
pub use options::{Deliver, Electrodes, Fault, Options};
pub use wires::{SimulatedBus, SimulatedDelay, SimulatedLine, SimulatedReady};

/// A simulated chain; clones refer to the same chain. The supplies come on when the chain is
/// created ([`Simulation::power_off`] switches them off).
#[derive(Clone, Debug)]
pub struct Simulation<const CHIPS: usize>(SharedBoard<CHIPS>);

/// A [`Chain`] whose bus, pins and delay provider are simulated.
pub type SimulatedChain<const CHIPS: usize> =
    Chain<SimulatedBus<CHIPS>, SimulatedLine<CHIPS>, SimulatedDelay<CHIPS>, CHIPS>;

impl<const CHIPS: usize> Simulation<CHIPS> {
    /// Creates a chain whose supplies have just come on.
    pub fn new(options: Options, electrodes: Electrodes<CHIPS>) -> Self {
        let board = Board::new(options, electrodes);
        Self(SharedBoard(Arc::new(Mutex::new(board))))
    }

    /// Returns the SPI bus, the pins and the delay provider of this simulation, for the driver.
    pub fn chain(&self) -> SimulatedChain<CHIPS> {
        Chain {
            spi: SimulatedBus(self.0.clone()),
            selects: core::array::from_fn(|chip| SimulatedLine::new(&self.0, Role::Select(chip))),
            start: SimulatedLine::new(&self.0, Role::Start),
            reset: SimulatedLine::new(&self.0, Role::Reset),
            delay: SimulatedDelay(self.0.clone()),
        }
    }

    /// Returns the DRDY line of chip 0, for the driver.
    pub fn drdy(&self) -> SimulatedReady<CHIPS> {
        SimulatedReady(self.0.clone())
    }

    /// Returns the virtual time since this chain was created, in microseconds.
    pub fn time_us(&self) -> u64 {
        self.board().now_ns / 1000
    }

    /// Advances time to the next edge of DRDY and returns the edge's time in nanoseconds. Advances
    /// to `limit_ns` and returns `None` if there is no edge by then.
    pub fn pass_to_edge(&self, limit_ns: u64) -> Option<u64> {
        let mut board = self.board();
        let came = board.advance_to_edge_until(limit_ns);
        came.then(|| board.now_ns)
    }

    /// Returns the time at which the next conversion ends and DRDY falls, in nanoseconds since this
    /// chain was created; `None` while the chips are stopped.
    pub fn next_edge_ns(&self) -> Option<u64> {
        self.board().next_ns()
    }

    /// Advances virtual time by `us` microseconds, and performs the conversions that end by then.
    pub fn pass_us(&self, us: u64) {
        let mut board = self.board();
        let then = board.now_ns + us * 1000;
        board.advance(then);
    }

    /// Sets the fault of a chip and replaces a previous one. No effect if `chip >= CHIPS`.
    pub fn inject(&self, chip: usize, fault: Fault) {
        self.board().set_fault(chip, Some(fault));
    }

    /// Removes the fault of a chip; lost register values stay lost.
    pub fn repair(&self, chip: usize) {
        self.board().set_fault(chip, None);
    }

    /// Switches the chips' supplies off: registers are lost, no chip answers, DRDY stays high.
    /// While the supplies are off, the driver's pins may have any level.
    pub fn power_off(&self) {
        self.board().power_off();
    }

    /// Switches the supplies on; a reset is allowed again only after the power-on time.
    pub fn power_on(&self) {
        self.board().power_on();
    }

    /// Connects or disconnects the electrode at the positive input of a channel; `chip` and
    /// `channel` count from 0.
    pub fn set_electrode(&self, chip: usize, channel: usize, on: bool) {
        self.board().set_electrode(chip, channel, on);
    }

    /// Sets the impedance of the electrode at the positive input of a channel, in ohms. Before the
    /// first call, the impedance is 0. `chip` and `channel` count from 0.
    pub fn set_impedance(&self, chip: usize, channel: usize, ohms: f64) {
        self.board().set_impedance(chip, channel, ohms);
    }

    /// Returns how often the driver violated a rule: a reset, command or deselection too early, a
    /// byte before the previous one was decoded, or a byte while two cascaded chips drive MISO.
    pub fn violations(&self) -> u32 {
        self.board().violations
    }

    /// Returns the log of the wires, with times in nanoseconds: resets, START levels, and opcodes.
    pub fn events(&self) -> Vec<(u64, Event)> {
        self.board().events.clone()
    }

    /// Advances time to `now_ns`, in nanoseconds since creation; no effect for a time in the past.
    pub fn advance_to(&self, now_ns: u64) {
        self.board().advance(now_ns);
    }

    /// Transfers a byte that ends at `end_ns`, with an SCLK of `sclk_hz`, and returns the byte on
    /// MISO. With an SCLK that is too fast for the read-back resistors, the byte is damaged.
    pub fn transfer_at(&self, end_ns: u64, sclk_hz: u32, mosi: u8) -> u8 {
        self.board().clock_byte(mosi, end_ns, sclk_hz)
    }

    /// Returns the number of falling edges of DRDY since this chain was created.
    pub fn ready_edges(&self) -> u64 {
        self.board().edges
    }

    /// Returns the number of samples taken from the electrodes' signal source.
    pub fn samples_delivered(&self) -> u64 {
        self.board().delivered
    }

    fn board(&self) -> MutexGuard<'_, Board<CHIPS>> {
        self.0.lock()
    }
}

// A virtual board runs the chain in another thread, so `Simulation` must be `Send` and `Sync`.
const _: fn() = || {
    const fn is_send<T: Send + Sync>() {}
    is_send::<Simulation<8>>();
};

/// Runs a future on simulated wires to its end. Time is virtual, so one poll is enough. Returns
/// `None` if the future waits for something that never happens, such as DRDY without START.
pub fn finish<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

/// Handle of a simulated board; clones refer to one board.
#[derive(Clone)]
struct SharedBoard<const CHIPS: usize>(Arc<Mutex<Board<CHIPS>>>);

impl<const CHIPS: usize> SharedBoard<CHIPS> {
    fn lock(&self) -> MutexGuard<'_, Board<CHIPS>> {
        // A lock that a panic in another thread has poisoned is still used, so that a test can
        // inspect the board.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<const CHIPS: usize> core::fmt::Debug for SharedBoard<CHIPS> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("SharedBoard").finish_non_exhaustive()
    }
}
