//! Responses of the device to the packets of the host.

/// Response of the device to a SETUP or OUT packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Handshake {
    Ack,
    Nak,
    Stall,
    /// No response, for example because the token is for another device or the device is not on the bus.
    Silent,
}

/// Response of the device to an IN token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    Packet {
        bytes: Vec<u8>,
        /// True if the data PID is DATA1.
        data1: bool,
    },
    Nak,
    Stall,
    /// No response, for example because the token is for another device or the device is not on the bus.
    Silent,
}
