//! The requests by which a host learns what a device is, in the order of Linux.

use super::control::Setup;
use super::descriptor::{Descriptors, Ports, kind, text};
use super::event::Event;
use crate::usb::violation::Violations;

/// Address that the host assigns to the device.
pub(super) const ADDRESS: u8 = 7;
/// How long a device may take to change its address, ns (USB 2.0, 9.2.6.3).
const SET_ADDRESS_RECOVERY_NS: u64 = 2_000_000;
/// US English (USB language identifiers).
const LANGUAGE: u16 = 0x0409;
/// First version that has a BOS descriptor.
const BOS_VERSION: u16 = 0x0201;

const GET_DESCRIPTOR: u8 = 6;
const SET_ADDRESS: u8 = 5;
const SET_CONFIGURATION: u8 = 9;

/// Where an enumeration is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// 64 bytes at address 0, for the length of endpoint 0's packets.
    First,
    SetAddress,
    Short,
    Device,
    Qualifier,
    BosHeader,
    Bos(u16),
    ConfigurationHeader,
    Configuration(u16),
    Languages,
    /// The string in this place of manufacturer, product and serial number.
    Text(usize),
    SetConfiguration,
}

/// What the host does after a request.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next {
    Request,
    /// Waits this long first, ns.
    Pause(u64),
    Reset,
    Finished(Option<Ports>),
    Failed(String),
}

/// An enumeration in progress.
#[derive(Clone, Debug)]
pub(super) struct Enumeration {
    step: Step,
    pub(super) address: u8,
    pub(super) device: Descriptors,
}

impl Enumeration {
    pub(super) fn new() -> Self {
        Self {
            step: Step::First,
            address: 0,
            device: Descriptors {
                max_packet_0: 64,
                ..Descriptors::default()
            },
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
        match self.step {
            Step::First => get(kind::DEVICE, 0, 0, 64),
            Step::SetAddress => set(SET_ADDRESS, ADDRESS.into()),
            Step::Short => get(kind::DEVICE, 0, 0, 8),
            Step::Device => get(kind::DEVICE, 0, 0, 18),
            Step::Qualifier => get(kind::QUALIFIER, 0, 0, 10),
            Step::BosHeader => get(kind::BOS, 0, 0, 5),
            Step::Bos(total) => get(kind::BOS, 0, 0, total),
            Step::ConfigurationHeader => get(kind::CONFIGURATION, 0, 0, 9),
            Step::Configuration(total) => get(kind::CONFIGURATION, 0, 0, total),
            Step::Languages => get(kind::STRING, 0, 0, 255),
            Step::Text(n) => get(kind::STRING, self.device.strings[n], LANGUAGE, 255),
            Step::SetConfiguration => {
                set(SET_CONFIGURATION, self.device.configuration.value.into())
            }
        }
    }

    /// Goes on after the device has refused the request.
    pub(super) fn stalled(&mut self) -> Next {
        match self.step {
            // What a device for full speed only has to do (USB 2.0, 9.6.2).
            Step::Qualifier => self.after_qualifier(),
            Step::BosHeader => self.request_next(Step::ConfigurationHeader),
            _ => Next::Failed(format!("refused: {}", self.request())),
        }
    }

    /// Goes on with the answer to the request.
    pub(super) fn answered(
        &mut self,
        data: &[u8],
        now: u64,
        violations: &mut Violations,
        log: &mut Vec<Event>,
    ) -> Next {
        let total = |data: &[u8]| match data {
            [_, _, low, high, ..] => u16::from_le_bytes([*low, *high]),
            _ => 0,
        };
        match self.step {
            Step::First | Step::Short => {
                let is_first = self.step == Step::First;
                match data.get(7) {
                    Some(&max_packet) if [8, 16, 32, 64].contains(&max_packet) => {
                        self.device.max_packet_0 = max_packet;
                    }
                    _ => return Next::Failed(format!("device descriptor {data:02x?}")),
                }
                self.step = if is_first {
                    Step::SetAddress
                } else {
                    Step::Device
                };
                if is_first { Next::Reset } else { Next::Request }
            }
            Step::SetAddress => {
                self.address = ADDRESS;
                self.step = Step::Short;
                Next::Pause(SET_ADDRESS_RECOVERY_NS)
            }
            Step::Device => {
                self.device.device(data, now, violations);
                self.step = Step::Qualifier;
                Next::Request
            }
            Step::Qualifier => {
                log.push(Event::Note(
                    "answers DEVICE_QUALIFIER, as only a high-speed device should (USB 2.0, 9.6.2)",
                ));
                self.after_qualifier()
            }
            // Hosts go on without one.
            Step::BosHeader if data.len() < 5 => {
                let text = format!(
                    "bcdUSB is {:#06x} and the BOS descriptor has {} bytes (USB 3.2, 9.6.2)",
                    self.device.usb,
                    data.len()
                );
                violations.record(now, text);
                self.request_next(Step::ConfigurationHeader)
            }
            Step::BosHeader => self.request_next(Step::Bos(total(data))),
            Step::Bos(_) => {
                self.device.bos(data, now, violations);
                self.request_next(Step::ConfigurationHeader)
            }
            Step::ConfigurationHeader if data.len() < 9 => {
                Next::Failed(format!("configuration descriptor of {} bytes", data.len()))
            }
            Step::ConfigurationHeader => self.request_next(Step::Configuration(total(data))),
            Step::Configuration(_) => {
                self.device.configuration(data, now, violations);
                self.request_next(Step::Languages)
            }
            Step::Languages => {
                let languages: Vec<u8> = data.iter().copied().skip(2).collect();
                if !languages.chunks(2).any(|l| l == LANGUAGE.to_le_bytes()) {
                    violations.record(now, "no US English among the languages of the strings");
                }
                self.text_from(0)
            }
            Step::Text(n) => {
                let text = text(data, now, violations);
                match n {
                    0 => self.device.manufacturer = text,
                    1 => self.device.product_name = text,
                    _ => self.device.serial_number = text,
                }
                self.text_from(n + 1)
            }
            Step::SetConfiguration => Next::Finished(self.device.ports(now, violations)),
        }
    }

    fn request_next(&mut self, step: Step) -> Next {
        self.step = step;
        Next::Request
    }

    fn after_qualifier(&mut self) -> Next {
        self.step = if self.device.usb >= BOS_VERSION {
            Step::BosHeader
        } else {
            Step::ConfigurationHeader
        };
        Next::Request
    }

    /// Asks for the next string that the device has, from place `n` on.
    fn text_from(&mut self, n: usize) -> Next {
        let next = (n..3).find(|&n| self.device.strings[n] != 0);
        self.request_next(next.map_or(Step::SetConfiguration, Step::Text))
    }
}
