//! A port that comes and goes.

use std::io;
use std::time::Duration;

use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};

use crate::port::Port;
use crate::{BridgeError, PortAddress};

/// How long after a failure the port is tried again; well below the second within which a
/// replugged device is to be back.
const RETRY: Duration = Duration::from_millis(250);

/// A port that comes and goes: opened again until it opens, as often as it goes.
#[derive(Debug)]
pub(crate) struct Connection {
    address: PortAddress,
    baud: u32,
    state: State,
    /// The last failure that was told of, so that a device that is away fills no log.
    told: Option<io::ErrorKind>,
}

#[derive(Debug)]
enum State {
    Closed { retry_at: Instant },
    Opening(JoinHandle<io::Result<Port>>),
    Open(Port),
}

/// What happened to the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    Opened,
    /// So many bytes are at the front of the buffer.
    Bytes(usize),
    Closed,
}

impl Connection {
    pub(crate) fn new(address: PortAddress, baud: u32) -> Connection {
        Connection {
            address,
            baud,
            state: State::Closed {
                retry_at: Instant::now(),
            },
            told: None,
        }
    }

    pub(crate) fn is_open(&self) -> bool {
        matches!(self.state, State::Open(_))
    }

    pub(crate) fn close(&mut self) {
        self.state = State::Closed {
            retry_at: Instant::now() + RETRY,
        };
    }

    /// What happens next; waits for it. Safe to cancel.
    ///
    /// # Errors
    ///
    /// [`BridgeError::Port`] if what the address names can never be a port.
    pub(crate) async fn next(&mut self, buffer: &mut [u8]) -> Result<Event, BridgeError> {
        loop {
            match &mut self.state {
                State::Closed { retry_at } => {
                    sleep_until(*retry_at).await;
                    let (address, baud) = (self.address.clone(), self.baud);
                    let opening = tokio::spawn(async move { Port::open(&address, baud).await });
                    self.state = State::Opening(opening);
                }
                State::Opening(opening) => {
                    // A task fails only if it panics or the program ends.
                    let opened = opening
                        .await
                        .unwrap_or_else(|error| Err(io::Error::other(error)));
                    match opened {
                        Ok(port) => {
                            tracing::info!("{} is open", self.address);
                            self.told = None;
                            self.state = State::Open(port);
                            return Ok(Event::Opened);
                        }
                        Err(source) if source.kind() == io::ErrorKind::InvalidInput => {
                            let port = self.address.to_string();
                            return Err(BridgeError::Port { port, source });
                        }
                        Err(error) => self.failed(&error),
                    }
                }
                State::Open(port) => match port.read(buffer).await {
                    Ok(count) => return Ok(Event::Bytes(count)),
                    Err(error) => {
                        tracing::warn!("{} has gone ({error}); waiting for it", self.address);
                        self.close();
                        return Ok(Event::Closed);
                    }
                },
            }
        }
    }

    /// Write to the open port.
    ///
    /// # Errors
    ///
    /// What the system says; `NotConnected` if it is not open.
    pub(crate) async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match &mut self.state {
            State::Open(port) => port.write(bytes).await,
            _ => Err(io::ErrorKind::NotConnected.into()),
        }
    }

    fn failed(&mut self, error: &io::Error) {
        self.close();
        if self.told == Some(error.kind()) {
            return;
        }
        self.told = Some(error.kind());
        let remedy = match (error.kind(), &self.address) {
            (io::ErrorKind::NotFound, _) => "plug the device in, or start host-sim".to_owned(),
            (io::ErrorKind::PermissionDenied, _) => {
                "you may not use it: sudo usermod -aG dialout $USER, then log in again".to_owned()
            }
            (io::ErrorKind::ResourceBusy, PortAddress::Tty(path)) => {
                format!("another program has it: fuser -v {}", path.display())
            }
            _ => "check --port".to_owned(),
        };
        tracing::warn!(
            "{} does not open ({error}); waiting for it; {remedy}",
            self.address
        );
    }
}
