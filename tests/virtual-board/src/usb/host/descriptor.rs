//! Parses and checks the device's descriptors (USB 2.0, 9.6; CDC 1.2, 5.2).

use crate::usb::violation::Violations;

/// Numbers of the descriptor types (USB 2.0, table 9-5; BOS: USB 3.2, table 9-6).
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

/// Class and subclass of a serial port's control interface (CDC 1.2, 4.2).
const COMMUNICATIONS: [u8; 2] = [0x02, 0x02];
/// Class of a serial port's data interface.
const DATA: u8 = 0x0A;

/// The contents of a device's descriptors, as far as the host or a test uses them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Descriptors {
    /// USB identifier of the manufacturer (`idVendor`).
    pub vendor: u16,
    /// Identifier of the product (`idProduct`).
    pub product: u16,
    /// Name of the manufacturer; empty if the device has none.
    pub manufacturer: String,
    /// Name of the product; empty if the device has none.
    pub product_name: String,
    /// Number of capabilities in the BOS descriptor; `None` if the device has no such descriptor.
    pub capabilities: Option<u8>,
    /// USB version in BCD (`bcdUSB`), for example 0x0210 for 2.1.
    pub(super) usb: u16,
    /// Maximum packet size of endpoint 0 in bytes.
    pub(super) max_packet_0: u8,
    /// Indices of the strings for manufacturer, product and serial number; 0 for none.
    pub(super) strings: [u8; 3],
    /// Number by which the host selects the configuration (`bConfigurationValue`).
    pub(super) configuration: u8,
    /// Interfaces of the configuration, each in its alternate setting 0.
    pub(super) interfaces: Vec<Interface>,
}

/// An interface in its alternate setting 0, with the contents of its own descriptor and of the
/// descriptors that belong to it (USB 2.0, 9.6.5).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Interface {
    /// Number of the interface (`bInterfaceNumber`).
    number: u8,
    /// `bInterfaceClass`, `bInterfaceSubClass` and `bInterfaceProtocol`.
    class: [u8; 3],
    /// Endpoints of the interface; endpoint 0 belongs to none.
    endpoints: Vec<EndpointDescriptor>,
    /// Field `bDescriptorSubtype` of each class-specific descriptor.
    functions: Vec<u8>,
}

/// An endpoint, as its descriptor describes it (USB 2.0, 9.6.6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct EndpointDescriptor {
    /// Address of the endpoint (`bEndpointAddress`): its number, and bit 7, which is set for IN.
    pub(super) address: u8,
    /// Type of the endpoint (`bmAttributes`): 2 is bulk, 3 is interrupt.
    attributes: u8,
    /// Maximum packet size in bytes.
    pub(super) max_packet: u16,
}

/// The control interface and the endpoints by which the host uses a serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SerialPort {
    pub(super) control_interface: u8,
    pub(super) input: EndpointDescriptor,
    pub(super) output: EndpointDescriptor,
    pub(super) notification: EndpointDescriptor,
}

fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([byte(bytes, at), byte(bytes, at + 1)])
}

fn byte(bytes: &[u8], at: usize) -> u8 {
    bytes.get(at).copied().unwrap_or_default()
}

impl Descriptors {
    /// Parses the device descriptor, and records each of its violations of the USB specification.
    pub(super) fn parse_device(&mut self, bytes: &[u8], now: u64, violations: &mut Violations) {
        self.usb = word(bytes, 2);
        self.max_packet_0 = byte(bytes, 7);
        self.vendor = word(bytes, 8);
        self.product = word(bytes, 10);
        self.strings = [byte(bytes, 14), byte(bytes, 15), byte(bytes, 16)];
        let is_usb_known = [0x0110, 0x0200, 0x0201, 0x0210].contains(&self.usb);
        let is_size_known = [8, 16, 32, 64].contains(&self.max_packet_0);
        let rules = [
            (bytes.len() == 18 && byte(bytes, 0) == 18, "its length is not 18"),
            (byte(bytes, 1) == kind::DEVICE, "its type is not 1"),
            (is_usb_known, &format!("bcdUSB is {:#06x}", self.usb)),
            (is_size_known, &format!("bMaxPacketSize0 is {}", self.max_packet_0)),
            (byte(bytes, 17) == 1, "it does not have exactly one configuration"),
            (self.vendor != 0, "idVendor is 0"),
        ];
        violations.expect(now, "device descriptor, USB 2.0, 9.6.1", rules);
    }

    /// Parses and checks the configuration descriptor and the descriptors that it contains.
    pub(super) fn parse_configuration(
        &mut self,
        bytes: &[u8],
        now: u64,
        violations: &mut Violations,
    ) {
        let section = "configuration descriptor, USB 2.0, 9.6.3";
        self.configuration = byte(bytes, 5);
        let is_whole = usize::from(word(bytes, 2)) == bytes.len();
        let rules = [
            (byte(bytes, 0) == 9, "its length is not 9"),
            (is_whole, "wTotalLength is not its length"),
            (byte(bytes, 7) & 0x9F == 0x80, "reserved bits of bmAttributes"),
            (self.configuration != 0, "bConfigurationValue is 0"),
            (byte(bytes, 8) <= 250, "more than 500 mA"),
        ];
        violations.expect(now, section, rules);
        self.interfaces.clear();
        let mut rest = bytes.get(9..).unwrap_or_default();
        let mut expected = 0;
        while !rest.is_empty() {
            let length = usize::from(byte(rest, 0));
            if length < 2 || length > rest.len() {
                violations.expect(now, section, [(false, "a descriptor in it has a wrong length")]);
                break;
            }
            let (one, after) = rest.split_at(length);
            expected += self.add(one, now, violations);
            rest = after;
        }
        let interfaces = &self.interfaces;
        let found: usize = interfaces.iter().map(|i| i.endpoints.len()).sum();
        let are_counted = usize::from(byte(bytes, 4)) == interfaces.len();
        let rules = [
            (found == expected, "bNumEndpoints is not the number of endpoints"),
            (are_counted, "bNumInterfaces is not the number of interfaces"),
        ];
        violations.expect(now, section, rules);
    }

    /// Parses and checks the BOS descriptor, which lists the device's capabilities.
    pub(super) fn parse_bos(&mut self, bytes: &[u8], now: u64, violations: &mut Violations) {
        let (mut capabilities, mut are_capabilities) = (0, true);
        let mut rest = bytes.get(5..).unwrap_or_default();
        while rest.len() >= 3 {
            let length = usize::from(byte(rest, 0)).clamp(1, rest.len());
            are_capabilities &= byte(rest, 1) == kind::DEVICE_CAPABILITY;
            capabilities += 1;
            rest = &rest[length..];
        }
        self.capabilities = Some(capabilities);
        let is_whole = usize::from(word(bytes, 2)) == bytes.len();
        let rules = [
            (byte(bytes, 0) == 5, "its length is not 5"),
            (byte(bytes, 1) == kind::BOS, "its type is not 15"),
            (is_whole, "wTotalLength is not its length"),
            (are_capabilities, "it contains another descriptor"),
            (byte(bytes, 4) == capabilities, "bNumDeviceCaps is not their number"),
        ];
        violations.expect(now, "BOS descriptor, USB 3.2, 9.6.2", rules);
    }

    /// Returns the control interface and the endpoints of the serial port; `None` if the device has
    /// no serial port.
    pub(super) fn find_serial_port(
        &self,
        now: u64,
        violations: &mut Violations,
    ) -> Option<SerialPort> {
        let mut interfaces = self.interfaces.iter();
        let control = interfaces.clone().find(|i| i.class[..2] == COMMUNICATIONS)?;
        let data = interfaces.find(|i| i.class[0] == DATA)?;
        let has = |subtype| control.functions.contains(&subtype);
        let is_header_first = control.functions.first() == Some(&0);
        let rules = [
            (has(0x00), "no functional descriptor 0x00, header"),
            (has(0x02), "no functional descriptor 0x02, abstract control management"),
            (has(0x06), "no functional descriptor 0x06, union"),
            (is_header_first, "the header is not the first functional descriptor"),
        ];
        violations.expect(now, "CDC 1.2, 3.4 and 5.2", rules);
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

    /// Adds one of the descriptors that follow the configuration descriptor. Returns the number of
    /// endpoints that an interface descriptor declares; 0 for all others.
    fn add(&mut self, bytes: &[u8], now: u64, violations: &mut Violations) -> usize {
        match byte(bytes, 1) {
            kind::INTERFACE => {
                let (number, is_alternate) = (byte(bytes, 2), byte(bytes, 3) != 0);
                let is_next = usize::from(number) == self.interfaces.len();
                let rules = [
                    (bytes.len() == 9, "its length is not 9"),
                    (is_next || is_alternate, "its number is not the next one"),
                ];
                violations.expect(now, "interface descriptor, USB 2.0, 9.6.5", rules);
                if !is_alternate {
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
                };
                let is_numbered = endpoint.address & 0x70 == 0 && endpoint.address & 0xF != 0;
                let is_sized = match endpoint.attributes & 3 {
                    2 => [8, 16, 32, 64].contains(&endpoint.max_packet),
                    3 => (1..=64).contains(&endpoint.max_packet) && byte(bytes, 6) > 0,
                    _ => false,
                };
                let mut all = self.interfaces.iter().flat_map(|i| &i.endpoints);
                let is_new = all.all(|e| e.address != endpoint.address);
                let rules = [
                    (bytes.len() == 7, "its length is not 7"),
                    (is_numbered, "bEndpointAddress"),
                    (is_sized, "its packet size or interval at full speed"),
                    (is_new, "its address is taken"),
                    (!self.interfaces.is_empty(), "it comes before any interface"),
                ];
                violations.expect(now, "endpoint descriptor, USB 2.0, 9.6.6", rules);
                if let Some(interface) = self.interfaces.last_mut() {
                    interface.endpoints.push(endpoint);
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

/// Checks a string descriptor and returns its text.
pub(super) fn parse_string(bytes: &[u8], now: u64, violations: &mut Violations) -> String {
    let length = usize::from(byte(bytes, 0));
    let rules = [
        (length == bytes.len() && length >= 2, "its length"),
        (length.is_multiple_of(2), "its length is odd"),
        (byte(bytes, 1) == kind::STRING, "its type is not 3"),
    ];
    violations.expect(now, "string descriptor, USB 2.0, 9.6.7", rules);
    let (units, _) = bytes.get(2..).unwrap_or_default().as_chunks::<2>();
    let units: Vec<u16> = units.iter().map(|unit| word(unit, 0)).collect();
    String::from_utf16_lossy(&units)
}
