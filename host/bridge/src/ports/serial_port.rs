//! A serial port of this machine, with the identity of the USB device that provides it.

use std::path::PathBuf;

use serde::Serialize;

/// USB vendor and product of a board (`firmware/board-stm32/src/port/usb.rs`). Other devices use
/// the pair too, for tests, so the product's name counts as well.
const BOARD: (&str, &str) = ("1209:0001", "Corticode");
/// USB vendor of STMicroelectronics, whose ST-LINK connects a board's UART.
const ST_VENDOR: &str = "0483:";

/// Start of the names in `/dev` that the project's udev rule gives (`packaging/60-corticode.rules`).
pub(crate) const OWN_NAME: &str = "corticode-";

/// A serial port that has a device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct SerialPort {
    /// Path of the port, such as `/dev/ttyACM0`.
    pub(crate) path: PathBuf,
    /// Link to the port whose name does not depend on the order of plugging in:
    /// `/dev/corticode-SERIAL`, else one in `/dev/serial/by-id`.
    pub(crate) link: Option<PathBuf>,
    /// Driver of the port in the kernel, such as `cdc_acm`.
    pub(crate) driver: Option<String>,
    /// Whether udev has set names and permissions of the port; always true without udev.
    #[serde(skip)]
    pub(crate) is_settled: bool,
    /// Identity of the USB device; `None` for ports that are not on USB.
    pub(crate) usb: Option<UsbIdentity>,
}

/// Identity of a USB device, from its descriptor.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct UsbIdentity {
    /// Vendor and product in hexadecimal, such as `1209:0001`.
    pub(crate) id: String,
    pub(crate) manufacturer: Option<String>,
    pub(crate) product: Option<String>,
    pub(crate) serial: Option<String>,
}

/// Whether a port leads to a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Likeness {
    /// The USB descriptor is a board's.
    Board,
    /// An ST-LINK, which is wired to the UART of whatever board it sits on.
    Maybe,
    Other,
}

impl SerialPort {
    /// Returns whether the port leads to a board, as far as its USB descriptor shows.
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

    /// Returns whether udev has given the port a name by the project's rule, `/dev/corticode-SERIAL`.
    pub(crate) fn has_own_name(&self) -> bool {
        let name = self
            .link
            .as_ref()
            .and_then(|link| link.file_name()?.to_str());
        name.is_some_and(|name| name.starts_with(OWN_NAME))
    }

    /// Returns the serial number of the USB device.
    pub(crate) fn serial(&self) -> Option<&str> {
        self.usb.as_ref()?.serial.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::{Likeness, SerialPort, UsbIdentity};

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
