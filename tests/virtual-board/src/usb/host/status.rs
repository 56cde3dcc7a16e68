//! State of the host and its traffic counters.

/// Progress of the host with the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// There is no device on the bus.
    Detached,
    /// The device has no address yet.
    Attached,
    /// The device has an address and is not configured.
    Addressed,
    /// The device is configured, its serial port is closed.
    Configured,
    /// The serial port is open.
    Open,
}

/// Traffic of the bulk endpoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Packets from the device.
    pub packets_in: u64,
    /// Packets of length 0 from the device.
    pub empty_packets_in: u64,
    /// Bytes from the device.
    pub bytes_in: u64,
    /// Packets to the device.
    pub packets_out: u64,
    /// Bytes to the device.
    pub bytes_out: u64,
}
