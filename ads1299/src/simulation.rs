//! A chain without chips, in virtual time, behind the driver's own traits.
//!
//! What it holds the driver to: power-on and reset times, commands that only SDATAC lets through,
//! four tCLK between bytes and before a chip is deselected, reset values, read-only registers, a
//! reference that needs 150 ms, settling after START and after CONFIG1, a frame that the next sample
//! overwrites while it is read. What it makes of electrodes, gains, test signal, lead-off and noise
//! says `analogue.rs`.
//!
//! What it does not know: commands that the driver never sends, SRB1 and SRB2, the bias amplifier,
//! the sinc filter on anything but the test signal, and whatever a board adds.

mod analogue;
mod board;
mod burst;
mod chip;
mod external_clock;
mod fault;
mod noise;
mod wires;

use core::fmt;
use std::boxed::Box;
use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::vec::Vec;

use crate::CHANNELS;
use crate::alignment::Alignment;
use crate::chain::Chain;
use board::Board;

pub use board::Event;
pub use fault::Fault;
pub use wires::{SimulatedBus, SimulatedDelay, SimulatedLine, SimulatedReady};

/// What the simulated board is like.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The chips' clock, Hz.
    pub clock_hz: u32,
    /// SCLK for registers, Hz.
    pub register_hz: u32,
    /// SCLK for bursts, Hz.
    pub burst_hz: u32,
    /// Whether a don't-care bit stands between two chips.
    pub alignment: Alignment,
    /// Whether the DOUT of a chip reaches MISO when it alone is selected; otherwise only chip 0's.
    pub read_back: bool,
    /// Of the noise.
    pub seed: u64,
}

impl Default for Options {
    /// 2^21 Hz, SCLK of 100 kHz and 16 MHz, a don't-care bit as in the data sheet, every DOUT at MISO.
    fn default() -> Self {
        Self {
            clock_hz: 1 << 21,
            register_hz: 100_000,
            burst_hz: 16_000_000,
            alignment: Alignment::Spaced,
            read_back: true,
            seed: 1,
        }
    }
}

/// What the electrodes deliver. Called once per sample, with its number since the beginning, as soon
/// as a channel that is on converts its electrodes; samples of a self-test are not counted.
pub enum Electrodes<const CHIPS: usize> {
    /// Volts; the chip adds its noise, its gain and its clipping.
    Volts(Deliver<f64, CHIPS>),
    /// Counts, |count| <= 2^23, as they are to arrive, whatever the gain; without noise.
    Counts(Deliver<i32, CHIPS>),
}

/// Fills one sample by chip and channel.
pub type Deliver<T, const CHIPS: usize> = Box<dyn FnMut(u64, &mut [[T; CHANNELS]; CHIPS]) + Send>;

impl<const CHIPS: usize> Electrodes<CHIPS> {
    /// 0 V everywhere: nothing but the chips' noise.
    pub fn silent() -> Self {
        Self::Volts(Box::new(|_, volts| *volts = [[0.0; CHANNELS]; CHIPS]))
    }

    /// Volts from a function of the sample's number.
    pub fn volts(deliver: impl FnMut(u64, &mut [[f64; CHANNELS]; CHIPS]) + Send + 'static) -> Self {
        Self::Volts(Box::new(deliver))
    }

    /// Counts from a function of the sample's number.
    pub fn counts(
        deliver: impl FnMut(u64, &mut [[i32; CHANNELS]; CHIPS]) + Send + 'static,
    ) -> Self {
        Self::Counts(Box::new(deliver))
    }
}

/// A simulated chain; clones are the same chain. It has been off until now: its power comes on as it
/// is made ([`Simulation::power_off`] undoes that).
#[derive(Clone)]
pub struct Simulation<const CHIPS: usize>(Arc<Mutex<Board<CHIPS>>>);

/// The driver's chain on simulated wires.
pub type SimulatedChain<const CHIPS: usize> =
    Chain<SimulatedBus<CHIPS>, SimulatedLine<CHIPS>, SimulatedDelay<CHIPS>, CHIPS>;

impl<const CHIPS: usize> Simulation<CHIPS> {
    /// Power on.
    pub fn new(options: Options, electrodes: Electrodes<CHIPS>) -> Self {
        Self(Arc::new(Mutex::new(Board::new(options, electrodes))))
    }

    /// The wires, for the driver.
    pub fn chain(&self) -> SimulatedChain<CHIPS> {
        Chain {
            spi: SimulatedBus(self.clone()),
            selects: core::array::from_fn(|chip| SimulatedLine::select(self, chip)),
            start: SimulatedLine::start(self),
            reset: SimulatedLine::reset(self),
            delay: SimulatedDelay(self.clone()),
        }
    }

    /// DRDY of chip 0.
    pub fn drdy(&self) -> SimulatedReady<CHIPS> {
        SimulatedReady(self.clone())
    }

    /// Time since power on, us.
    pub fn time_us(&self) -> u64 {
        self.board().now_ns() / 1000
    }

    /// Lets time pass up to the next edge of DRDY and gives its time, ns; none if it does not come
    /// before a time, which it is then.
    pub fn pass_to_edge(&self, limit_ns: u64) -> Option<u64> {
        let mut board = self.board();
        let came = board.advance_to_edge_until(limit_ns);
        came.then(|| board.now_ns())
    }

    /// When the next conversion ends, ns since power on, if the chips convert; DRDY falls then.
    pub fn next_edge_ns(&self) -> Option<u64> {
        self.board().next_ns()
    }

    /// Lets time pass.
    pub fn pass_us(&self, us: u64) {
        let mut board = self.board();
        let then = board.now_ns() + us * 1000;
        board.advance(then);
    }

    /// Breaks a chip in one way, in place of what was broken before; `chip < CHIPS`, or nothing
    /// happens.
    pub fn inject(&self, chip: usize, fault: Fault) {
        self.board().set_fault(chip, Some(fault));
    }

    /// Mends a chip; registers that it lost stay lost.
    pub fn repair(&self, chip: usize) {
        self.board().set_fault(chip, None);
    }

    /// Switches the chips' supplies off: registers are lost, nothing answers, DRDY stays high. The
    /// driver's pins may do what they want meanwhile.
    pub fn power_off(&self) {
        self.board().power_off();
    }

    /// Switches them on again; the time until a reset is allowed starts again from zero.
    pub fn power_on(&self) {
        self.board().power_on();
    }

    /// Takes an electrode off or puts it back; chip and channel from 0.
    pub fn set_electrode(&self, chip: usize, channel: usize, positive: bool, on: bool) {
        self.board().set_electrode(chip, channel, positive, on);
    }

    /// How often the driver broke a rule of time: too early after power on or reset, too little
    /// between bytes, deselected too early, registers read at the speed of bursts.
    pub fn violations(&self) -> u32 {
        self.board().violations()
    }

    /// What has come over the wires, with the time in ns; data bytes and frames left out.
    pub fn events(&self) -> Vec<(u64, Event)> {
        self.board().events().to_vec()
    }

    fn board(&self) -> MutexGuard<'_, Board<CHIPS>> {
        // A panic elsewhere leaves a board that is still worth a look.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

// A virtual board may live in another thread.
const _: fn() = || {
    const fn is_send<T: Send + Sync>() {}
    is_send::<Simulation<8>>();
};

impl<const CHIPS: usize> fmt::Debug for Simulation<CHIPS> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Simulation").finish_non_exhaustive()
    }
}

/// Runs a future on simulated wires to its end: time is virtual, so nothing in it waits. None if it
/// waits for what never comes, such as an edge of DRDY without START.
pub fn finish<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}
