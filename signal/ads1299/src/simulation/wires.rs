//! Implementations of the driver's bus, pin and delay traits on a simulated board.

use core::convert::Infallible;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi;
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::SpiBus;

use crate::bus::{Bus, Drdy, DrdyEdge, Speed, TooFast};
use crate::simulation::SharedBoard;

/// SPI bus (SCLK, MOSI, MISO) of a simulated board.
#[derive(Debug)]
pub struct SimulatedBus<const CHIPS: usize>(pub(super) SharedBoard<CHIPS>);

/// Output pin of a simulated board: a chip select, START or RESET.
#[derive(Debug)]
pub struct SimulatedLine<const CHIPS: usize> {
    board: SharedBoard<CHIPS>,
    role: Role,
}

/// Signal that a pin drives.
#[derive(Debug)]
pub(super) enum Role {
    Select(usize),
    Start,
    Reset,
}

/// DRDY line of chip 0 of a simulated board.
#[derive(Debug)]
pub struct SimulatedReady<const CHIPS: usize>(pub(super) SharedBoard<CHIPS>);

/// Delay provider that advances virtual time.
#[derive(Debug)]
pub struct SimulatedDelay<const CHIPS: usize>(pub(super) SharedBoard<CHIPS>);

impl<const CHIPS: usize> SimulatedLine<CHIPS> {
    pub(super) fn new(board: &SharedBoard<CHIPS>, role: Role) -> Self {
        let board = board.clone();
        Self { board, role }
    }

    fn set(&self, high: bool) {
        let mut board = self.board.lock();
        match self.role {
            Role::Select(chip) => board.set_select(chip, high),
            Role::Start => board.set_start(high),
            Role::Reset => board.set_reset(high),
        }
    }
}

impl<const CHIPS: usize> digital::ErrorType for SimulatedLine<CHIPS> {
    type Error = Infallible;
}

impl<const CHIPS: usize> OutputPin for SimulatedLine<CHIPS> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

impl<const CHIPS: usize> spi::ErrorType for SimulatedBus<CHIPS> {
    type Error = Infallible;
}

impl<const CHIPS: usize> SpiBus for SimulatedBus<CHIPS> {
    async fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        words.fill(0);
        self.transfer_in_place(words).await
    }

    async fn write(&mut self, words: &[u8]) -> Result<(), Infallible> {
        let mut board = self.0.lock();
        for word in words {
            board.transfer(*word);
        }
        Ok(())
    }

    async fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), Infallible> {
        let mut board = self.0.lock();
        for place in 0..read.len().max(write.len()) {
            let answer = board.transfer(write.get(place).copied().unwrap_or(0));
            if let Some(word) = read.get_mut(place) {
                *word = answer;
            }
        }
        Ok(())
    }

    async fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        let mut board = self.0.lock();
        for word in words {
            *word = board.transfer(*word);
        }
        Ok(())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl<const CHIPS: usize> Bus for SimulatedBus<CHIPS> {
    fn set_speed(&mut self, speed: Speed) -> Result<(), TooFast> {
        self.0.lock().speed = speed;
        Ok(())
    }
}

impl<const CHIPS: usize> DelayNs for SimulatedDelay<CHIPS> {
    async fn delay_ns(&mut self, ns: u32) {
        let mut board = self.0.lock();
        let then = board.now_ns + u64::from(ns);
        board.advance(then);
    }
}

impl<const CHIPS: usize> Drdy for SimulatedReady<CHIPS> {
    fn now_us(&self) -> u64 {
        self.0.lock().now_ns / 1000
    }

    async fn next_until(&mut self, us: u64) -> Option<DrdyEdge> {
        let mut board = self.0.lock();
        let edge_ns = board.advance_to_edge_until(us * 1000).then(|| board.now_ns)?;
        Some(DrdyEdge { us: edge_ns / 1000, missed: 0 })
    }

    async fn wait_until(&mut self, us: u64) {
        self.0.lock().advance(us * 1000);
    }

    /// Does nothing: the simulated line stores no edges, so there is none to discard.
    fn forget(&mut self) {}
}
