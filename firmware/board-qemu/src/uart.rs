//! UART 0, by interrupts, behind embedded-io-async.

use core::{cell::RefCell, convert::Infallible};

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

/// A byte has come.
pub(crate) fn receive() {
    UART0.write(uart::INTERRUPT, 0b10);
    while UART0.read(uart::STATE) & uart::RECEIVED != 0 {
        let [byte, ..] = UART0.read(uart::DATA).to_le_bytes();
        take_in(&[byte]);
    }
}

/// These bytes have come. What finds no room is lost, and its frame with it: the host sends it again.
pub(crate) fn take_in(mut bytes: &[u8]) {
    // In parts, because the pipe's end is not its room's.
    while let Ok(taken) = RECEIVED.try_write(bytes)
        && taken > 0
    {
        bytes = &bytes[taken..];
    }
}

/// There is room for a byte.
pub(crate) fn transmit() {
    UART0.write(uart::INTERRUPT, 0b01);
    pump();
}

fn pump() {
    critical_section::with(|section| {
        let leaving = &mut *LEAVING.borrow_ref_mut(section);
        while UART0.read(uart::STATE) & uart::SENDING == 0 {
            let Some(byte) = leaving.next() else { return };
            UART0.write(uart::DATA, byte.into());
        }
    });
}

/// Bytes that have left the pipe for the UART: some at once, because a pipe costs the same for one.
struct Leaving {
    bytes: [u8; 64],
    next: usize,
    end: usize,
}

static LEAVING: critical_section::Mutex<RefCell<Leaving>> =
    critical_section::Mutex::new(RefCell::new(Leaving {
        bytes: [0; 64],
        next: 0,
        end: 0,
    }));

impl Leaving {
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
