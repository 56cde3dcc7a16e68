//! A folder with files and links like those in `/sys` and `/dev` of a Linux machine, for tests.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// A machine whose devices a test plugs in and out.
pub(crate) struct SimulatedMachine(TempDir);

/// What a USB device reports about itself.
#[derive(Clone, Copy)]
pub(crate) struct Descriptor<'a> {
    pub(crate) vendor: &'a str,
    pub(crate) product_id: &'a str,
    pub(crate) manufacturer: &'a str,
    pub(crate) product: &'a str,
    pub(crate) serial: &'a str,
}

/// USB descriptor of a Corticode board.
pub(crate) const BOARD: Descriptor<'static> = Descriptor {
    vendor: "1209",
    product_id: "0001",
    manufacturer: "Corticode",
    product: "Corticode",
    serial: "3A0042001951333138363735",
};

/// USB descriptor of a second board, with another serial number.
pub(crate) const OTHER: Descriptor<'static> = Descriptor { serial: "3B", ..BOARD };

const CONTROLLER: &str = "sys/devices/pci0000:00/0000:00:14.0/usb1";

impl SimulatedMachine {
    pub(crate) fn new() -> SimulatedMachine {
        let machine = SimulatedMachine(tempfile::tempdir().unwrap());
        for folder in [CONTROLLER, "sys/class/tty", "dev/serial/by-id", "proc"] {
            fs::create_dir_all(machine.path(folder)).unwrap();
        }
        // The USB controller's own hub has ids too, which must not be mistaken for a board's.
        machine.write(&format!("{CONTROLLER}/idVendor"), "1d6b\n");
        machine.write(&format!("{CONTROLLER}/idProduct"), "0002\n");
        machine
    }

    pub(crate) fn folder(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.0.path().join(relative)
    }

    pub(crate) fn write(&self, relative: &str, text: &str) {
        let path = self.path(relative);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    /// Plugs a USB device with a CDC ACM port into `socket`. The port is a link to `node`, or an
    /// empty file if `node` is `None`. Also creates the links that udev and the project's udev rule
    /// create.
    pub(crate) fn plug(&self, socket: u32, tty: &str, usb: Descriptor<'_>, node: Option<&Path>) {
        let device = format!("{CONTROLLER}/1-{socket}");
        self.describe(&device, usb);
        let interface = format!("{device}/1-{socket}:1.0");
        self.terminal(&interface, "usb/drivers/cdc_acm", tty);
        match node {
            Some(node) => symlink(node, self.path(&format!("dev/{tty}"))).unwrap(),
            None => self.write(&format!("dev/{tty}"), ""),
        }
        if usb.product == BOARD.product {
            symlink(tty, self.path(&format!("dev/corticode-{}", usb.serial))).unwrap();
        }
        let Descriptor { manufacturer, product, serial, .. } = usb;
        let name = format!("usb-{manufacturer}_{product}_{serial}-if00").replace(' ', "_");
        let link = self.path(&format!("dev/serial/by-id/{name}"));
        symlink(format!("../../{tty}"), link).unwrap();
    }

    /// Plugs in a USB serial converter of FTDI. In sysfs its port is one folder deeper than a CDC
    /// port.
    pub(crate) fn plug_ftdi(&self, socket: u32, tty: &str) {
        let device = format!("{CONTROLLER}/1-{socket}");
        let usb = Descriptor {
            vendor: "0403",
            product_id: "6001",
            manufacturer: "FTDI",
            product: "FT232R USB UART",
            serial: "A9XYZ",
        };
        self.describe(&device, usb);
        let port = format!("{device}/1-{socket}:1.0/{tty}");
        self.terminal(&port, "usb-serial/drivers/ftdi_sio", tty);
        self.write(&format!("dev/{tty}"), "");
    }

    /// Adds an 8250 UART of the mainboard. `uart_type` is 0 if the kernel found no hardware for it.
    pub(crate) fn add_uart(&self, tty: &str, uart_type: u32) {
        let device = "sys/devices/pnp0/00:01/00:01:0/00:01:0.0";
        let driver = "sys/devices/pnp0/00:01/driver";
        self.link("sys/bus/pnp/drivers/serial", driver);
        self.terminal(device, "serial-base/drivers/port", tty);
        let file = format!("{device}/tty/{tty}/type");
        self.write(&file, &format!("{uart_type}\n"));
        self.write(&format!("dev/{tty}"), "");
    }

    /// Adds a terminal without hardware, such as a console or the master of pseudoterminals.
    pub(crate) fn add_virtual(&self, tty: &str) {
        let folder = format!("sys/devices/virtual/tty/{tty}");
        self.write(&format!("{folder}/dev"), "5:2\n");
        self.link(&folder, &format!("sys/class/tty/{tty}"));
    }

    /// Removes the USB device in `socket` and its port `tty`.
    pub(crate) fn unplug(&self, socket: u32, tty: &str) {
        fs::remove_file(self.path(&format!("dev/{tty}"))).unwrap();
        fs::remove_file(self.path(&format!("sys/class/tty/{tty}"))).unwrap();
        fs::remove_dir_all(self.path(&format!("{CONTROLLER}/1-{socket}"))).unwrap();
        for folder in ["dev", "dev/serial/by-id"] {
            for entry in fs::read_dir(self.path(folder)).unwrap() {
                let link = entry.unwrap().path();
                if fs::read_link(&link).is_ok_and(|target| target.ends_with(tty)) {
                    fs::remove_file(link).unwrap();
                }
            }
        }
    }

    fn describe(&self, device: &str, usb: Descriptor<'_>) {
        for (name, text) in [
            ("idVendor", usb.vendor),
            ("idProduct", usb.product_id),
            ("manufacturer", usb.manufacturer),
            ("product", usb.product),
            ("serial", usb.serial),
        ] {
            self.write(&format!("{device}/{name}"), &format!("{text}\n"));
        }
    }

    /// Adds the port `tty` of `device`, with a link to the device's driver.
    fn terminal(&self, device: &str, driver: &str, tty: &str) {
        let terminal = format!("{device}/tty/{tty}");
        // The digits at the end of the port's name are its minor device number: 1 for ttyACM1.
        let minor = tty.trim_start_matches(char::is_alphabetic);
        self.write(&format!("{terminal}/dev"), &format!("166:{minor}\n"));
        self.link(&format!("sys/bus/{driver}"), &format!("{device}/driver"));
        self.link(device, &format!("{terminal}/device"));
        self.link(&terminal, &format!("sys/class/tty/{tty}"));
    }

    /// Makes a symbolic link with a relative target, as the kernel does in sysfs.
    fn link(&self, target: &str, link: &str) {
        let path = self.path(link);
        fs::create_dir_all(self.path(target)).unwrap();
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let up = "../".repeat(link.matches('/').count());
        let _ = fs::remove_file(&path);
        symlink(format!("{up}{target}"), path).unwrap();
    }
}
