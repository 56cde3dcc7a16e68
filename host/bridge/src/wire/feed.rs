//! Where the bytes of a device come from: a port, or a program that is a device itself.

use bridge_core::HostTime;
use std::time::Duration;

use neuro_ros::DiagnosticStatus;

use crate::error::BridgeError;
use crate::wire::connection::{Connection, Event};

/// Connection to a device, as the streaming loop of this program uses it.
pub trait Feed {
    /// Waits for the next event. Bytes from the device are at the front of `buffer`. Meanwhile passes
    /// `outgoing` to the device and removes what it has accepted. Cancel safe.
    ///
    /// # Errors
    ///
    /// [`BridgeError`] if waiting is of no use, such as for an address that is no port.
    fn next_event(
        &mut self,
        buffer: &mut [u8],
        outgoing: &mut Vec<u8>,
    ) -> impl Future<Output = Result<Event, BridgeError>>;

    /// Returns whether the device is connected.
    fn is_open(&self) -> bool;

    /// Returns the name of the device's address for the log.
    fn name(&self) -> String;

    /// Returns the host time at which the bytes of the last event came from the device. The clock is
    /// fitted to this time.
    fn read_time(&self) -> HostTime {
        HostTime::now()
    }

    /// Silence of the device after which [`Feed::close_silently`] is called.
    fn silence_limit(&self) -> Duration {
        Duration::MAX
    }

    /// Disconnects from a silent device. The next event connects again.
    fn close_silently(&mut self) {}

    /// States whether the device has sent bytes that are no valid frame, and nothing else.
    fn mark_stranger(&mut self, _is_stranger: bool) {}

    /// Returns whether the last call of [`Feed::mark_stranger`] stated so.
    fn is_stranger(&self) -> bool {
        false
    }

    /// Returns the status of what the device measures, for `/diagnostics`; `None` if the device
    /// reports it itself. Called once a second.
    fn status(&mut self) -> Option<DiagnosticStatus> {
        None
    }
}

impl Feed for Connection {
    fn next_event(
        &mut self,
        buffer: &mut [u8],
        outgoing: &mut Vec<u8>,
    ) -> impl Future<Output = Result<Event, BridgeError>> {
        Connection::next_event(self, buffer, outgoing)
    }

    fn is_open(&self) -> bool {
        Connection::is_open(self)
    }

    fn name(&self) -> String {
        Connection::name(self)
    }

    fn silence_limit(&self) -> Duration {
        Connection::silence_limit(self)
    }

    fn close_silently(&mut self) {
        Connection::close_silently(self);
    }

    fn mark_stranger(&mut self, is_stranger: bool) {
        self.is_stranger = is_stranger;
    }

    fn is_stranger(&self) -> bool {
        self.is_stranger
    }
}
