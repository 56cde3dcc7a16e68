//! Serial ports of this machine, read from `/sys`, `/dev` and udev's files.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

/// Folder that stands for `/`. Tests use another folder than this machine's root.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SystemRoot(PathBuf);

impl SystemRoot {
    /// Returns the root folder of this machine.
    pub(crate) fn machine() -> SystemRoot {
        SystemRoot("/".into())
    }

    #[cfg(test)]
    pub(crate) fn new(folder: &Path) -> SystemRoot {
        SystemRoot(folder.to_owned())
    }

    pub(crate) fn path(&self, relative: impl AsRef<Path>) -> PathBuf {
        self.0.join(relative)
    }

    /// Returns the text of a file without the white space at its end; `None` if it cannot be read.
    pub(crate) fn text(&self, relative: impl AsRef<Path>) -> Option<String> {
        text(&self.path(relative))
    }

    /// Returns the serial ports with hardware behind them, sorted by name. The list is empty on a
    /// system without sysfs.
    pub(crate) fn serial_ports(&self) -> Vec<SerialPort> {
        let terminals = entries(&self.path("sys/class/tty"));
        let mut ports: Vec<SerialPort> =
            terminals.into_iter().filter_map(|class| self.serial_port(&class)).collect();
        ports.sort_by(|a, b| a.path.cmp(&b.path));
        ports
    }

    /// Returns the serial port of an entry of `sys/class/tty`. Returns `None` for consoles and
    /// pseudoterminals, whose entries have no link `device`, and for the entries `ttyS*` that the
    /// driver of 8250 UARTs creates where the machine has no such UART.
    fn serial_port(&self, class: &Path) -> Option<SerialPort> {
        const PORT_UNKNOWN: &str = "0"; // linux/serial_core.h
        let folder = fs::canonicalize(class).ok()?;
        let device = fs::canonicalize(folder.join("device")).ok()?;
        if text(&folder.join("type")).as_deref() == Some(PORT_UNKNOWN) {
            return None;
        }
        let path = self.path("dev").join(class.file_name()?);
        let usb_device = device.ancestors().find(|folder| {
            folder.starts_with(&self.0)
                && folder.join("idVendor").is_file()
                && folder.join("idProduct").is_file()
        });
        Some(SerialPort {
            is_settled: self.is_settled(&folder),
            link: self.stable_link(&path),
            driver: device.ancestors().find_map(driver),
            usb: usb_device.and_then(usb_identity),
            path,
        })
    }

    /// Returns whether udev has finished setting up the device with the sysfs folder `folder`. At
    /// the end, udev writes a file named after the device's kind and numbers, such as `c166:0`.
    fn is_settled(&self, folder: &Path) -> bool {
        let numbers = text(&folder.join("dev")).unwrap_or_default();
        // The running udev has this socket; a container without udev can still have udev's folders.
        let has_udev = self.path("run/udev/control").exists();
        let record = text(&self.path(format!("run/udev/data/c{numbers}")));
        !has_udev || record.is_some_and(|record| !record.contains("E:ID_PROCESSING=1"))
    }

    /// Returns the link to `port` whose name is the same in whatever order devices are plugged in.
    fn stable_link(&self, port: &Path) -> Option<PathBuf> {
        let own = entries(&self.path("dev"));
        let own = own.into_iter().filter(|path| {
            let name = path.file_name().and_then(OsStr::to_str);
            name.is_some_and(|name| name.starts_with(OWN_NAME))
        });
        let target = fs::canonicalize(port).ok()?;
        let mut links = own.chain(entries(&self.path("dev/serial/by-id")));
        links.find(|link| fs::canonicalize(link).is_ok_and(|path| path == target))
    }
}

/// Returns the paths in a folder, sorted; none if the folder cannot be read.
pub(crate) fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

fn text(path: &Path) -> Option<String> {
    let bytes = fs::read(path).ok()?;
    Some(String::from_utf8_lossy(&bytes).trim_end().to_owned())
}

/// Returns the name of a device's driver; `None` for `serial-base`, which newer kernels put between
/// a UART and its real driver.
fn driver(device: &Path) -> Option<String> {
    let driver = fs::canonicalize(device.join("driver")).ok()?;
    let mut parts = driver.components();
    if parts.any(|part| part.as_os_str() == "serial-base") {
        return None;
    }
    Some(driver.file_name()?.to_string_lossy().into_owned())
}

fn usb_identity(device: &Path) -> Option<UsbIdentity> {
    let attribute = |name: &str| text(&device.join(name)).filter(|text| !text.is_empty());
    let id = format!("{}:{}", attribute("idVendor")?, attribute("idProduct")?);
    Some(UsbIdentity {
        id,
        manufacturer: attribute("manufacturer"),
        product: attribute("product"),
        serial: attribute("serial"),
    })
}

/// USB ids and product name of a board (`firmware/board-stm32/src/port/usb.rs`). Anybody may use
/// these ids for tests, so the name must match too.
const BOARD: (&str, &str) = ("1209:0001", "Corticode");
/// USB vendor id of STMicroelectronics, whose ST-LINK connects a board's UART.
const ST_VENDOR: &str = "0483:";

/// Start of the names in `/dev` that the project's udev rule assigns
/// (`packaging/60-corticode.rules`).
pub(crate) const OWN_NAME: &str = "corticode-";

/// A serial port with hardware behind it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct SerialPort {
    /// Path of the port, such as `/dev/ttyACM0`.
    pub(crate) path: PathBuf,
    /// Link to the port whose name stays the same in whatever order devices are plugged in:
    /// `/dev/corticode-SERIAL`, or else a link in `/dev/serial/by-id`.
    pub(crate) link: Option<PathBuf>,
    /// Driver of the port in the kernel, such as `cdc_acm`.
    pub(crate) driver: Option<String>,
    /// Whether udev has set names and permissions of the port; always true without udev.
    #[serde(skip)]
    pub(crate) is_settled: bool,
    /// Identity of the USB device; `None` for ports that are not on USB.
    pub(crate) usb: Option<UsbIdentity>,
}

/// What a USB device reports about itself in its descriptor.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct UsbIdentity {
    /// Ids of vendor and product in hexadecimal, such as `1209:0001`.
    pub(crate) id: String,
    pub(crate) manufacturer: Option<String>,
    pub(crate) product: Option<String>,
    pub(crate) serial: Option<String>,
}

/// Whether a Corticode board is behind a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Likeness {
    /// The USB descriptor is a board's.
    Board,
    /// An ST-LINK, which is wired to the UART of the board that it is mounted on.
    Maybe,
    Other,
}

impl SerialPort {
    /// Returns whether a board is behind the port, judged by its USB descriptor.
    pub(crate) fn likeness(&self) -> Likeness {
        let Some(usb) = &self.usb else {
            return Likeness::Other;
        };
        let product = usb.product.as_deref().unwrap_or_default();
        let name = product.to_lowercase().replace('-', "");
        if (usb.id.as_str(), product) == BOARD {
            Likeness::Board
        } else if usb.id.starts_with(ST_VENDOR) && name.contains("stlink") {
            Likeness::Maybe
        } else {
            Likeness::Other
        }
    }

    /// Returns whether the project's udev rule has given the port a name, `/dev/corticode-SERIAL`.
    pub(crate) fn has_own_name(&self) -> bool {
        let link = self.link.as_ref();
        let name = link.and_then(|link| link.file_name()?.to_str());
        name.is_some_and(|name| name.starts_with(OWN_NAME))
    }

    /// Returns the serial number of the USB device; `None` for a port that is not on USB.
    pub(crate) fn serial(&self) -> Option<&str> {
        self.usb.as_ref()?.serial.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::{Likeness, SerialPort, SystemRoot, UsbIdentity};
    use crate::ports::simulated_machine::{BOARD, Descriptor, SimulatedMachine};

    #[test]
    fn ports_have_the_identity_of_their_usb_device_and_consoles_are_left_out() {
        let machine = SimulatedMachine::new();
        machine.plug(2, "ttyACM0", BOARD, None);
        let st_link = Descriptor {
            vendor: "0483",
            product_id: "374e",
            manufacturer: "STMicroelectronics",
            product: "STLINK-V3",
            serial: "0042",
        };
        machine.plug(3, "ttyACM1", st_link, None);
        machine.plug_ftdi(4, "ttyUSB0");
        machine.add_uart("ttyS0", 4);
        machine.add_uart("ttyS1", 0);
        for tty in ["tty0", "console", "ptmx"] {
            machine.add_virtual(tty);
        }
        let ports = SystemRoot::new(machine.folder()).serial_ports();
        let summary: Vec<_> = ports
            .iter()
            .map(|port| {
                let name = port.path.file_name().unwrap().to_str().unwrap();
                let id = port.usb.as_ref().map_or("-", |usb| &usb.id);
                let driver = port.driver.as_deref().unwrap();
                (name, id, driver, port.likeness())
            })
            .collect();
        let expected = [
            ("ttyACM0", "1209:0001", "cdc_acm", Likeness::Board),
            ("ttyACM1", "0483:374e", "cdc_acm", Likeness::Maybe),
            ("ttyS0", "-", "serial", Likeness::Other),
            ("ttyUSB0", "0403:6001", "ftdi_sio", Likeness::Other),
        ];
        assert_eq!(summary, expected);
        let serials: Vec<_> = ports.iter().map(SerialPort::serial).collect();
        assert_eq!(serials, [Some(BOARD.serial), Some("0042"), None, Some("A9XYZ")]);
        let link = |index: usize| ports[index].link.clone();
        let own = format!("dev/corticode-{}", BOARD.serial);
        assert_eq!(link(0), Some(machine.path(&own)));
        let by_id = "dev/serial/by-id/usb-STMicroelectronics_STLINK-V3_0042-if00";
        assert_eq!(link(1), Some(machine.path(by_id)));
        assert_eq!(link(2), None);
    }

    #[test]
    fn a_machine_without_sysfs_has_no_ports() {
        let folder = tempfile::tempdir().unwrap();
        assert!(SystemRoot::new(folder.path()).serial_ports().is_empty());
    }

    #[test]
    fn only_the_descriptor_of_a_board_is_a_board_and_an_st_link_may_be_one() {
        for (id, product, likeness) in [
            ("1209:0001", Some("Corticode"), Likeness::Board),
            ("1209:0001", Some("Blinky"), Likeness::Other),
            ("1209:0001", None, Likeness::Other),
            ("0483:374b", Some("STM32 STLink"), Likeness::Maybe),
            ("0483:374e", Some("STLINK-V3"), Likeness::Maybe),
            ("0483:5740", Some("Virtual COM Port"), Likeness::Other),
            ("0403:6001", Some("FT232R USB UART"), Likeness::Other),
        ] {
            let port = SerialPort {
                path: "/dev/ttyACM0".into(),
                link: None,
                driver: None,
                is_settled: true,
                usb: Some(UsbIdentity {
                    id: id.to_owned(),
                    product: product.map(str::to_owned),
                    ..UsbIdentity::default()
                }),
            };
            assert_eq!(port.likeness(), likeness, "{id} {product:?}");
        }
    }
}
