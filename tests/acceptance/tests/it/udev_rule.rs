//! Debian's udev applies the rules in `packaging/60-corticode.rules` to simulated USB devices.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use acceptance::workspace;
use emulator::skip::skip_unless_required;

const RULES: &str = "packaging/60-corticode.rules";
const BOARD_SERIAL: &str = "3A0042001951333138363735";
const USB_DEVICE: &str = "/devices/pci0000:00/0000:00:14.0/usb1/1-2";
const TTY: &str = "/devices/pci0000:00/0000:00:14.0/usb1/1-2/1-2:1.0/tty/ttyACM7";

/// Shell script that runs `udevadm test` for the device in the file `description`, with our rules
/// added to those of the system. `/dev` and `/run` are temporary file systems of a namespace,
/// because udevadm creates symbolic links there. umockdev needs pseudoterminals.
const SCRIPT: &str = r#"
set -e
mount -t tmpfs run /run
mkdir -p /run/udev/rules.d
mkdir "$1/dev"
mount -t tmpfs dev "$1/dev"
touch "$1/dev/null"
mount --bind /dev/null "$1/dev/null"
mkdir "$1/dev/pts"
mount -t devpts -o newinstance,ptmxmode=0666 devpts "$1/dev/pts"
ln -s pts/ptmx "$1/dev/ptmx"
mount --move "$1/dev" /dev
cp "$2" /run/udev/rules.d/
umockdev-run --device "$1/description" -- udevadm test "$3"
"#;

/// Returns whether udev, umockdev and namespaces can be used; reports `test` as skipped if not.
fn available(test: &str) -> bool {
    let runs = |program: &str, argument: &str| {
        let output = Command::new(program).arg(argument).output();
        output.is_ok_and(|output| output.status.success())
    };
    let missing: Vec<&str> = ["udevadm", "umockdev-run"]
        .into_iter()
        .filter(|program| !runs(program, "--version"))
        .collect();
    if !missing.is_empty() {
        let missing = missing.join(", ");
        let why = format!("no {missing}; `apt-get install udev umockdev`");
        skip_unless_required(test, why);
        return false;
    }
    if !in_namespace().arg("true").status().is_ok_and(|status| status.success()) {
        let why = "this user may not create namespaces (unshare --user --mount)";
        skip_unless_required(test, why);
        return false;
    }
    true
}

fn in_namespace() -> Command {
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount"]);
    command
}

/// Describes a USB device with a virtual serial port, in the format of `umockdev-record`.
fn description(ids: [&str; 2], product: &str) -> String {
    let [vendor, id] = ids;
    format!(
        "\
P: {USB_DEVICE}
N: bus/usb/001/004
E: DEVNAME=/dev/bus/usb/001/004
E: DEVTYPE=usb_device
E: DRIVER=usb
E: MAJOR=189
E: MINOR=3
E: SUBSYSTEM=usb
A: bDeviceClass=ef
A: idVendor={vendor}
A: idProduct={id}
A: manufacturer={product}
A: product={product}
A: serial={BOARD_SERIAL}

P: {USB_DEVICE}/1-2:1.0
E: DEVTYPE=usb_interface
E: DRIVER=cdc_acm
E: SUBSYSTEM=usb
A: bInterfaceClass=02
A: bInterfaceNumber=00

P: {TTY}
N: ttyACM7
E: DEVNAME=/dev/ttyACM7
E: MAJOR=166
E: MINOR=7
E: SUBSYSTEM=tty
"
    )
}

/// What udev has decided about a simulated device.
struct Decision {
    /// Properties as lines `NAME=VALUE`, and the commands that udev would run.
    properties: String,
    /// Log of udev, which names for each assignment the rule that made it.
    log: String,
}

impl Decision {
    fn has(&self, property: &str) -> bool {
        self.properties.lines().any(|line| line == property)
    }

    /// Returns the value of the property `name`, or an empty string if there is none.
    fn value(&self, name: &str) -> &str {
        let mut lines = self.properties.lines();
        lines.find_map(|line| line.strip_prefix(name)?.strip_prefix('=')).unwrap_or_default()
    }

    fn assignments_of_our_rules(&self) -> Vec<&str> {
        let lines = self.log.lines();
        lines.filter(|line| line.contains("/60-corticode.rules:")).collect()
    }
}

fn decide(description: &str, device: &str) -> Decision {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("description"), description).expect("a file");
    let rules = workspace::root().join(RULES);
    let Output { status, stdout, stderr } = in_namespace()
        .args(["sh", "-c", SCRIPT, "sh"])
        .arg(folder.path())
        .arg(rules)
        .arg(device)
        .output()
        .expect("unshare starts");
    let log = String::from_utf8_lossy(&stderr).into_owned();
    let properties = String::from_utf8_lossy(&stdout).into_owned();
    assert!(status.success(), "{properties}\n{log}");
    Decision { properties, log }
}

#[test]
fn a_board_gets_a_name_with_its_serial_number_access_and_no_modem_manager() {
    if !available("udev's rule for a board") {
        return;
    }
    let board = description(["1209", "0001"], "Corticode");
    let port = decide(&board, TTY);
    let log = port.assignments_of_our_rules().join("\n");
    assert!(port.has("ID_MM_DEVICE_IGNORE=1"), "{}", port.properties);
    let name = format!("/dev/corticode-{BOARD_SERIAL}");
    let mut links = port.value("DEVLINKS").split(' ');
    assert!(links.any(|link| link == name), "{}", port.properties);
    let dialout = Command::new("getent").args(["group", "dialout"]).output();
    let dialout = String::from_utf8(dialout.expect("getent starts").stdout).expect("text");
    let id = dialout.split(':').nth(2).expect("a group id");
    assert!(log.contains(&format!("GROUP {id}")), "{log}");
    assert!(log.contains("MODE 0660"), "{log}");
    // systemd runs `uaccess` in a rule with the number 73, so our rule must have a smaller number.
    assert!(port.has("run: 'uaccess'"), "{}", port.properties);
    // ModemManager leaves a port alone only if its USB device is excluded as well.
    let usb = decide(&board, USB_DEVICE);
    assert!(usb.has("ID_MM_DEVICE_IGNORE=1"), "{}", usb.properties);
}

#[test]
fn the_boot_loader_of_a_microcontroller_may_be_opened_and_has_no_name() {
    if !available("udev's rule for a boot loader") {
        return;
    }
    let loader = description(["0483", "df11"], "STM32  BOOTLOADER");
    let usb = decide(&loader, USB_DEVICE);
    let log = usb.assignments_of_our_rules().join("\n");
    assert!(log.contains("MODE 0660"), "{log}");
    assert!(usb.has("run: 'uaccess'"), "{}", usb.properties);
    let interface = decide(&loader, TTY);
    assert!(interface.assignments_of_our_rules().is_empty());
}

#[test]
fn a_device_with_another_product_is_left_alone() {
    if !available("udev's rule for other devices") {
        return;
    }
    for (ids, product) in [(["1209", "0001"], "Blinky"), (["0483", "374b"], "Corticode")] {
        for device in [TTY, USB_DEVICE] {
            let decision = decide(&description(ids, product), device);
            // This property shows that udev has indeed read the simulated device.
            assert_eq!(decision.value("ID_MODEL"), product, "{}", decision.log);
            let ours = decision.assignments_of_our_rules();
            assert!(ours.is_empty(), "{ours:?}");
            for word in ["ID_MM_DEVICE_IGNORE", "corticode-", "uaccess"] {
                assert!(!decision.properties.contains(word), "{}", decision.properties);
            }
        }
    }
}

#[test]
fn the_rule_names_the_firmware_s_descriptor_and_the_docs_install_the_rule() {
    let read =
        |path: &str| fs::read_to_string(workspace::root().join(Path::new(path))).expect(path);
    let firmware = read("firmware/board-stm32/src/port/usb.rs");
    for part in [
        "const VENDOR: u16 = 0x1209;",
        "const PRODUCT: u16 = 0x0001;",
        "config.product = Some(\"Corticode\");",
    ] {
        assert!(firmware.contains(part), "{part} has changed: change {RULES} too");
    }
    let rules = read(RULES);
    for part in ["idVendor}==\"1209\"", "idProduct}==\"0001\"", "{product}==\"Corticode\""] {
        assert_eq!(rules.matches(part).count(), 2, "{part}");
    }
    let install = "sudo install -m 644 packaging/60-corticode.rules /etc/udev/rules.d/";
    assert!(read("docs/hardware.md").contains(install));
    assert!(rules.contains(install));
}
