//! Log of the events on the bus.

use std::fmt;

/// Event on the bus or in the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// The cable was plugged in: VBUS is on.
    Plugged,
    /// The cable was unplugged: VBUS is off.
    Unplugged,
    /// The device has enabled its pull-up.
    Attached,
    /// The device has disabled its pull-up, or lost its clock.
    Detached,
    /// The host has ended a bus reset; the recovery time of the device starts.
    BusReset,
    /// The device has accepted this address.
    Addressed(u8),
    /// The host has read all descriptors and set the configuration.
    Configured,
    /// The host has opened the serial port: DTR is set.
    Opened,
    /// The host has closed the serial port: DTR is clear.
    Closed,
    /// The host has suspended the bus: it sends no more frames.
    Suspended,
    /// The host has resumed the bus, and the recovery time of the device is over.
    Resumed,
    /// An enumeration has failed, for this reason; the host makes at most three attempts.
    EnumerationFailed(String),
    /// The device has sent a notification with these bytes.
    Notification(Vec<u8>),
    /// The device has shown unusual behaviour that is not a violation.
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

/// Entry in the log of the USB host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Logged {
    /// Virtual time of the event since power-on, in ns.
    pub at_ns: u64,
    /// Event that occurred at `at_ns`.
    pub event: Event,
}

impl fmt::Display for Logged {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} ns: {}", self.at_ns, self.event)
    }
}
