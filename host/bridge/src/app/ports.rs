//! The subcommand `ports`: lists the serial ports of this machine.

use std::fmt;

use bridge_core::write_columns;
use serde::Serialize;

use crate::ports::system_root::{Likeness, SerialPort, SystemRoot};

/// The serial ports of a machine; prints as a table.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub(super) struct PortList {
    ports: Vec<ListedPort>,
}

/// A serial port, and what keeps this user from opening it.
#[derive(Debug, Serialize)]
struct ListedPort {
    #[serde(flatten)]
    port: SerialPort,
    board: Likeness,
    /// Why this user cannot open the port; `None` if nothing is known to prevent it.
    problem: Option<String>,
    /// Command that removes the problem.
    remedy: Option<String>,
}

impl PortList {
    /// Lists the serial ports of the machine whose files are below `root`. Opens none of them.
    pub(super) fn read(root: &SystemRoot) -> PortList {
        let list = |port: SerialPort| {
            let objection = root.port_access(&port.path).objection(&port.path);
            let (problem, remedy) = objection.unzip();
            ListedPort { board: port.likeness(), port, problem, remedy }
        };
        PortList { ports: root.serial_ports().into_iter().map(list).collect() }
    }
}

impl fmt::Display for PortList {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.ports.is_empty() {
            return write!(
                formatter,
                "no serial ports; plug a board in, and see `sudo dmesg --follow` if none appears"
            );
        }
        let header = ["port", "board", "USB", "device", "serial number", "driver", "link"];
        let rows = self.ports.iter().map(row);
        write_columns(formatter, header, [false; 7], rows)?;
        let boards = self.ports.iter().filter(|port| port.board == Likeness::Board);
        let count = boards.count();
        write!(formatter, "\n{count} Corticode board{} on USB", if count == 1 { "" } else { "s" })?;
        for listed in &self.ports {
            if let (Some(problem), Some(remedy)) = (&listed.problem, &listed.remedy) {
                let path = listed.port.path.display();
                write!(formatter, "\n{path}: {problem}; {remedy}")?;
            }
        }
        Ok(())
    }
}

fn row(listed: &ListedPort) -> [String; 7] {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let port = &listed.port;
    let usb = port.usb.as_ref();
    let names = usb.map(|usb| {
        let names = [&usb.manufacturer, &usb.product].into_iter().flatten();
        names.map(String::as_str).collect::<Vec<_>>().join(" ")
    });
    let board = match listed.board {
        Likeness::Board => "yes",
        Likeness::Maybe => "may be",
        Likeness::Other => "no",
    };
    [
        port.path.display().to_string(),
        board.to_owned(),
        or_dash(usb.map(|usb| usb.id.clone())),
        or_dash(names),
        or_dash(port.serial().map(str::to_owned)),
        or_dash(port.driver.clone()),
        or_dash(port.link.as_ref().map(|link| link.display().to_string())),
    ]
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use serde_json::Value;

    use super::PortList;
    use crate::ports::simulated_machine::{BOARD, SimulatedMachine};
    use crate::ports::system_root::SystemRoot;

    #[test]
    fn the_table_and_json_name_the_board_and_the_program_that_has_its_port_open() {
        let machine = SimulatedMachine::new();
        let root = SystemRoot::new(machine.folder());
        assert!(PortList::read(&root).to_string().contains("plug a board in"));
        machine.plug(2, "ttyACM0", BOARD, None);
        machine.add_uart("ttyS0", 4);
        machine.write("proc/41/comm", "ModemManager\n");
        fs::create_dir_all(machine.path("proc/41/fd")).unwrap();
        let port = fs::canonicalize(machine.path("dev/ttyACM0")).unwrap();
        symlink(&port, machine.path("proc/41/fd/9")).unwrap();
        let list = PortList::read(&root);
        let folder = format!("{}/", machine.folder().display());
        let text = list.to_string().replace(&folder, "/");
        let lines: Vec<Vec<&str>> =
            text.lines().map(|line| line.split_whitespace().collect()).collect();
        let link = format!("/dev/corticode-{}", BOARD.serial);
        let expected = [
            "/dev/ttyACM0",
            "yes",
            "1209:0001",
            "Corticode",
            "Corticode",
            BOARD.serial,
            "cdc_acm",
            &link,
        ];
        assert_eq!(lines[1], expected, "{text}");
        assert_eq!(lines[2], ["/dev/ttyS0", "no", "-", "-", "-", "serial", "-"]);
        assert!(
            text.ends_with(
                "1 Corticode board on USB\n/dev/ttyACM0: in use by ModemManager (pid 41); \
                 sudo systemctl stop ModemManager"
            ),
            "{text}"
        );
        let json: Value = serde_json::to_value(&list).unwrap();
        assert_eq!(json[0]["board"], "board");
        assert_eq!(json[0]["usb"]["serial"], BOARD.serial);
        assert_eq!(json[0]["problem"], "in use by ModemManager (pid 41)");
        assert_eq!(json[1]["usb"], Value::Null);
        assert_eq!(json[1]["problem"], Value::Null);
    }
}
