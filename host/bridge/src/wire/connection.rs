//! Connection to a port that can disappear and return.

use std::io;
use std::time::Duration;

use bridge_core::{Core, HostTime};
use neuro_ros::DiagnosticStatus;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};

use crate::error::BridgeError;
use crate::wire::opener::{OpenError, PortOpener};
use crate::wire::port::{PORT_TIMEOUT, Port, PortAddress, Transfer};

/// A port that is opened again whenever it is lost.
#[derive(Debug)]
pub(crate) struct Connection {
    opener: PortOpener,
    state: State,
    /// Since when the device has accepted none of the outgoing bytes; `None` if no bytes wait.
    stuck_since: Option<Instant>,
    /// Text of the last failure that was logged, so that it is logged once, however long it lasts.
    reported: Option<String>,
    /// Whether the next opening of the port is not logged.
    silently: bool,
    /// Whether the port has sent bytes but no valid frame, as the port of another device would.
    /// Interruptions of such a port are not logged.
    is_stranger: bool,
}

#[derive(Debug)]
enum State {
    Closed { retry_at: Instant },
    Opening(JoinHandle<(PortOpener, Result<Port, OpenError>)>),
    Open(Port),
}

/// A change of the connection to a device, or bytes from the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The device is connected.
    Opened,
    /// Number of bytes read into the front of the buffer.
    Bytes(usize),
    /// The device is no longer connected.
    Closed,
}

impl Connection {
    pub(crate) fn new(address: PortAddress, baud: u32) -> Connection {
        Connection {
            opener: PortOpener::new(address, baud),
            state: State::Closed { retry_at: Instant::now() },
            stuck_since: None,
            reported: None,
            silently: false,
            is_stranger: false,
        }
    }

    /// Closes the port. The next attempt to open it follows after [`Core::REOPEN_AFTER`].
    pub(crate) fn close(&mut self) {
        self.state = State::Closed { retry_at: Instant::now() + Core::REOPEN_AFTER };
    }

    fn report_failure(&mut self, error: &io::Error) {
        self.close();
        let why = error.to_string();
        if self.reported.as_ref() == Some(&why) {
            return;
        }
        self.reported = Some(why);
        tracing::warn!(
            "{} does not open ({error}); waiting for it; {}",
            self.opener,
            self.opener.address().remedy(error.kind())
        );
    }
}

impl Feed for Connection {
    fn is_open(&self) -> bool {
        matches!(self.state, State::Open(_))
    }

    /// Returns the address of the port; for `auto`, the port and the board that were found last.
    fn name(&self) -> String {
        self.opener.to_string()
    }

    /// Returns the time without a frame from the device after which the port should be reopened.
    fn silence_limit(&self) -> Duration {
        match self.opener.address() {
            PortAddress::Tty(_) | PortAddress::Auto(_) => Core::TTY_SILENCE_LIMIT,
            PortAddress::Tcp(_) => Core::TCP_SILENCE_LIMIT,
        }
    }

    /// Closes the port, and does not log when it is opened again.
    fn close_silently(&mut self) {
        self.silently = true;
        self.close();
    }

    /// Waits for the next event. Meanwhile writes `outgoing` to the device and removes what was
    /// written. Reads bytes from the device even if the device accepts none. Cancel safe.
    ///
    /// # Errors
    ///
    /// [`BridgeError::Port`] if the address names something that is not a port,
    /// [`BridgeError::Speed`] if the port does not support the baud rate, and
    /// [`BridgeError::SeveralBoards`] if `auto` finds several boards.
    async fn next_event(
        &mut self,
        buffer: &mut [u8],
        outgoing: &mut Vec<u8>,
    ) -> Result<Event, BridgeError> {
        loop {
            match &mut self.state {
                State::Closed { retry_at } => {
                    sleep_until(*retry_at).await;
                    let mut opener = self.opener.clone();
                    let opening = tokio::spawn(async move {
                        let opened = opener.open().await;
                        (opener, opened)
                    });
                    self.state = State::Opening(opening);
                }
                State::Opening(opening) => {
                    // Waiting fails only if the task panicked or the runtime is shutting down.
                    let opened = match opening.await {
                        Ok((opener, opened)) => {
                            self.opener = opener;
                            opened
                        }
                        Err(error) => Err(io::Error::other(error).into()),
                    };
                    match opened {
                        Ok(port) => {
                            if std::mem::take(&mut self.silently) {
                                tracing::debug!("{} is open again", self.opener);
                            } else {
                                tracing::info!("{} is open", self.opener);
                            }
                            self.reported = None;
                            self.stuck_since = None;
                            self.state = State::Open(port);
                            return Ok(Event::Opened);
                        }
                        Err(error) => {
                            let error = error.passing(self.opener.to_string())?;
                            self.report_failure(&error);
                        }
                    }
                }
                State::Open(port) => {
                    let stuck_for = self.stuck_since.map(|since| since.elapsed());
                    if outgoing.is_empty() {
                        self.stuck_since = None;
                    } else if self.stuck_since.is_none() {
                        self.stuck_since = Some(Instant::now());
                    }
                    let exchanged = if stuck_for.is_some_and(|time| time > PORT_TIMEOUT) {
                        Err(io::Error::new(io::ErrorKind::TimedOut, "it accepts no commands"))
                    } else {
                        port.exchange(buffer, outgoing).await
                    };
                    match exchanged {
                        Ok(Transfer::Read(count)) => return Ok(Event::Bytes(count)),
                        // The device may have closed its end. The bytes that it sent before can
                        // still be read; after them, reading reports the end.
                        Ok(Transfer::NotWritten(error)) => {
                            tracing::debug!(%error, "commands cannot be written");
                            outgoing.clear();
                            self.stuck_since = None;
                        }
                        Ok(Transfer::Written(count)) => {
                            outgoing.drain(..count);
                            self.stuck_since = None;
                        }
                        Err(error) => {
                            if self.is_stranger {
                                tracing::debug!("{} was lost ({error})", self.opener);
                                self.close_silently();
                            } else {
                                tracing::warn!(
                                    "{} was lost ({error}); waiting for it",
                                    self.opener
                                );
                                self.close();
                            }
                            return Ok(Event::Closed);
                        }
                    }
                }
            }
        }
    }

    fn mark_stranger(&mut self, is_stranger: bool) {
        self.is_stranger = is_stranger;
    }

    fn is_stranger(&self) -> bool {
        self.is_stranger
    }
}
/// Connection to a device, as used by the loop that publishes the device's streams.
pub trait Feed {
    /// Waits for the next event; the bytes of an [`Event::Bytes`] are at the front of `buffer`.
    /// Meanwhile passes `outgoing` to the device and removes what was accepted. Cancel safe.
    ///
    /// # Errors
    ///
    /// [`BridgeError`] if the device can never connect, such as for an address that is not a port.
    fn next_event(
        &mut self,
        buffer: &mut [u8],
        outgoing: &mut Vec<u8>,
    ) -> impl Future<Output = Result<Event, BridgeError>>;

    /// Returns whether the device is connected.
    fn is_open(&self) -> bool;

    /// Returns a name of the device for the log, such as the address of its port.
    fn name(&self) -> String;

    /// Returns the host time at which the bytes of the last event came from the device. The
    /// device's clock is fitted to these times.
    fn read_time(&self) -> HostTime {
        HostTime::now()
    }

    /// Returns the time without a frame from the device after which [`Feed::close_silently`] is
    /// called.
    fn silence_limit(&self) -> Duration {
        Duration::MAX
    }

    /// Disconnects from a silent device, without logging it. The next call of [`Feed::next_event`]
    /// connects again.
    fn close_silently(&mut self) {}

    /// Sets whether the device has so far sent only bytes that form no valid frame.
    fn mark_stranger(&mut self, _is_stranger: bool) {}

    /// Returns the value that [`Feed::mark_stranger`] has set last.
    fn is_stranger(&self) -> bool {
        false
    }

    /// Returns a status for `/diagnostics` with what this program has measured; `None` if the
    /// device measures and reports everything itself. Called once a second.
    fn status(&mut self) -> Option<DiagnosticStatus> {
        None
    }
}
