//! State of the USB host and its traffic counters.

/// State of the device as the host sees it; the variants are in the order in which a device reaches them.
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

/// Traffic of the bulk endpoints since the host was created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Number of data packets received on bulk IN, including empty ones.
    pub packets_in: u64,
    /// Number of data packets of length 0 received on bulk IN.
    pub empty_packets_in: u64,
    /// Number of data bytes received on bulk IN.
    pub bytes_in: u64,
    /// Number of data packets that the device has acknowledged on bulk OUT.
    pub packets_out: u64,
    /// Number of data bytes that the device has acknowledged on bulk OUT.
    pub bytes_out: u64,
}
