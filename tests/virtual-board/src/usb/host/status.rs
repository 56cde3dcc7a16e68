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
    /// The device is configured, and its serial port is open: DTR is set.
    Open,
}

/// Traffic of the bulk endpoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Data packets received on bulk IN, including empty ones.
    pub packets_in: u64,
    /// Data packets of length 0 received on bulk IN.
    pub empty_packets_in: u64,
    /// Data bytes received on bulk IN.
    pub bytes_in: u64,
    /// Data packets that the device has acknowledged on bulk OUT.
    pub packets_out: u64,
    /// Data bytes that the device has acknowledged on bulk OUT.
    pub bytes_out: u64,
}
