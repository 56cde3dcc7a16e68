//! Converting state of a chain, in which frames are read.

use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use embedded_hal::digital::{Error as _, OutputPin};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::digital::Wait;

use crate::bus::Bus;
use crate::chain::Chain;
use crate::clock::Clock;
use crate::command::DECODE;
use crate::error::{Error, Pin};
use crate::rate::Rate;

/// A converting chain: one frame per falling edge of DRDY, until the chain is stopped. While it
/// converts, registers cannot be accessed.
#[derive(Debug)]
pub struct Streaming<'a, Spi, Line, Delay, const CHIPS: usize> {
    /// The chain, for firmware that clocks frames by DMA. For each frame the firmware sets all selects
    /// low, sends [`frame_bytes`](crate::frame::frame_bytes) zeros, waits 4 tCLK and sets all selects
    /// high.
    pub chain: &'a mut Chain<Spi, Line, Delay, CHIPS>,
    clock: Clock,
    rate: Rate,
}

impl<'a, Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize>
    Streaming<'a, Spi, Line, Delay, CHIPS>
{
    pub(crate) fn new(
        chain: &'a mut Chain<Spi, Line, Delay, CHIPS>,
        clock: Clock,
        rate: Rate,
    ) -> Self {
        Self { chain, clock, rate }
    }

    /// Waits for DRDY to fall.
    ///
    /// # Errors
    /// [`Error::NeverReady`] if DRDY does not fall within the settling time and four sample periods,
    /// which is long enough for the first sample too. The error names chip 0, whose DRDY is wired.
    /// [`Error::Pin`] when the pin fails.
    pub async fn ready(&mut self, drdy: &mut impl Wait) -> Result<(), Error> {
        let cycles = self.rate.settling() + 4 * self.rate.divider();
        let waited_us = self.clock.microseconds(cycles);
        let mut edge = pin!(drdy.wait_for_falling_edge());
        let mut late = pin!(self.chain.delay.delay_us(waited_us));
        poll_fn(|context| {
            if let Poll::Ready(edge) = edge.as_mut().poll(context) {
                let edge = edge.map_err(|error| Error::Pin(Pin::Ready, error.kind()));
                return Poll::Ready(edge);
            }
            let late = late.as_mut().poll(context);
            late.map(|()| Err(Error::NeverReady { chip: 0, waited_us }))
        })
        .await
    }

    /// Clocks one frame out of the chips: [`frame_bytes`](crate::frame::frame_bytes) bytes for
    /// [`Decoder::decode`](crate::decoder::Decoder::decode).
    ///
    /// # Errors
    /// When the bus or a pin fails.
    ///
    /// # Timing
    /// Call it directly after DRDY falls; the call must end before DRDY falls again. Clocking takes 108
    /// us for eight chips at 16 MHz, and 3 us more pass until the chips are deselected.
    pub async fn read(&mut self, frame: &mut [u8]) -> Result<(), Error> {
        // The chips would execute an opcode sent here, so only zeros are sent: 0 is not an opcode.
        frame.fill(0);
        self.chain.select(0..CHIPS, true)?;
        let result = self.chain.transfer(frame).await;
        self.chain.wait(DECODE).await;
        result.and(self.chain.select(0..CHIPS, false))
    }

    /// Stops conversion: START low, SCLK for registers, SDATAC.
    ///
    /// # Errors
    /// When the bus or a pin fails.
    pub async fn stop(self) -> Result<(), Error> {
        self.chain.halt().await
    }
}
