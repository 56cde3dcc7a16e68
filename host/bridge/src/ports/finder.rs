//! Finds the port of a board for `--port auto`.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;

use crate::ports::system_root::{Likeness, SerialPort, SystemRoot};

/// Searches the ports for one board. After the first success, finds only the board with the same
/// serial number.
#[derive(Clone, Debug)]
pub(crate) struct BoardFinder {
    root: SystemRoot,
    serial: Option<String>,
}

/// The port at which a board was found, and the board's serial number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FoundBoard {
    pub(crate) path: PathBuf,
    pub(crate) serial: Option<String>,
}

/// Why [`BoardFinder::find`] cannot choose a port.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(crate) enum FindError {
    /// No port belongs to a board on USB.
    #[error("no Corticode board is on USB{}", MaybeBoards(.maybe))]
    NoBoard {
        /// Ports of ST-LINKs, which may lead to a board.
        maybe: Vec<PathBuf>,
    },
    /// udev is still setting the names and permissions of a board's port.
    #[error("the board at {} was plugged in just now", .port.display())]
    Settling { port: PathBuf },
    /// The board with the wanted serial number is absent, but other boards are present.
    #[error("no board {serial} is on USB; present: {}", listed(.present))]
    OtherBoards {
        serial: String,
        /// Serial numbers and ports of the boards that are present.
        present: Vec<String>,
    },
    /// There are several boards, and no serial number chooses one.
    #[error("several boards are on USB: {}", listed(.boards))]
    SeveralBoards {
        /// Serial numbers and ports of the boards.
        boards: Vec<String>,
    },
}

/// Prints, as the end of a sentence, the ports that may lead to boards.
struct MaybeBoards<'a>(&'a [PathBuf]);

impl fmt::Display for MaybeBoards<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.first() {
            Some(path) => {
                let path = path.display();
                write!(
                    formatter,
                    "; {path} is an ST-LINK: if a board's UART is wired to it, use --port {path}"
                )
            }
            None => Ok(()),
        }
    }
}

fn listed(boards: &[String]) -> String {
    if boards.is_empty() { "none".to_owned() } else { boards.join(", ") }
}

impl BoardFinder {
    /// Creates a finder for the board with the serial number `serial`; `None` for the only board.
    pub(crate) fn new(root: SystemRoot, serial: Option<String>) -> BoardFinder {
        BoardFinder { root, serial }
    }

    /// Returns the port at which the board is now.
    ///
    /// # Errors
    ///
    /// [`FindError`] if the board is absent, or if several are present and none was chosen.
    pub(crate) fn find(&mut self) -> Result<FoundBoard, FindError> {
        let ports = self.root.serial_ports();
        let found = choose(&ports, self.serial.as_deref())?;
        if self.serial.is_none() {
            self.serial.clone_from(&found.serial);
        }
        Ok(found)
    }
}

/// Returns the port of the board with the serial number `wanted`, or of the only board if `wanted`
/// is `None`. An ST-LINK is chosen only by its serial number. A port that udev has not finished
/// setting up does not count, because its permissions are not set yet.
fn choose(ports: &[SerialPort], wanted: Option<&str>) -> Result<FoundBoard, FindError> {
    let settled = || ports.iter().filter(|port| port.is_settled);
    let with = |likeness| settled().filter(move |port| port.likeness() == likeness);
    let found = |port: &SerialPort| FoundBoard {
        path: port.path.clone(),
        serial: port.serial().map(str::to_owned),
    };
    let boards: Vec<&SerialPort> = with(Likeness::Board).collect();
    if let Some(wanted) = wanted {
        let mut candidates = boards.iter().copied().chain(with(Likeness::Maybe));
        // Ignore case, which differs between the firmware's messages and the USB descriptor.
        let port = candidates
            .find(|port| port.serial().is_some_and(|serial| serial.eq_ignore_ascii_case(wanted)));
        return port.map(found).ok_or_else(|| FindError::OtherBoards {
            serial: wanted.to_owned(),
            present: boards.iter().map(|port| name(port)).collect(),
        });
    }
    // A board whose port udev has not finished setting up counts as present: another board is then
    // not the only one.
    let mut unsettled = ports.iter().filter(|port| !port.is_settled);
    if let Some(port) = unsettled.find(|port| port.likeness() == Likeness::Board) {
        let port = port.path.clone();
        return Err(FindError::Settling { port });
    }
    match boards[..] {
        [] => Err(FindError::NoBoard {
            maybe: with(Likeness::Maybe).map(|port| port.path.clone()).collect(),
        }),
        [board] => Ok(found(board)),
        _ => {
            Err(FindError::SeveralBoards { boards: boards.iter().map(|port| name(port)).collect() })
        }
    }
}

fn name(port: &SerialPort) -> String {
    let serial = port.serial().unwrap_or("without serial number");
    format!("{serial} ({})", port.path.display())
}

#[cfg(test)]
mod tests {
    use super::{BoardFinder, FindError};
    use crate::ports::simulated_machine::{BOARD, Descriptor, OTHER, SimulatedMachine};
    use crate::ports::system_root::SystemRoot;

    const ST_LINK: Descriptor<'static> = Descriptor {
        vendor: "0483",
        product_id: "374b",
        manufacturer: "STMicroelectronics",
        product: "STM32 STLink",
        serial: "066D",
    };

    fn finder(machine: &SimulatedMachine, serial: Option<&str>) -> BoardFinder {
        BoardFinder::new(SystemRoot::new(machine.folder()), serial.map(str::to_owned))
    }

    #[test]
    fn the_first_board_is_found_again_at_another_port_and_no_other_board_replaces_it() {
        let machine = SimulatedMachine::new();
        let mut finder = finder(&machine, None);
        assert_eq!(finder.find(), Err(FindError::NoBoard { maybe: Vec::new() }));
        machine.plug(2, "ttyACM0", BOARD, None);
        assert_eq!(finder.find().unwrap().path, machine.path("dev/ttyACM0"));
        machine.unplug(2, "ttyACM0");
        machine.plug(3, "ttyACM0", OTHER, None);
        let error = finder.find().unwrap_err().to_string();
        assert!(error.contains(BOARD.serial) && error.contains("3B ("), "{error}");
        machine.plug(2, "ttyACM1", BOARD, None);
        assert_eq!(finder.find().unwrap().path, machine.path("dev/ttyACM1"));
    }

    #[test]
    fn a_board_counts_once_udev_has_set_the_permissions_of_its_port() {
        let machine = SimulatedMachine::new();
        machine.write("run/udev/control", "");
        machine.plug(2, "ttyACM0", BOARD, None);
        let mut finder = finder(&machine, None);
        let settling = |tty: &str| {
            let port = machine.path(tty);
            Err(FindError::Settling { port })
        };
        assert_eq!(finder.find(), settling("dev/ttyACM0"));
        machine.write("run/udev/data/c166:0", "E:ID_PROCESSING=1\n");
        assert_eq!(finder.find(), settling("dev/ttyACM0"));
        machine.write("run/udev/data/c166:0", "");
        // While udev still sets up the port of a second board, not even the first board is chosen.
        machine.plug(3, "ttyACM1", OTHER, None);
        assert_eq!(finder.find(), settling("dev/ttyACM1"));
        machine.unplug(3, "ttyACM1");
        assert_eq!(finder.find().unwrap().path, machine.path("dev/ttyACM0"));
    }

    #[test]
    fn several_boards_are_listed_and_a_serial_number_chooses_one() {
        let machine = SimulatedMachine::new();
        machine.plug(2, "ttyACM0", BOARD, None);
        machine.plug(3, "ttyACM1", OTHER, None);
        let Err(FindError::SeveralBoards { boards }) = finder(&machine, None).find() else {
            panic!("one of two boards was chosen");
        };
        let port = |tty: &str| machine.path(tty).display().to_string();
        let expected = [
            format!("{} ({})", BOARD.serial, port("dev/ttyACM0")),
            format!("3B ({})", port("dev/ttyACM1")),
        ];
        assert_eq!(boards, expected);
        let found = finder(&machine, Some("3b")).find().unwrap();
        assert_eq!(found.path, machine.path("dev/ttyACM1"));
    }

    #[test]
    fn an_st_link_is_chosen_by_its_serial_number_only() {
        let machine = SimulatedMachine::new();
        machine.plug(2, "ttyACM0", ST_LINK, None);
        let error = finder(&machine, None).find().unwrap_err().to_string();
        assert!(error.contains("ttyACM0 is an ST-LINK"), "{error}");
        let found = finder(&machine, Some("066D")).find().unwrap();
        assert_eq!(found.path, machine.path("dev/ttyACM0"));
    }
}
