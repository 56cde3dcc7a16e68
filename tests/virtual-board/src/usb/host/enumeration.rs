//! Enumeration: the host reads a device's descriptors and configures it, in Linux's order.

use super::control::Setup;
use super::descriptor::{Descriptors, SerialPort, kind, parse_string};
use crate::usb::violation::Violations;

/// USB address that the host gives to the device; every number from 1 to 127 is valid.
pub(super) const ADDRESS: u8 = 7;
/// Longest time in ns that a device may take to change its address (USB 2.0, 9.2.6.3).
const SET_ADDRESS_RECOVERY_NS: u64 = 2_000_000;
/// Number of the language in which the host requests strings: US English.
const LANGUAGE: u16 = 0x0409;
/// Lowest USB version (`bcdUSB`) with which a device must have a BOS descriptor.
const BOS_VERSION: u16 = 0x0201;

const GET_DESCRIPTOR: u8 = 6;
const SET_ADDRESS: u8 = 5;
const SET_CONFIGURATION: u8 = 9;

/// Stages of an enumeration, each named after its request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Reads the device descriptor at address 0, to learn the packet size of endpoint 0.
    First,
    SetAddress,
    /// Reads the first 8 bytes of the device descriptor at the new address.
    Short,
    Device,
    Qualifier,
    BosHeader,
    Bos(u16),
    ConfigurationHeader,
    Configuration(u16),
    Languages,
    /// Reads a string descriptor: 0 is the manufacturer, 1 the product and 2 the serial number.
    String(usize),
    SetConfiguration,
}

/// What the host has to do after a request has ended.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next {
    Request,
    /// Wait for this time in ns before the next request.
    Pause(u64),
    Reset,
    Finished(Option<SerialPort>),
    Failed(String),
}

/// An enumeration in progress, with the descriptors that were read so far.
#[derive(Clone, Debug)]
pub(super) struct Enumeration {
    stage: Stage,
    pub(super) address: u8,
    pub(super) device: Descriptors,
}

impl Enumeration {
    pub(super) fn new() -> Self {
        Self {
            stage: Stage::First,
            address: 0,
            device: Descriptors { max_packet_0: 64, ..Descriptors::default() },
        }
    }

    pub(super) fn request(&self) -> Setup {
        let get = |kind: u8, index: u8, language: u16, length: u16| Setup {
            request_type: 0x80,
            request: GET_DESCRIPTOR,
            value: u16::from(kind) << 8 | u16::from(index),
            index: language,
            length,
        };
        let set = |request: u8, value: u16| Setup {
            request_type: 0x00,
            request,
            value,
            index: 0,
            length: 0,
        };
        match self.stage {
            Stage::First => get(kind::DEVICE, 0, 0, 64),
            Stage::SetAddress => set(SET_ADDRESS, ADDRESS.into()),
            Stage::Short => get(kind::DEVICE, 0, 0, 8),
            Stage::Device => get(kind::DEVICE, 0, 0, 18),
            Stage::Qualifier => get(kind::QUALIFIER, 0, 0, 10),
            Stage::BosHeader => get(kind::BOS, 0, 0, 5),
            Stage::Bos(total) => get(kind::BOS, 0, 0, total),
            Stage::ConfigurationHeader => get(kind::CONFIGURATION, 0, 0, 9),
            Stage::Configuration(total) => get(kind::CONFIGURATION, 0, 0, total),
            Stage::Languages => get(kind::STRING, 0, 0, 255),
            Stage::String(n) => get(kind::STRING, self.device.strings[n], LANGUAGE, 255),
            Stage::SetConfiguration => set(SET_CONFIGURATION, self.device.configuration.into()),
        }
    }

    /// Returns what to do after the device has rejected the request with STALL.
    pub(super) fn on_stall(&mut self) -> Next {
        match self.stage {
            // A full-speed-only device must reject the request for its qualifier (USB 2.0, 9.6.2).
            Stage::Qualifier => self.after_qualifier(),
            Stage::BosHeader => self.request_next(Stage::ConfigurationHeader),
            _ => Next::Failed(format!("rejected with STALL: {}", self.request())),
        }
    }

    /// Returns what to do after the device has answered the request with `data`.
    pub(super) fn on_response(
        &mut self,
        data: &[u8],
        now: u64,
        violations: &mut Violations,
    ) -> Next {
        let total = |data: &[u8]| match data {
            [_, _, low, high, ..] => u16::from_le_bytes([*low, *high]),
            _ => 0,
        };
        match self.stage {
            Stage::First | Stage::Short => {
                let is_first = self.stage == Stage::First;
                match data.get(7) {
                    Some(&max_packet) if [8, 16, 32, 64].contains(&max_packet) => {
                        self.device.max_packet_0 = max_packet;
                    }
                    _ => return Next::Failed(format!("device descriptor {data:02x?}")),
                }
                self.stage = if is_first { Stage::SetAddress } else { Stage::Device };
                if is_first { Next::Reset } else { Next::Request }
            }
            Stage::SetAddress => {
                self.address = ADDRESS;
                self.stage = Stage::Short;
                Next::Pause(SET_ADDRESS_RECOVERY_NS)
            }
            Stage::Device => {
                self.device.parse_device(data, now, violations);
                self.stage = Stage::Qualifier;
                Next::Request
            }
            Stage::Qualifier => self.after_qualifier(),
            // Continue without the BOS descriptor, as real hosts do.
            Stage::BosHeader if data.len() < 5 => {
                let text = format!(
                    "bcdUSB is {:#06x} and the BOS descriptor has {} bytes (USB 3.2, 9.6.2)",
                    self.device.usb,
                    data.len()
                );
                violations.record(now, text);
                self.request_next(Stage::ConfigurationHeader)
            }
            Stage::BosHeader => self.request_next(Stage::Bos(total(data))),
            Stage::Bos(_) => {
                self.device.parse_bos(data, now, violations);
                self.request_next(Stage::ConfigurationHeader)
            }
            Stage::ConfigurationHeader if data.len() < 9 => {
                Next::Failed(format!("configuration descriptor of {} bytes", data.len()))
            }
            Stage::ConfigurationHeader => self.request_next(Stage::Configuration(total(data))),
            Stage::Configuration(_) => {
                self.device.parse_configuration(data, now, violations);
                self.request_next(Stage::Languages)
            }
            Stage::Languages => {
                let languages: Vec<u8> = data.iter().copied().skip(2).collect();
                if !languages.chunks(2).any(|l| l == LANGUAGE.to_le_bytes()) {
                    violations.record(now, "the string languages do not include US English");
                }
                self.request_string(0)
            }
            Stage::String(n) => {
                let text = parse_string(data, now, violations);
                match n {
                    0 => self.device.manufacturer = text,
                    1 => self.device.product_name = text,
                    // The serial number is read and checked like the other strings, but not stored.
                    _ => {}
                }
                self.request_string(n + 1)
            }
            Stage::SetConfiguration => {
                Next::Finished(self.device.find_serial_port(now, violations))
            }
        }
    }

    fn request_next(&mut self, stage: Stage) -> Next {
        self.stage = stage;
        Next::Request
    }

    fn after_qualifier(&mut self) -> Next {
        self.stage = if self.device.usb >= BOS_VERSION {
            Stage::BosHeader
        } else {
            Stage::ConfigurationHeader
        };
        Next::Request
    }

    /// Requests the next string that the device has, from index `n` on; sets the configuration if
    /// there is none.
    fn request_string(&mut self, n: usize) -> Next {
        let next = (n..3).find(|&n| self.device.strings[n] != 0);
        self.request_next(next.map_or(Stage::SetConfiguration, Stage::String))
    }
}
