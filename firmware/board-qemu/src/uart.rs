//! UART 0, driven by interrupts, as streams of bytes (embedded-io-async).

use core::{cell::RefCell, convert::Infallible};

use embassy_sync::pipe::Pipe;
use embedded_io_async::{ErrorType, Read, Write};
use firmware::RawMutex;

use crate::registers::{UART0, uart};

/// Bytes from the host that the conversation has not read yet.
static RECEIVED: Pipe<RawMutex, 1024> = Pipe::new();
/// Bytes to the host that have not been moved to [`OUTGOING`] yet.
static SENDING: Pipe<RawMutex, 256> = Pipe::new();

/// Enables both directions and their interrupts. QEMU ignores the baud rate, but requires that its
/// divider is set.
pub(crate) fn start() {
    UART0.write(uart::BAUD_DIVIDER, 16);
    UART0.write(uart::CONTROL, 0b1111);
}

/// Moves the received bytes to [`RECEIVED`]; called by the receive interrupt.
pub(crate) fn on_receive() {
    UART0.write(uart::INTERRUPT, 0b10);
    while UART0.read(uart::STATE) & uart::RECEIVE_FULL != 0 {
        let [byte, ..] = UART0.read(uart::DATA).to_le_bytes();
        push_received(&[byte]);
    }
}

/// Queues received bytes for the conversation task. Bytes that do not fit are lost, and so is their
/// frame; the host repeats the command.
pub(crate) fn push_received(mut bytes: &[u8]) {
    // Write in a loop: one write stops at the end of the pipe's memory even if there is room at its
    // start.
    while let Ok(taken) = RECEIVED.try_write(bytes)
        && taken > 0
    {
        bytes = &bytes[taken..];
    }
}

/// Passes more bytes to the UART; called by the transmit interrupt.
pub(crate) fn on_transmit() {
    UART0.write(uart::INTERRUPT, 0b01);
    fill_transmitter();
}

/// Moves bytes to the UART until its transmit buffer is full.
fn fill_transmitter() {
    critical_section::with(|section| {
        let outgoing = &mut *OUTGOING.borrow_ref_mut(section);
        while UART0.read(uart::STATE) & uart::TRANSMIT_FULL == 0 {
            let Some(byte) = outgoing.next() else { return };
            UART0.write(uart::DATA, byte.into());
        }
    });
}

/// Bytes taken from [`SENDING`] that the UART has not accepted yet: up to 64, because taking 64
/// bytes costs no more than taking one.
struct Outgoing {
    bytes: [u8; 64],
    next: usize,
    end: usize,
}

static OUTGOING: critical_section::Mutex<RefCell<Outgoing>> =
    critical_section::Mutex::new(RefCell::new(Outgoing { bytes: [0; 64], next: 0, end: 0 }));

impl Outgoing {
    fn next(&mut self) -> Option<u8> {
        if self.next == self.end {
            self.next = 0;
            self.end = SENDING.try_read(&mut self.bytes).unwrap_or(0);
        }
        let byte = self.bytes[..self.end].get(self.next).copied()?;
        self.next += 1;
        Some(byte)
    }
}

/// Input of the port: the bytes in [`RECEIVED`] as a reader.
#[derive(Debug)]
pub(crate) struct Receiver;

/// Output of the port: a writer to [`SENDING`].
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
        fill_transmitter();
        Ok(written)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        fill_transmitter();
        Ok(())
    }
}
