//! A UART with DMA in both directions, as streams of bytes.

use core::{
    convert::Infallible,
    future::poll_fn,
    task::{Poll, Waker},
};

use embedded_io_async::{Error, ErrorType, Read, Write};

/// A transmitter whose DMA reads the bytes from where they are.
pub(crate) trait Transmit {
    /// Why it fails.
    type Error: Error;

    /// Waits until the DMA has moved all bytes.
    async fn transmit(&mut self, bytes: &[u8]) -> Result<(), Self::Error>;
}

/// A ring that a DMA fills without end.
pub(crate) trait Ring {
    /// Takes the oldest bytes; 0 if there are none.
    fn take(&mut self, bytes: &mut [u8]) -> Result<usize, Overrun>;

    /// Registers the waker of the reader, which is woken after new bytes.
    fn wake_with(&mut self, waker: &Waker);
}

/// The DMA has overwritten bytes that were not taken; the ring is empty again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Overrun;

/// Sends from a buffer that the DMA can reach, which the callers' memory need not be. A write takes as
/// much as the buffer holds, so that no frame is too long.
pub(crate) struct Bounced<Line> {
    line: Line,
    buffer: &'static mut [u8],
}

impl<Line> Bounced<Line> {
    pub(crate) const fn new(line: Line, buffer: &'static mut [u8]) -> Self {
        Self { line, buffer }
    }
}

impl<Line: Transmit> ErrorType for Bounced<Line> {
    type Error = Line::Error;
}

impl<Line: Transmit> Write for Bounced<Line> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Line::Error> {
        let length = bytes.len().min(self.buffer.len());
        let buffer = &mut self.buffer[..length];
        buffer.copy_from_slice(&bytes[..length]);
        if length > 0 {
            self.line.transmit(buffer).await?;
        }
        Ok(length)
    }

    /// Nothing is held back: after a write at most two bytes are left, which the UART sends by itself.
    async fn flush(&mut self) -> Result<(), Line::Error> {
        Ok(())
    }
}

/// What the host sends.
///
/// Bytes that are lost cut a frame, or join two: the decoder finds that and counts it
/// (`Stats.input_bad`). Reception goes on with what comes next.
pub(crate) struct Received<R>(pub(crate) R);

impl<R> ErrorType for Received<R> {
    type Error = Infallible;
}

impl<R: Ring> Read for Received<R> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|context| {
            self.0.wake_with(context.waker());
            loop {
                match self.0.take(bytes) {
                    Ok(0) => return Poll::Pending,
                    Ok(length) => return Poll::Ready(Ok(length)),
                    Err(Overrun) => {}
                }
            }
        })
        .await
    }
}

#[cfg(test)]
mod tests {
    use std::{boxed::Box, collections::VecDeque, vec::Vec};

    use embassy_futures::{block_on, poll_once};

    use super::*;

    /// Bytes of a piece that the tests' DMA can reach.
    const ROOM: usize = 512;

    /// Notes every transfer.
    #[derive(Default)]
    struct Transfers(Vec<Vec<u8>>);

    impl Transmit for &mut Transfers {
        type Error = Infallible;

        async fn transmit(&mut self, bytes: &[u8]) -> Result<(), Infallible> {
            self.0.push(bytes.to_vec());
            Ok(())
        }
    }

    #[test]
    fn a_frame_longer_than_the_buffer_goes_out_whole_in_pieces_that_fit() {
        let frame: Vec<u8> = (0..=250).cycle().take(link::MAX_FRAME).collect();
        assert!(frame.len() > 2 * ROOM);
        let mut transfers = Transfers::default();
        let mut port = Bounced::new(&mut transfers, Box::leak(Box::new([0; ROOM])));
        block_on(port.write_all(&frame)).expect("it never fails");
        block_on(port.flush()).expect("it never fails");
        assert_eq!(transfers.0.concat(), frame);
        assert!(transfers.0.iter().all(|piece| piece.len() <= ROOM));
    }

    #[test]
    fn a_write_of_nothing_starts_no_transfer() {
        let mut transfers = Transfers::default();
        let mut port = Bounced::new(&mut transfers, Box::leak(Box::new([0; ROOM])));
        assert_eq!(block_on(port.write(&[])), Ok(0));
        assert!(transfers.0.is_empty());
    }

    /// What the ring answers, one after the other.
    struct Script(VecDeque<Result<&'static [u8], Overrun>>);

    impl Ring for Script {
        fn take(&mut self, bytes: &mut [u8]) -> Result<usize, Overrun> {
            let new = self.0.pop_front().unwrap_or(Ok(&[]))?;
            bytes[..new.len()].copy_from_slice(new);
            Ok(new.len())
        }

        fn wake_with(&mut self, _: &Waker) {}
    }

    #[test]
    fn reception_goes_on_after_an_overrun_and_never_fails() {
        let script: [Result<&[u8], Overrun>; 5] =
            [Ok(&[1, 2]), Err(Overrun), Ok(&[]), Err(Overrun), Ok(&[3])];
        let mut port = Received(Script(script.into()));
        let mut bytes = [0; 8];
        assert_eq!(block_on(port.read(&mut bytes)), Ok(2));
        assert!(
            poll_once(port.read(&mut bytes)).is_pending(),
            "nothing came"
        );
        assert_eq!(block_on(port.read(&mut bytes)), Ok(1));
        assert_eq!(bytes[0], 3);
    }
}
