//! UART 0, by interrupts, behind embedded-io-async.

use core::convert::Infallible;

use embassy_sync::pipe::Pipe;
use embedded_io_async::{ErrorType, Read, Write};
use firmware::Mutex;

use crate::registers::{UART0, uart};

/// Bytes on their way in and out.
static RECEIVED: Pipe<Mutex, 1024> = Pipe::new();
static SENDING: Pipe<Mutex, 256> = Pipe::new();

/// Enables both directions and their interrupts; QEMU has no baud rate, but wants a divider.
pub(crate) fn begin() {
    UART0.write(uart::BAUD_DIVIDER, 16);
    UART0.write(uart::CONTROL, 0b1111);
}

/// A byte has come. What finds no room is lost, and its frame with it: the host sends it again.
pub(crate) fn receive() {
    UART0.write(uart::INTERRUPT, 0b10);
    while UART0.read(uart::STATE) & uart::RECEIVED != 0 {
        let [byte, ..] = UART0.read(uart::DATA).to_le_bytes();
        let _ = RECEIVED.try_write(&[byte]);
    }
}

/// There is room for a byte.
pub(crate) fn transmit() {
    UART0.write(uart::INTERRUPT, 0b01);
    pump();
}

fn pump() {
    critical_section::with(|_| {
        while UART0.read(uart::STATE) & uart::SENDING == 0 {
            let mut byte = [0];
            if SENDING.try_read(&mut byte) != Ok(1) {
                return;
            }
            UART0.write(uart::DATA, byte[0].into());
        }
    });
}

/// From the host.
#[derive(Debug)]
pub(crate) struct Receiver;

/// To the host.
#[derive(Debug)]
pub(crate) struct Transmitter;

impl ErrorType for Receiver {
    type Error = Infallible;
}

impl ErrorType for Transmitter {
    type Error = Infallible;
}

impl Read for Receiver {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        Ok(RECEIVED.read(buffer).await)
    }
}

impl Write for Transmitter {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let written = SENDING.write(bytes).await;
        pump();
        Ok(written)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        pump();
        Ok(())
    }
}
