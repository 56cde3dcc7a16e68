//! Tests what the host reports about a device that breaks a rule, and how the host treats short
//! packets. Tests with firmware images cannot show this, because the images follow the rules.

use rigless::soc::Width;

use super::control::{Outcome, Setup, Wire};
use super::enumeration::Next;
use super::serial::Pipe;
use super::*;
use crate::usb::core::Supply;
use crate::usb::instance::H743_USB2;
use crate::usb::register::epctl::{CNAK, EPENA, SD0PID, USBAEP};

const DEVICE: [u8; 18] = [18, 1, 0x10, 2, 0xEF, 2, 1, 64, 9, 0x12, 1, 0, 0, 1, 0, 1, 0, 1];
const CONFIGURATION: [u8; 62] = [
    9, 2, 62, 0, 2, 1, 0, 0x80, 50, //
    9, 4, 0, 0, 1, 2, 2, 0, 0, //
    5, 0x24, 0, 0x10, 1, 4, 0x24, 2, 2, 5, 0x24, 6, 0, 1, //
    7, 5, 0x81, 3, 8, 0, 255, //
    9, 4, 1, 0, 2, 0x0A, 0, 0, 0, //
    7, 5, 1, 2, 64, 0, 0, //
    7, 5, 0x82, 2, 64, 0, 0,
];

/// A core that a driver has configured and connected, with bulk endpoint 2 IN, and the violations
/// that a test provokes.
struct Device {
    core: Core,
    violations: Violations,
}

impl Device {
    fn new() -> Self {
        let mut core = Core::new(&H743_USB2);
        core.supply = Supply { clocked: true, ..Supply::default() };
        core.set_vbus(true);
        for (offset, value) in [
            // Select device mode, switch the transceiver on, mark the session as valid, select full
            // speed, and connect; then set the layout of the FIFOs.
            (0x0C, 1 << 30 | 6 << 10),
            (0x38, 1 << 16),
            (0x00, 3 << 6),
            (0x800, 3),
            (0x804, 0),
            (0x24, 64),
            (0x28, 16 << 16 | 64),
            (0x108, 0x0010_0060),
            (0x940, USBAEP | 2 << 18 | 2 << 22 | SD0PID | 64),
        ] {
            core.write(offset, Width::W32, value);
        }
        let violations = Violations::default();
        Self { core, violations }
    }

    fn wire(&mut self) -> Wire<'_> {
        Wire { core: &mut self.core, address: 0, now: 0, violations: &mut self.violations }
    }

    /// Enables the IN endpoint `endpoint`, sets further `bits` of its control register, and writes
    /// a packet to its FIFO.
    fn load(&mut self, endpoint: u64, bits: u32, packet: &[u8]) {
        let (control, size) = (0x900 + 0x20 * endpoint, packet.len());
        let size = u32::try_from(size).expect("a short packet");
        let core = &mut self.core;
        core.write(control + 0x10, Width::W32, 1 << 19 | size);
        let before = core.read(control, Width::W32);
        core.write(control, Width::W32, before | bits | CNAK | EPENA);
        for chunk in packet.chunks(4) {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            let fifo = 0x1000 * (endpoint + 1);
            core.write(fifo, Width::W32, u32::from_le_bytes(word));
        }
    }
}

#[track_caller]
fn assert_reports(violations: &Violations, part: &str) {
    let found = violations.to_vec();
    assert!(found.iter().any(|v| v.text.contains(part)), "{found:?}");
}

#[test]
fn a_program_receives_a_full_packet_only_after_a_short_one() {
    let mut device = Device::new();
    let mut descriptors = Descriptors::default();
    descriptors.parse_configuration(&CONFIGURATION, 0, &mut device.violations);
    let port = descriptors.find_serial_port(0, &mut device.violations);
    assert!(device.violations.to_vec().is_empty(), "of the descriptors");
    let mut serial = Serial::default();
    serial.connect(port.expect("a serial port"));
    serial.wanted = true;
    while serial.next_request().is_some() {
        serial.complete_request(&[], 0, &mut device.violations);
    }
    for (packet, received) in [(&[7; 64][..], 0), (&[], 64)] {
        device.load(2, 0, packet);
        serial.perform(Pipe::Input, &mut device.wire());
        assert_eq!(serial.received.len(), received);
    }
}

#[test]
fn a_device_that_does_not_respond_is_enumerated_three_times() {
    let (mut core, mut host, mut now) = (Device::new().core, Host::default(), 0);
    host.commands.push_back(Command::Plug);
    while let Some(next) = host.step(now, &mut core) {
        now = next.max(now + 1);
        core.set_now(now);
    }
    let enumeration = host.violations.to_vec();
    let mut timeouts = enumeration.iter();
    let timeout = timeouts.find(|v| v.text.contains("timeout: request 80 06 value 0100"));
    assert_eq!(timeout.map(|v| v.count), Some(3), "{enumeration:?}");
    assert_eq!(host.state(), State::Attached);
}

#[test]
fn faults_of_descriptors_are_reported() {
    for (place, value, named) in [
        (2, 70, "wTotalLength is not its length (configuration descriptor"),
        (59, 65, "its packet size or interval at full speed"),
    ] {
        let (mut bytes, mut violations) = (CONFIGURATION, Violations::default());
        bytes[place] = value;
        Descriptors::default().parse_configuration(&bytes, 0, &mut violations);
        assert_reports(&violations, named);
    }
}

#[test]
fn a_device_that_states_usb_2_1_without_a_bos_descriptor_is_reported() {
    let (mut enumeration, mut violations) = (Enumeration::new(), Violations::default());
    for answer in [&DEVICE[..], &[], &DEVICE[..8], &DEVICE] {
        enumeration.on_response(answer, 0, &mut violations);
    }
    assert_eq!(enumeration.on_stall(), Next::Request, "to the qualifier");
    assert_eq!(enumeration.on_response(&[], 0, &mut violations), Next::Request);
    assert_reports(&violations, "the BOS descriptor has 0 bytes");
}

#[test]
fn a_data_stage_that_starts_with_data0_is_reported() {
    let mut device = Device::new();
    let setup = Setup { request_type: 0x80, request: 6, value: 0x0100, index: 0, length: 18 };
    let mut transfer = Transfer::new(setup, 64, Vec::new(), 0);
    assert_eq!(transfer.perform(&mut device.wire()), Outcome::Pending);
    device.load(0, SD0PID, &DEVICE);
    assert_eq!(transfer.perform(&mut device.wire()), Outcome::Pending);
    assert_reports(&device.violations, "wrong data toggle (USB 2.0, 8.5.3)");
}
