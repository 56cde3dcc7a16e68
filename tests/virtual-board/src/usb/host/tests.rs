//! Tests of the host with a device, which consists of a small driver and the model of the core.

mod gadget;

use self::gadget::{Fault, Gadget};
use super::*;
use crate::usb::core::Supply;
use crate::usb::instance::H743_USB2;

const MS: u64 = 1_000_000;

/// A host and a device with a common virtual time; the device consists of the core and its driver.
struct Bench {
    host: Host,
    core: Core,
    gadget: Gadget,
    now: u64,
}

impl Bench {
    fn new(fault: Fault) -> Self {
        let mut core = Core::new(&H743_USB2);
        core.supply = Supply {
            clocked: true,
            ..Supply::default()
        };
        let gadget = Gadget::start(&mut core, fault);
        let mut host = Host::default();
        host.commands.push_back(Command::Plug);
        let now = 0;
        Self {
            host,
            core,
            gadget,
            now,
        }
    }

    fn command(&mut self, command: Command) {
        self.host.commands.push_back(command);
    }

    /// Runs for `ns` of virtual time.
    fn run(&mut self, ns: u64) {
        let end = self.now + ns;
        loop {
            self.core.set_now(self.now);
            self.host.step(self.now, &mut self.core);
            self.gadget.service(&mut self.core);
            let next = self.host.step(self.now, &mut self.core);
            match next.filter(|&at| at < end) {
                Some(at) => self.now = at.max(self.now + 1),
                None => break,
            }
        }
        self.now = end;
    }

    fn violations(&self) -> Vec<String> {
        let all = self.host.violations().to_vec();
        all.into_iter().map(|violation| violation.text).collect()
    }

    /// Returns a bench whose device is configured and whose port is open.
    fn opened() -> Self {
        let mut bench = Self::new(Fault::None);
        bench.run(400 * MS);
        bench.command(Command::Open(true));
        bench.run(50 * MS);
        assert_eq!(bench.host.state(), State::Open);
        bench
    }
}

const NONE: [String; 0] = [];

#[test]
fn the_port_opens_with_its_line_coding_and_dtr_and_closes() {
    let mut bench = Bench::opened();
    assert!(bench.gadget.dtr);
    assert_eq!(bench.gadget.line_coding, [0, 0xC2, 1, 0, 0, 0, 8]);
    bench.command(Command::Open(false));
    bench.run(10 * MS);
    assert!(!bench.gadget.dtr);
    assert_eq!(bench.host.state(), State::Configured);
    assert_eq!(bench.violations(), NONE);
}

#[test]
fn bytes_pass_once_and_in_order_in_both_directions() {
    let mut bench = Bench::opened();
    let bytes: Vec<u8> = (0..1_000_u32).map(|n| n.to_le_bytes()[0]).collect();
    bench.command(Command::Send(bytes.clone()));
    bench.gadget.send(&bytes);
    bench.run(100 * MS);
    assert_eq!(bench.gadget.received, bytes);
    assert_eq!(bench.host.take_received(), bytes);
    assert_eq!(bench.host.take_received(), []);
    assert_eq!(bench.host.serial.packets_in, 16);
    assert_eq!(bench.violations(), NONE);
}

#[test]
fn a_program_receives_a_full_packet_only_after_a_short_one() {
    let mut bench = Bench::opened();
    bench.gadget.ends_transfers = false;
    bench.gadget.send(&[7; 64]);
    bench.run(10 * MS);
    assert_eq!(bench.host.take_received(), []);
    bench.gadget.ends_transfers = true;
    bench.gadget.send(&[8; 64]);
    bench.run(10 * MS);
    let received = bench.host.take_received();
    assert_eq!(
        (received[..64].to_vec(), received.len()),
        (vec![7; 64], 128)
    );
    assert_eq!(bench.host.serial.empty_packets_in, 1);
}

#[test]
fn an_idle_bus_needs_no_events() {
    let mut bench = Bench::opened();
    assert_eq!(bench.host.step(bench.now, &mut bench.core), None);
}

#[test]
fn a_device_that_does_not_respond_is_enumerated_three_times() {
    let mut bench = Bench::new(Fault::Mute);
    bench.run(20_000 * MS);
    let violations = bench.host.violations().to_vec();
    let [violation] = &violations[..] else {
        panic!("{violations:?}");
    };
    assert_eq!(violation.count, 3);
    let named = violation.text.contains("timeout: request 80 06 value 0100");
    assert!(named, "{violation}");
}

#[test]
fn faults_of_descriptors_and_protocol_are_reported() {
    for (fault, named) in [
        (
            Fault::TotalLength,
            "wTotalLength is not its length (configuration descriptor",
        ),
        (Fault::NoBos, "the BOS descriptor has 0 bytes"),
        (
            Fault::PacketSize,
            "its packet size or interval at full speed",
        ),
        (Fault::Toggle, "wrong data toggle (USB 2.0, 8.5.3)"),
    ] {
        let mut bench = Bench::new(fault);
        bench.run(7_000 * MS);
        let violations = bench.violations();
        assert!(
            violations.iter().any(|v| v.contains(named)),
            "{fault:?}: {violations:?}"
        );
    }
}
