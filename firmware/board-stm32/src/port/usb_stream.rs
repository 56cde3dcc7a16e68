//! Streams of bytes over the USB serial port, which the host opens and closes at any time.

use embassy_futures::select::{Either, select};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};

/// Largest number of bytes in a bulk packet at full speed (USB 2.0, section 5.8.3).
pub(crate) const PACKET: usize = 64;

/// Error: no host is connected, or the host has closed the port.
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

/// Endpoint that sends packets to the host.
pub(crate) trait PacketSender {
    /// Returns whether the host has the port open, as the signal DTR states.
    fn is_open(&self) -> bool;

    /// Waits until a host has configured the device.
    async fn wait_configured(&mut self);

    /// Waits until the host has read the previous packet, then passes `packet` to the peripheral.
    /// If the future is dropped while it waits, no byte of `packet` is sent.
    async fn send(&mut self, packet: &[u8]) -> Result<(), Closed>;

    /// Waits for the interval between two checks of [`is_open`](Self::is_open).
    fn tick(&self) -> impl Future<Output = ()> + use<Self>;
}

/// Endpoint that receives packets from the host.
pub(crate) trait PacketReceiver {
    /// Waits for a packet and returns its length; `packet` must hold [`PACKET`] bytes.
    async fn receive(&mut self, packet: &mut [u8]) -> Result<usize, Closed>;
}

/// Reader of the bytes that the host sends.
pub(crate) struct Receiver<Port>(pub(crate) Port);

impl<Port> ErrorType for Receiver<Port> {
    type Error = Closed;
}

impl<Port: PacketReceiver> Read for Receiver<Port> {
    /// Reads one packet; `bytes` must hold [`PACKET`] bytes.
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Closed> {
        loop {
            match self.0.receive(bytes).await? {
                // An empty packet only ends a transfer. Returning 0 bytes would end the stream.
                0 => {}
                length => return Ok(length),
            }
        }
    }
}

/// Writer that sends while the host has the port open. While the host reads nothing, the frames
/// wait in the conversation's ring, which drops the oldest ones when it is full.
///
/// If the port closes within a frame, the rest of the frame is dropped. After the port opens again,
/// the host receives whole frames, beginning with the zero byte before the first one.
pub(crate) struct Transmitter<Port> {
    port: Port,
    /// Set if the last packet was full. The host's driver then waits for a shorter packet, which
    /// ends the transfer.
    last_was_full: bool,
    /// Set if the last packet ended within a frame.
    is_within_frame: bool,
}

impl<Port: PacketSender> Transmitter<Port> {
    pub(crate) const fn new(port: Port) -> Self {
        Self { port, last_was_full: false, is_within_frame: false }
    }

    async fn wait_open(&mut self) {
        self.port.wait_configured().await;
        while !self.port.is_open() {
            self.port.tick().await;
        }
    }

    /// Sends a packet. Returns [`Closed`] if the port closes before the host has read the previous
    /// packet.
    async fn send_packet(&mut self, bytes: &[u8]) -> Result<(), Closed> {
        loop {
            // While the host reads nothing, check at every tick whether the port is still open.
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

impl<Port: PacketSender> Write for Transmitter<Port> {
    /// Waits until the port is open, then sends one packet. After an error, the next write must
    /// start with a new frame.
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Closed> {
        let is_within_frame = core::mem::take(&mut self.is_within_frame);
        if !self.port.is_open() {
            if is_within_frame {
                return Err(Closed);
            }
            self.wait_open().await;
        }
        let packet = &bytes[..bytes.len().min(PACKET)];
        self.send_packet(packet).await?;
        self.last_was_full = packet.len() == PACKET;
        // A zero byte ends a frame. A packet that only holds the zero byte before a frame does not
        // start the frame yet.
        self.is_within_frame = packet.last().is_some_and(|&byte| byte != 0);
        Ok(packet.len())
    }

    async fn flush(&mut self) -> Result<(), Closed> {
        if core::mem::take(&mut self.last_was_full) && self.port.is_open() {
            self.send_packet(&[]).await?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
