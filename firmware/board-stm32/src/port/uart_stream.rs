//! UART with DMA in both directions, as streams of bytes (embedded-io-async).

use core::{
    convert::Infallible,
    future::poll_fn,
    task::{Poll, Waker},
};

use embedded_io_async::{Error, ErrorType, Read, Write};

/// UART transmitter whose DMA reads the bytes directly from the given slice.
pub(crate) trait Transmit {
    type Error: Error;

    /// Sends `bytes`. Returns when the DMA has moved all of them to the UART.
    async fn transmit(&mut self, bytes: &[u8]) -> Result<(), Self::Error>;
}

/// Ring buffer that a DMA channel fills continuously.
pub(crate) trait Ring {
    /// Moves the oldest bytes of the ring to `bytes`. Returns the number of bytes moved, 0 if the
    /// ring is empty.
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Overrun>;

    /// Registers the waker that is called when new bytes arrive.
    fn register_waker(&mut self, waker: &Waker);
}

/// Error: the DMA has overwritten bytes that had not been read. The ring is empty afterwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Overrun;

/// Writer that copies bytes to a buffer and sends them from there, because the DMA cannot access
/// every caller's memory. A write accepts at most as many bytes as the buffer holds.
pub(crate) struct DmaTransmitter<Line> {
    line: Line,
    buffer: &'static mut [u8],
}

impl<Line> DmaTransmitter<Line> {
    pub(crate) const fn new(line: Line, buffer: &'static mut [u8]) -> Self {
        Self { line, buffer }
    }
}

impl<Line: Transmit> ErrorType for DmaTransmitter<Line> {
    type Error = Line::Error;
}

impl<Line: Transmit> Write for DmaTransmitter<Line> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Line::Error> {
        let length = bytes.len().min(self.buffer.len());
        let buffer = &mut self.buffer[..length];
        buffer.copy_from_slice(&bytes[..length]);
        if length > 0 {
            self.line.transmit(buffer).await?;
        }
        Ok(length)
    }

    /// Does nothing: after a write, the UART holds at most two bytes and sends them by itself.
    async fn flush(&mut self) -> Result<(), Line::Error> {
        Ok(())
    }
}

/// Reader of the bytes that the host sends.
///
/// After an overrun of the ring, reception continues with the next byte. The lost bytes truncate a
/// frame or merge two frames, which the decoder detects and counts (`Stats.input_bad`).
pub(crate) struct RingReceiver<R>(pub(crate) R);

impl<R> ErrorType for RingReceiver<R> {
    type Error = Infallible;
}

impl<R: Ring> Read for RingReceiver<R> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|context| {
            self.0.register_waker(context.waker());
            loop {
                match self.0.read(bytes) {
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

    /// Size of the transmitter's buffer in these tests, bytes.
    const BUFFER: usize = 512;

    /// Transmitter that records every transfer.
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
    fn a_frame_longer_than_the_buffer_is_sent_whole_in_pieces_that_fit() {
        let frame: Vec<u8> = (0..=250).cycle().take(link::MAX_FRAME).collect();
        assert!(frame.len() > 2 * BUFFER);
        let mut transfers = Transfers::default();
        let mut port = DmaTransmitter::new(&mut transfers, Box::leak(Box::new([0; BUFFER])));
        block_on(port.write_all(&frame)).expect("the transmitter never fails");
        block_on(port.flush()).expect("the transmitter never fails");
        assert_eq!(transfers.0.concat(), frame);
        assert!(transfers.0.iter().all(|piece| piece.len() <= BUFFER));
    }

    #[test]
    fn a_write_of_nothing_starts_no_transfer() {
        let mut transfers = Transfers::default();
        let mut port = DmaTransmitter::new(&mut transfers, Box::leak(Box::new([0; BUFFER])));
        assert_eq!(block_on(port.write(&[])), Ok(0));
        assert!(transfers.0.is_empty());
    }

    /// Ring that returns the given results in order, and then no bytes.
    struct Script(VecDeque<Result<&'static [u8], Overrun>>);

    impl Ring for Script {
        fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Overrun> {
            let new = self.0.pop_front().unwrap_or(Ok(&[]))?;
            bytes[..new.len()].copy_from_slice(new);
            Ok(new.len())
        }

        fn register_waker(&mut self, _: &Waker) {}
    }

    #[test]
    fn reception_continues_after_an_overrun_without_an_error() {
        let script: [Result<&[u8], Overrun>; 5] =
            [Ok(&[1, 2]), Err(Overrun), Ok(&[]), Err(Overrun), Ok(&[3])];
        let mut port = RingReceiver(Script(script.into()));
        let mut bytes = [0; 8];
        assert_eq!(block_on(port.read(&mut bytes)), Ok(2));
        assert!(poll_once(port.read(&mut bytes)).is_pending(), "no bytes");
        assert_eq!(block_on(port.read(&mut bytes)), Ok(1));
        assert_eq!(bytes[0], 3);
    }
}
