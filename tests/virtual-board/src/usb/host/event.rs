//! What happened on the bus, for a person who reads a log.

use std::fmt;

/// One thing that happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// The cable was plugged in.
    Plugged,
    /// The cable was unplugged.
    Unplugged,
    /// The device switched its pull-up on.
    Attached,
    /// The device switched its pull-up off, or lost its clock.
    Detached,
    /// The host has reset the bus.
    BusReset,
    /// The device has its address.
    Addressed(u8),
    /// The device is configured.
    Configured,
    /// The serial port is open: DTR is on.
    Opened,
    /// The serial port is closed: DTR is off.
    Closed,
    /// The host has stopped sending frames.
    Suspended,
    /// The host has resumed the bus.
    Resumed,
    /// An enumeration failed; the host tries again, up to three times.
    EnumerationFailed(String),
    /// The device has sent a notification.
    Notification(Vec<u8>),
    /// Something odd that breaks nothing.
    Note(&'static str),
}

impl fmt::Display for Event {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Addressed(address) => write!(formatter, "addressed as {address}"),
            Self::EnumerationFailed(why) => write!(formatter, "enumeration failed: {why}"),
            Self::Notification(bytes) => write!(formatter, "notification {bytes:02x?}"),
            Self::Note(what) => write!(formatter, "note: the device {what}"),
            plain => write!(formatter, "{plain:?}"),
        }
    }
}

/// An event and its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Logged {
    /// Virtual time, ns.
    pub at_ns: u64,
    /// What happened.
    pub event: Event,
}

impl fmt::Display for Logged {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} ns: {}", self.at_ns, self.event)
    }
}
