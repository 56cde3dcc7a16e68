//! Opens the port at an address, and opens it again if it was lost.

use std::{fmt, io};

use thiserror::Error;

use crate::ports::finder::{BoardFinder, FindError, FoundBoard};
use crate::ports::system_root::SystemRoot;
use crate::wire::port::{Port, PortAddress};

/// Opens the port at an address. `auto` stands for a board: each opening finds the port that the
/// board has at that time, but the board stays the same.
#[derive(Clone, Debug)]
pub(crate) struct PortOpener {
    address: PortAddress,
    baud: u32,
    /// Searches for the board if the address is `auto`; otherwise `None`.
    finder: Option<BoardFinder>,
    /// Board found at the port that was opened last; `None` unless the address is `auto`.
    found: Option<FoundBoard>,
}

/// Why [`PortOpener::open`] fails.
#[derive(Debug, Error)]
pub(crate) enum OpenError {
    /// The operating system's error; `NotFound` if `auto` finds no board.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Several boards are connected, and the address `auto` has no serial number that chooses one.
    #[error("several Corticode boards are connected: {boards}")]
    Ambiguous {
        /// Serial numbers and ports of the boards.
        boards: String,
    },
}

impl PortOpener {
    /// Creates the opener of a port, without opening it.
    pub(crate) fn new(address: PortAddress, baud: u32) -> PortOpener {
        PortOpener::below(SystemRoot::machine(), address, baud)
    }

    /// As [`PortOpener::new`], but searches for boards below the folder `root`.
    pub(crate) fn below(root: SystemRoot, address: PortAddress, baud: u32) -> PortOpener {
        let finder = match &address {
            PortAddress::Auto(serial) => Some(BoardFinder::new(root, serial.clone())),
            PortAddress::Tty(_) | PortAddress::Tcp(_) => None,
        };
        PortOpener {
            address,
            baud,
            finder,
            found: None,
        }
    }

    pub(crate) fn address(&self) -> &PortAddress {
        &self.address
    }

    /// Opens the port; for `auto`, searches for the board first.
    ///
    /// # Errors
    ///
    /// Those of [`Port::open`]; `NotFound` if the board is absent, and [`OpenError::Ambiguous`] if
    /// there are several.
    pub(crate) async fn open(&mut self) -> Result<Port, OpenError> {
        let Some(finder) = &mut self.finder else {
            return Ok(Port::open(&self.address, self.baud).await?);
        };
        self.found = None;
        let found = finder.find().map_err(|error| match error {
            FindError::SeveralBoards { boards } => OpenError::Ambiguous {
                boards: boards.join(", "),
            },
            absent => OpenError::Io(io::Error::new(io::ErrorKind::NotFound, absent)),
        })?;
        let address = PortAddress::Tty(found.path.clone());
        self.found = Some(found);
        Ok(Port::open(&address, self.baud).await?)
    }
}

/// Writes the address; for `auto`, the port and the board that were found last.
impl fmt::Display for PortOpener {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(FoundBoard { path, serial }) = &self.found else {
            return write!(formatter, "{}", self.address);
        };
        let serial = serial.as_deref().unwrap_or("without serial number");
        write!(formatter, "{} (board {serial})", path.display())
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;
    use std::path::PathBuf;

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::{OpenError, PortOpener, SystemRoot};
    use crate::error::BridgeError;
    use crate::ports::simulated_machine::{BOARD, OTHER, SimulatedMachine};
    use crate::wire::connection::{Connection, Event, Feed};
    use crate::wire::port::PortAddress;

    /// Returns the device's end of a new pseudoterminal, and the path of the host's end.
    fn pseudoterminal() -> (File, PathBuf) {
        let device = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&device).unwrap();
        unlockpt(&device).unwrap();
        let name = ptsname(&device, Vec::new()).unwrap();
        (device.into(), name.to_str().unwrap().into())
    }

    fn auto(machine: &SimulatedMachine) -> PortOpener {
        let root = SystemRoot::new(machine.folder());
        PortOpener::below(root, PortAddress::Auto(None), 921_600)
    }

    #[tokio::test]
    async fn a_connection_follows_its_board_to_another_port() {
        let machine = SimulatedMachine::new();
        let mut connection = Connection::with(auto(&machine));
        let (mut buffer, mut outgoing) = ([0; 16], Vec::new());
        let waits = std::time::Duration::from_millis(600);
        // While no board is plugged in, the connection waits.
        let event = connection.next_event(&mut buffer, &mut outgoing);
        assert!(tokio::time::timeout(waits, event).await.is_err());
        let (mut device, path) = pseudoterminal();
        machine.plug(2, "ttyACM0", BOARD, Some(&path));
        let opened = connection.next_event(&mut buffer, &mut outgoing).await;
        assert_eq!(opened.unwrap(), Event::Opened);
        device.write_all(b"first").unwrap();
        let read = connection.next_event(&mut buffer, &mut outgoing).await;
        let expected = (Event::Bytes(5), &b"first"[..]);
        assert_eq!((read.unwrap(), &buffer[..5]), expected);
        // The board is unplugged, and another board gets the name of its port.
        machine.unplug(2, "ttyACM0");
        drop(device);
        let (_other, other_path) = pseudoterminal();
        machine.plug(3, "ttyACM0", OTHER, Some(&other_path));
        let closed = connection.next_event(&mut buffer, &mut outgoing).await;
        assert_eq!(closed.unwrap(), Event::Closed);
        let event = connection.next_event(&mut buffer, &mut outgoing);
        assert!(tokio::time::timeout(waits, event).await.is_err());
        let (mut device, path) = pseudoterminal();
        machine.plug(2, "ttyACM1", BOARD, Some(&path));
        let opened = connection.next_event(&mut buffer, &mut outgoing).await;
        assert_eq!(opened.unwrap(), Event::Opened);
        device.write_all(b"again").unwrap();
        let read = connection.next_event(&mut buffer, &mut outgoing).await;
        let expected = (Event::Bytes(5), &b"again"[..]);
        assert_eq!((read.unwrap(), &buffer[..5]), expected);
    }

    #[tokio::test]
    async fn two_boards_end_a_connection_with_status_2_and_their_serial_numbers() {
        let machine = SimulatedMachine::new();
        machine.plug(2, "ttyACM0", BOARD, None);
        machine.plug(3, "ttyACM1", OTHER, None);
        let error = auto(&machine).open().await.unwrap_err();
        assert!(matches!(error, OpenError::Ambiguous { .. }), "{error}");
        let mut connection = Connection::with(auto(&machine));
        let event = connection.next_event(&mut [0; 16], &mut Vec::new()).await;
        let error: BridgeError = event.unwrap_err();
        let text = error.to_string();
        assert_eq!(error.exit_code(), 2);
        for part in [BOARD.serial, "3B (", "ttyACM1", "--port auto:SERIAL"] {
            assert!(text.contains(part), "{text}");
        }
    }

    #[tokio::test]
    async fn the_port_that_was_found_is_named_with_its_board() {
        let machine = SimulatedMachine::new();
        let mut opener = auto(&machine);
        assert_eq!(opener.to_string(), "auto");
        let (_device, path) = pseudoterminal();
        machine.plug(2, "ttyACM0", BOARD, Some(&path));
        opener.open().await.unwrap();
        let expected = format!("/dev/ttyACM0 (board {})", BOARD.serial);
        assert!(opener.to_string().ends_with(&expected), "{opener}");
    }
}
