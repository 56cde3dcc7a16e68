//! Parsing and checking of descriptors (USB 2.0, 9.6; CDC 1.2, 5.2).

use crate::usb::violation::Violations;

/// Descriptor types (USB 2.0, table 9-5; BOS: USB 3.2, table 9-6).
pub(super) mod kind {
    pub(crate) const DEVICE: u8 = 1;
    pub(crate) const CONFIGURATION: u8 = 2;
    pub(crate) const STRING: u8 = 3;
    pub(crate) const INTERFACE: u8 = 4;
    pub(crate) const ENDPOINT: u8 = 5;
    pub(crate) const QUALIFIER: u8 = 6;
    pub(crate) const BOS: u8 = 15;
    pub(crate) const DEVICE_CAPABILITY: u8 = 16;
    pub(crate) const CLASS_INTERFACE: u8 = 0x24;
}

/// Class and subclass of the control interface of a serial port (CDC 1.2, 4.2).
const COMMUNICATIONS: [u8; 2] = [0x02, 0x02];
/// Class of the data interface of a serial port.
const DATA: u8 = 0x0A;

/// Contents of the descriptors of a device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Descriptors {
    /// `bcdUSB`: USB version in BCD, for example 0x0210 for 2.1.
    pub usb: u16,
    /// `bDeviceClass`, `bDeviceSubClass` and `bDeviceProtocol`.
    pub class: [u8; 3],
    /// Maximum packet size of endpoint 0, in bytes.
    pub max_packet_0: u8,
    /// USB identifier of the manufacturer (`idVendor`).
    pub vendor: u16,
    /// Identifier of the product (`idProduct`).
    pub product: u16,
    /// `bcdDevice`: version of the device, in BCD.
    pub release: u16,
    /// Manufacturer string; empty if the device has none.
    pub manufacturer: String,
    /// Product string; empty if the device has none.
    pub product_name: String,
    /// Serial number string; empty if the device has none.
    pub serial_number: String,
    /// Number of capabilities in the BOS descriptor; `None` without that descriptor.
    pub capabilities: Option<u8>,
    /// Contents of the only configuration descriptor.
    pub configuration: Configuration,
    /// String indices of manufacturer, product and serial number; 0 for none.
    pub(super) strings: [u8; 3],
}

/// A configuration descriptor, with the interfaces that it contains (USB 2.0, 9.6.3).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Configuration {
    /// Number that selects this configuration (`bConfigurationValue`).
    pub value: u8,
    /// `bmAttributes`: bit 6 means self-powered, bit 5 remote wake-up.
    pub attributes: u8,
    /// Maximum current from the bus, in mA.
    pub max_current_ma: u16,
    /// Interfaces in alternate setting 0.
    pub interfaces: Vec<Interface>,
}

/// An interface descriptor in alternate setting 0, with the descriptors that belong to it (USB 2.0, 9.6.5).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Interface {
    /// Number of the interface (`bInterfaceNumber`).
    pub number: u8,
    /// `bInterfaceClass`, `bInterfaceSubClass` and `bInterfaceProtocol`.
    pub class: [u8; 3],
    /// Endpoints except endpoint 0.
    pub endpoints: Vec<EndpointDescriptor>,
    /// `bDescriptorSubtype` of each class-specific descriptor.
    pub functions: Vec<u8>,
}

/// Contents of an endpoint descriptor (USB 2.0, 9.6.6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EndpointDescriptor {
    /// `bEndpointAddress`: bit 7 is set for IN.
    pub address: u8,
    /// `bmAttributes`: 2 is bulk, 3 is interrupt.
    pub attributes: u8,
    /// Maximum packet size, in bytes.
    pub max_packet: u16,
    /// `bInterval`, in frames.
    pub interval: u8,
}

/// Control interface and endpoints of a serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SerialPort {
    pub(super) control_interface: u8,
    pub(super) input: EndpointDescriptor,
    pub(super) output: EndpointDescriptor,
    pub(super) notification: EndpointDescriptor,
}

/// Records the rules of the specification that a descriptor violates.
struct Checker<'a> {
    now: u64,
    violations: &'a mut Violations,
}

impl Checker<'_> {
    fn expect(&mut self, holds: bool, what: &str, section: &str) {
        if !holds {
            let text = format!("{what} ({section})");
            self.violations.record(self.now, text);
        }
    }
}

fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([byte(bytes, at), byte(bytes, at + 1)])
}

fn byte(bytes: &[u8], at: usize) -> u8 {
    bytes.get(at).copied().unwrap_or_default()
}

impl Descriptors {
    /// Parses and checks the device descriptor.
    pub(super) fn parse_device(&mut self, bytes: &[u8], now: u64, violations: &mut Violations) {
        let mut checker = Checker { now, violations };
        let section = "device descriptor, USB 2.0, 9.6.1";
        let (length, kind) = (byte(bytes, 0), byte(bytes, 1));
        checker.expect(
            bytes.len() == 18 && length == 18,
            "its length is not 18",
            section,
        );
        checker.expect(kind == kind::DEVICE, "its type is not 1", section);
        self.usb = word(bytes, 2);
        self.class = [byte(bytes, 4), byte(bytes, 5), byte(bytes, 6)];
        self.max_packet_0 = byte(bytes, 7);
        self.vendor = word(bytes, 8);
        self.product = word(bytes, 10);
        self.release = word(bytes, 12);
        self.strings = [byte(bytes, 14), byte(bytes, 15), byte(bytes, 16)];
        let known = [0x0110, 0x0200, 0x0201, 0x0210].contains(&self.usb);
        checker.expect(known, &format!("bcdUSB is {:#06x}", self.usb), section);
        let sized = [8, 16, 32, 64].contains(&self.max_packet_0);
        checker.expect(
            sized,
            &format!("bMaxPacketSize0 is {}", self.max_packet_0),
            section,
        );
        checker.expect(
            byte(bytes, 17) == 1,
            "it does not have exactly one configuration",
            section,
        );
        checker.expect(self.vendor != 0, "idVendor is 0", section);
    }

    /// Parses and checks the configuration descriptor and the descriptors that it contains.
    pub(super) fn parse_configuration(
        &mut self,
        bytes: &[u8],
        now: u64,
        violations: &mut Violations,
    ) {
        let mut checker = Checker { now, violations };
        let section = "configuration descriptor, USB 2.0, 9.6.3";
        checker.expect(byte(bytes, 0) == 9, "its length is not 9", section);
        let total = usize::from(word(bytes, 2));
        checker.expect(
            total == bytes.len(),
            "wTotalLength is not its length",
            section,
        );
        let attributes = byte(bytes, 7);
        checker.expect(
            attributes & 0x9F == 0x80,
            "reserved bits of bmAttributes",
            section,
        );
        let mut configuration = Configuration {
            value: byte(bytes, 5),
            attributes,
            max_current_ma: u16::from(byte(bytes, 8)) * 2,
            interfaces: Vec::new(),
        };
        checker.expect(
            configuration.value != 0,
            "bConfigurationValue is 0",
            section,
        );
        checker.expect(
            configuration.max_current_ma <= 500,
            "more than 500 mA",
            section,
        );
        let mut rest = bytes.get(9..).unwrap_or_default();
        let mut expected = 0;
        while !rest.is_empty() {
            let length = usize::from(byte(rest, 0));
            if length < 2 || length > rest.len() {
                checker.expect(false, "a descriptor in it has a wrong length", section);
                break;
            }
            let (one, after) = rest.split_at(length);
            expected += configuration.add(one, &mut checker);
            rest = after;
        }
        let found: usize = configuration
            .interfaces
            .iter()
            .map(|i| i.endpoints.len())
            .sum();
        checker.expect(
            found == expected,
            "bNumEndpoints is not the number of endpoints",
            section,
        );
        let interfaces = configuration.interfaces.len();
        let named = usize::from(byte(bytes, 4)) == interfaces;
        checker.expect(
            named,
            "bNumInterfaces is not the number of interfaces",
            section,
        );
        self.configuration = configuration;
    }

    /// Parses and checks the BOS descriptor, which lists the device's capabilities.
    pub(super) fn parse_bos(&mut self, bytes: &[u8], now: u64, violations: &mut Violations) {
        let mut checker = Checker { now, violations };
        let section = "BOS descriptor, USB 3.2, 9.6.2";
        checker.expect(byte(bytes, 0) == 5, "its length is not 5", section);
        checker.expect(byte(bytes, 1) == kind::BOS, "its type is not 15", section);
        let total = usize::from(word(bytes, 2));
        checker.expect(
            total == bytes.len(),
            "wTotalLength is not its length",
            section,
        );
        let mut capabilities = 0;
        let mut rest = bytes.get(5..).unwrap_or_default();
        while rest.len() >= 3 {
            let length = usize::from(byte(rest, 0)).clamp(1, rest.len());
            let is_capability = byte(rest, 1) == kind::DEVICE_CAPABILITY;
            checker.expect(is_capability, "it contains another descriptor", section);
            capabilities += 1;
            rest = &rest[length..];
        }
        let named = byte(bytes, 4) == capabilities;
        checker.expect(named, "bNumDeviceCaps is not their number", section);
        self.capabilities = Some(capabilities);
    }

    /// Finds the control interface and the endpoints of the serial port; `None` if the device has no serial
    /// port.
    pub(super) fn find_serial_port(
        &self,
        now: u64,
        violations: &mut Violations,
    ) -> Option<SerialPort> {
        let mut checker = Checker { now, violations };
        let section = "CDC 1.2, 3.4 and 5.2";
        let interfaces = &self.configuration.interfaces;
        let control = interfaces.iter().find(|i| i.class[..2] == COMMUNICATIONS)?;
        let data = interfaces.iter().find(|i| i.class[0] == DATA)?;
        // Subtypes: header, abstract control management, union.
        for subtype in [0x00, 0x02, 0x06] {
            let what = format!("no functional descriptor {subtype:#04x}");
            checker.expect(control.functions.contains(&subtype), &what, section);
        }
        let header_first = control.functions.first() == Some(&0);
        checker.expect(
            header_first,
            "the header is not the first functional descriptor",
            section,
        );
        let find = |interface: &Interface, attributes: u8, is_in: bool| {
            let fits = |e: &&EndpointDescriptor| {
                e.attributes & 3 == attributes && (e.address & 0x80 != 0) == is_in
            };
            interface.endpoints.iter().find(fits).copied()
        };
        Some(SerialPort {
            control_interface: control.number,
            input: find(data, 2, true)?,
            output: find(data, 2, false)?,
            notification: find(control, 3, true)?,
        })
    }
}

impl Configuration {
    /// Adds a descriptor. If it is an interface descriptor, returns the number of endpoints that it
    /// declares, otherwise 0.
    fn add(&mut self, bytes: &[u8], checker: &mut Checker<'_>) -> usize {
        match byte(bytes, 1) {
            kind::INTERFACE => {
                let section = "interface descriptor, USB 2.0, 9.6.5";
                checker.expect(bytes.len() == 9, "its length is not 9", section);
                let number = byte(bytes, 2);
                let next = usize::from(number) == self.interfaces.len();
                checker.expect(
                    next || byte(bytes, 3) != 0,
                    "its number is not the next one",
                    section,
                );
                if byte(bytes, 3) == 0 {
                    self.interfaces.push(Interface {
                        number,
                        class: [byte(bytes, 5), byte(bytes, 6), byte(bytes, 7)],
                        ..Interface::default()
                    });
                }
                usize::from(byte(bytes, 4))
            }
            kind::ENDPOINT => {
                let endpoint = EndpointDescriptor {
                    address: byte(bytes, 2),
                    attributes: byte(bytes, 3),
                    max_packet: word(bytes, 4),
                    interval: byte(bytes, 6),
                };
                let section = "endpoint descriptor, USB 2.0, 9.6.6";
                checker.expect(bytes.len() == 7, "its length is not 7", section);
                let numbered = endpoint.address & 0x70 == 0 && endpoint.address & 0xF != 0;
                checker.expect(numbered, "bEndpointAddress", section);
                let sized = match endpoint.attributes & 3 {
                    2 => [8, 16, 32, 64].contains(&endpoint.max_packet),
                    3 => (1..=64).contains(&endpoint.max_packet) && endpoint.interval > 0,
                    _ => false,
                };
                checker.expect(sized, "its packet size or interval at full speed", section);
                let all = self.interfaces.iter().flat_map(|i| &i.endpoints);
                let is_new = all.into_iter().all(|e| e.address != endpoint.address);
                checker.expect(is_new, "its address is taken", section);
                match self.interfaces.last_mut() {
                    Some(interface) => interface.endpoints.push(endpoint),
                    None => checker.expect(false, "it comes before any interface", section),
                }
                0
            }
            kind::CLASS_INTERFACE => {
                if let Some(interface) = self.interfaces.last_mut() {
                    interface.functions.push(byte(bytes, 2));
                }
                0
            }
            _ => 0,
        }
    }
}

/// Parses and checks a string descriptor.
pub(super) fn parse_string(bytes: &[u8], now: u64, violations: &mut Violations) -> String {
    let mut checker = Checker { now, violations };
    let section = "string descriptor, USB 2.0, 9.6.7";
    let length = usize::from(byte(bytes, 0));
    checker.expect(length == bytes.len() && length >= 2, "its length", section);
    checker.expect(length.is_multiple_of(2), "its length is odd", section);
    checker.expect(byte(bytes, 1) == kind::STRING, "its type is not 3", section);
    let (units, _) = bytes.get(2..).unwrap_or_default().as_chunks::<2>();
    let units = units.iter();
    let units: Vec<u16> = units.map(|unit| word(unit, 0)).collect();
    String::from_utf16_lossy(&units)
}
