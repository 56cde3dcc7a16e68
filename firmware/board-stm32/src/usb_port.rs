//! A serial port over USB as streams of bytes: whole packets, and a host that opens and closes.

use embassy_futures::select::{Either, select};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};

/// Bytes of a packet at full speed (USB 2.0, 5.8.3).
pub(crate) const PACKET: usize = 64;

/// The host is not there, or has closed the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Closed;

impl core::fmt::Display for Closed {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str("the host has closed the port")
    }
}

impl core::error::Error for Closed {}

impl embedded_io_async::Error for Closed {
    fn kind(&self) -> ErrorKind {
        ErrorKind::NotConnected
    }
}

/// Packets to the host.
pub(crate) trait ToHost {
    /// Whether the host holds the port open (DTR).
    fn is_open(&self) -> bool;

    /// Waits until a host has set the device up.
    async fn set_up(&mut self);

    /// Waits until the host has read the packet before, and hands this one over; given up before that,
    /// none of it goes.
    async fn send(&mut self, packet: &[u8]) -> Result<(), Closed>;

    /// Waits until it is time to look whether the port is open.
    fn tick(&self) -> impl Future<Output = ()> + use<Self>;
}

/// Packets from the host.
pub(crate) trait FromHost {
    /// Waits for a packet; `packet` has room for the longest.
    async fn receive(&mut self, packet: &mut [u8]) -> Result<usize, Closed>;
}

/// What the host sends.
pub(crate) struct Receiver<Port>(pub(crate) Port);

impl<Port> ErrorType for Receiver<Port> {
    type Error = Closed;
}

impl<Port: FromHost> Read for Receiver<Port> {
    /// `bytes` has room for a packet.
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Closed> {
        loop {
            match self.0.receive(bytes).await? {
                // A packet of no length says no more than that there is no more.
                0 => {}
                length => return Ok(length),
            }
        }
    }
}

/// Sends while the host holds the port open: what it does not read waits as frames, of which the oldest
/// are dropped.
///
/// A frame whose beginning has gone when the port closes is not ended in another opening: whoever
/// opens the port next gets a frame from its first zero.
pub(crate) struct Transmitter<Port> {
    port: Port,
    /// A full packet was the last: the host's driver waits for more until a shorter one ends it.
    last_was_full: bool,
    /// Bytes of a frame have gone, and not its last one.
    is_within_frame: bool,
}

impl<Port: ToHost> Transmitter<Port> {
    /// Nothing sent.
    pub(crate) const fn new(port: Port) -> Self {
        Self {
            port,
            last_was_full: false,
            is_within_frame: false,
        }
    }

    async fn opened(&mut self) {
        self.port.set_up().await;
        while !self.port.is_open() {
            self.port.tick().await;
        }
    }

    /// Sends a packet, unless the port closes before the host takes it.
    async fn packet(&mut self, bytes: &[u8]) -> Result<(), Closed> {
        loop {
            // Looks again and again while the host takes nothing.
            let tick = self.port.tick();
            match select(self.port.send(bytes), tick).await {
                Either::First(result) => return result,
                Either::Second(()) if !self.port.is_open() => return Err(Closed),
                Either::Second(()) => {}
            }
        }
    }
}

impl<Port> ErrorType for Transmitter<Port> {
    type Error = Closed;
}

impl<Port: ToHost> Write for Transmitter<Port> {
    /// After an error the next bytes begin a frame.
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Closed> {
        let is_within_frame = core::mem::take(&mut self.is_within_frame);
        if !self.port.is_open() {
            if is_within_frame {
                return Err(Closed);
            }
            self.opened().await;
        }
        let packet = &bytes[..bytes.len().min(PACKET)];
        self.packet(packet).await?;
        self.last_was_full = packet.len() == PACKET;
        // A zero ends a frame, and begins one: the packet of a first zero alone is none of a frame.
        self.is_within_frame = packet.last().is_some_and(|&byte| byte != 0);
        Ok(packet.len())
    }

    async fn flush(&mut self) -> Result<(), Closed> {
        if core::mem::take(&mut self.last_was_full) && self.port.is_open() {
            self.packet(&[]).await?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
