//! Opens the port at an address, and opens it again if it was lost.

use std::{fmt, io};

use thiserror::Error;

use crate::error::BridgeError;
use crate::ports::finder::{BoardFinder, FindError, FoundBoard};
use crate::ports::system_root::SystemRoot;
use crate::wire::port::{Port, PortAddress};

/// Opens the port at an address. `auto` stands for a board: each opening finds the port that the
/// board has at that time, but the board stays the same.
#[derive(Clone, Debug)]
pub(crate) struct PortOpener {
    address: PortAddress,
    baud: u32,
    /// Finder of the board; `None` unless the address is `auto`.
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

impl OpenError {
    /// Returns the reason why the port cannot be opened at present, so that a retry makes sense.
    ///
    /// # Errors
    ///
    /// [`BridgeError`] if a retry is useless: `port` can never be opened, or several boards match
    /// it.
    pub(crate) fn passing(self, port: String) -> Result<io::Error, BridgeError> {
        match self {
            OpenError::Ambiguous { boards } => Err(BridgeError::SeveralBoards(boards)),
            OpenError::Io(source) => match source.kind() {
                io::ErrorKind::InvalidInput => Err(BridgeError::Port(port, source)),
                io::ErrorKind::Unsupported => Err(BridgeError::Speed(port, source)),
                _ => Ok(source),
            },
        }
    }
}

impl PortOpener {
    /// Creates the opener of a port, without opening it.
    pub(crate) fn new(address: PortAddress, baud: u32) -> PortOpener {
        let finder = match &address {
            PortAddress::Auto(serial) => {
                Some(BoardFinder::new(SystemRoot::machine(), serial.clone()))
            }
            PortAddress::Tty(_) | PortAddress::Tcp(_) => None,
        };
        PortOpener { address, baud, finder, found: None }
    }

    pub(crate) fn address(&self) -> &PortAddress {
        &self.address
    }

    /// Opens the port; for `auto`, searches for the board first.
    ///
    /// # Errors
    ///
    /// The errors of [`Port::open`]; `NotFound` if the board is absent, and
    /// [`OpenError::Ambiguous`] if there are several.
    pub(crate) async fn open(&mut self) -> Result<Port, OpenError> {
        let Some(finder) = &mut self.finder else {
            return Ok(Port::open(&self.address, self.baud).await?);
        };
        self.found = None;
        let found = finder.find().map_err(|error| match error {
            FindError::SeveralBoards { boards } => {
                OpenError::Ambiguous { boards: boards.join(", ") }
            }
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
