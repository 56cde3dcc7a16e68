//! Checks that the port exists, may be opened, is not in use, and has a name from the udev rule.

use std::path::PathBuf;

use crate::doctor::Check;
use crate::ports::access::PortAccess;

/// Shell command that installs the project's udev rule.
const INSTALL_RULE: &str = "corticode-bridge ports --udev-rule | sudo tee \
                            /etc/udev/rules.d/60-corticode.rules && sudo udevadm control --reload \
                            && sudo udevadm trigger --action=add --subsystem-match=usb \
                            --subsystem-match=tty";

/// Shell command that applies the installed udev rule to a board that is already plugged in.
const APPLY_RULE: &str = "sudo udevadm control --reload && sudo udevadm trigger --action=add \
                          --subsystem-match=usb --subsystem-match=tty";

/// What is known about the port without opening it.
#[derive(Clone, Debug)]
pub(crate) struct PortFacts {
    pub(crate) place: PortPlace,
    /// Whether ModemManager runs, which probes serial ports.
    pub(crate) modem_manager: bool,
}

/// Kind of the port and where it is.
#[derive(Clone, Debug)]
pub(crate) enum PortPlace {
    /// A TCP port, with its address.
    Network(String),
    /// A port that does not exist, with the reason and the remedy.
    Missing { why: String, remedy: String },
    /// A serial port or a pseudoterminal.
    Terminal { path: PathBuf, access: PortAccess, usb: UsbPort },
}

/// What USB device a serial port belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UsbPort {
    /// A Corticode board, with the state of the udev rule for it.
    Board(UdevRule),
    /// Another USB device, such as an ST-LINK.
    Other,
    /// The port is not on USB.
    None,
}

/// State of the project's udev rule for a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UdevRule {
    /// udev has applied the rule: the board has the name that the rule gives.
    Applied,
    /// The rule is installed, but the board was plugged in before its installation.
    Installed,
    Missing,
}

impl UdevRule {
    /// Returns what is wrong and the command that helps; `None` if the rule was applied.
    fn objection(self) -> Option<(&'static str, &'static str)> {
        match self {
            UdevRule::Applied => None,
            UdevRule::Installed => Some((
                "installed after the board was plugged in: the board has no name \
                 /dev/corticode-SERIAL",
                APPLY_RULE,
            )),
            UdevRule::Missing => Some((
                "not installed: the board has no name /dev/corticode-SERIAL, and `corticode-bridge \
                 update` may not open its boot loader",
                INSTALL_RULE,
            )),
        }
    }
}

/// Checks a port: existence, permission, other programs, udev rule and ModemManager.
pub(crate) fn check_port(facts: &PortFacts) -> Vec<Check> {
    let (path, access, usb) = match &facts.place {
        PortPlace::Network(address) => return vec![Check::ok("port", address.as_str())],
        PortPlace::Missing { why, remedy } => {
            return vec![Check::error("port", why.as_str(), remedy.as_str())];
        }
        PortPlace::Terminal { path, access, usb } => (path, access, *usb),
    };
    let mut checks = vec![Check::ok("port", path.display().to_string())];
    let objection = access.objection(path);
    let denied = matches!(access, PortAccess::Denied(_) | PortAccess::Broken(_));
    checks.push(match &objection {
        Some((what, remedy)) if denied => Check::error("permission", what, remedy),
        _ => Check::ok("permission", "this user may open the port"),
    });
    match &objection {
        Some((what, remedy)) if !denied => checks.push(Check::error("other program", what, remedy)),
        None => checks.push(Check::ok("other program", "none has the port open")),
        Some(_) => {}
    }
    checks.extend(check_rule(usb));
    checks.extend(check_modem_manager(usb, facts.modem_manager));
    checks
}

fn check_rule(usb: UsbPort) -> Option<Check> {
    const NAME: &str = "udev rule";
    let UsbPort::Board(rule) = usb else {
        return None;
    };
    Some(match rule.objection() {
        Some((finding, remedy)) => Check::warning(NAME, finding, remedy),
        None => Check::ok(NAME, "the board has a name in /dev"),
    })
}

fn check_modem_manager(usb: UsbPort, runs: bool) -> Option<Check> {
    const NAME: &str = "ModemManager";
    const DISABLE: &str = "sudo systemctl disable --now ModemManager (on a PC without a modem)";
    let remedy = match usb {
        UsbPort::None => return None,
        _ if !runs => return Some(Check::ok(NAME, "does not run")),
        UsbPort::Other => Some(DISABLE),
        UsbPort::Board(rule) => rule.objection().map(|(_, remedy)| remedy),
    };
    Some(match remedy {
        Some(remedy) => {
            let finding = "runs, and may send commands for modems to the port";
            Check::warning(NAME, finding, remedy)
        }
        None => Check::ok(NAME, "runs, and ignores the board because of the udev rule"),
    })
}

#[cfg(test)]
mod tests {
    use super::{PortFacts, PortPlace, UdevRule, UsbPort, check_port};
    use crate::doctor::{Check, Level};
    use crate::ports::access::{Membership, PortAccess};

    fn check(access: PortAccess, usb: UsbPort, modem_manager: bool) -> Vec<Check> {
        let path = "/dev/ttyACM0".into();
        let place = PortPlace::Terminal { path, access, usb };
        check_port(&PortFacts { place, modem_manager })
    }

    fn not_ok(checks: &[Check]) -> Vec<(&str, Level)> {
        let wrong = checks.iter().filter(|check| check.level != Level::Ok);
        wrong.map(|check| (check.name, check.level)).collect()
    }

    #[test]
    fn a_free_board_with_the_rule_passes_also_while_modem_manager_runs() {
        let board = UsbPort::Board(UdevRule::Applied);
        let checks = check(PortAccess::Free, board, true);
        assert_eq!(checks.len(), 5);
        assert_eq!(not_ok(&checks), []);
    }

    #[test]
    fn a_board_without_the_rule_is_a_warning_and_modem_manager_another_one() {
        let install = "corticode-bridge ports --udev-rule | sudo tee";
        for (rule, command) in
            [(UdevRule::Missing, install), (UdevRule::Installed, "sudo udevadm control --reload")]
        {
            let board = UsbPort::Board(rule);
            let checks = check(PortAccess::Free, board, true);
            let expected = [("udev rule", Level::Warning), ("ModemManager", Level::Warning)];
            assert_eq!(not_ok(&checks), expected);
            for check in &checks[3..] {
                let remedy = check.remedy.as_deref().unwrap();
                assert!(remedy.starts_with(command), "{remedy}");
            }
            assert_eq!(not_ok(&check(PortAccess::Free, board, false)).len(), 1);
        }
        let st_link = check(PortAccess::Free, UsbPort::Other, true);
        assert_eq!(not_ok(&st_link), [("ModemManager", Level::Warning)]);
        assert_eq!(not_ok(&check(PortAccess::Free, UsbPort::None, true)), []);
    }

    #[test]
    fn a_denied_port_is_an_error_with_the_command_that_helps() {
        let group = "dialout".to_owned();
        let denied = PortAccess::Denied(Membership::Outsider { group });
        let checks = check(denied, UsbPort::None, false);
        assert_eq!(not_ok(&checks), [("permission", Level::Error)]);
        let remedy = checks[1].remedy.as_deref().unwrap();
        assert!(remedy.contains("usermod -aG dialout"), "{remedy}");
    }
}
