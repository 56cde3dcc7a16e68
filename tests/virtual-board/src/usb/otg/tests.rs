use rigless::mcu::Operate;

use super::*;
use crate::chip::h743::H743;
use crate::usb::instance::H743_USB2;

const AHB1ENR: u64 = 0x5802_44D8;
const AHB1RSTR: u64 = 0x5802_4480;
const PWR_CR3: u64 = 0x5802_480C;
const AHB4ENR: u64 = 0x5802_44E0;
const GPIOA: u64 = 0x5802_0000;
const WINDOW: u64 = H743_USB2.window_base;

fn h743() -> (H743, UsbHost) {
    let host = UsbHost::default();
    (H743::new(&host), host)
}

fn put(part: &mut H743, at: u64, address: u64, value: u64) {
    let written = part.write(VirtualNanos(at), address, Width::W32, value);
    written.unwrap();
}

fn get(part: &mut H743, at: u64, address: u64) -> u64 {
    let read = part.read(VirtualNanos(at), address, Width::W32);
    read.unwrap()
}

/// Enables the core's clock, supply and pins at the time `at`, in ns, and connects the device.
fn connect(part: &mut H743, at: u64) {
    put(part, at, AHB1ENR, 1 << 27);
    put(part, at, AHB4ENR, 1);
    put(part, at, PWR_CR3, 1 << 24 | 6);
    put(part, at, GPIOA, 0xABFF_FFFF & !(5 << 22));
    put(part, at, GPIOA + 0x24, 0xAA << 12);
    for (offset, value) in [
        (0x0C, 1 << 30),
        (0x38, 1 << 16),
        (0x00, 0xC0),
        (0x800, 3),
        (0x18, 1 << 11),
        (0x08, 1),
        (0x804, 0),
    ] {
        put(part, at, WINDOW + offset, value);
    }
}

#[test]
fn the_core_responds_only_while_its_clock_is_on() {
    let (mut part, host) = h743();
    assert_eq!(get(&mut part, 0, WINDOW + 0x3C), 0);
    let violations = host.violations();
    assert!(violations[0].text.contains("bus clock is off"), "{violations:?}");
    put(&mut part, 0, AHB1ENR, 1 << 27);
    assert_eq!(get(&mut part, 0, WINDOW + 0x3C), 0x2300);
}

#[test]
fn the_reset_line_in_the_clock_controller_resets_the_core() {
    let (mut part, _) = h743();
    put(&mut part, 0, AHB1ENR, 1 << 27);
    put(&mut part, 0, WINDOW + 0x18, 1 << 12);
    put(&mut part, 0, AHB1RSTR, 1 << 27);
    put(&mut part, 0, AHB1RSTR, 0);
    assert_eq!(get(&mut part, 0, WINDOW + 0x18), 0);
}

/// Returns the interrupts whose level has changed since the last call, with the new level.
fn changes(part: &mut H743) -> Vec<(u16, Level)> {
    let changes = part.drain_interrupts();
    changes.iter().map(|c| (c.interrupt, c.level)).collect()
}

#[test]
fn an_idle_bus_raises_the_interrupt_after_3_ms() {
    let (mut part, host) = h743();
    connect(&mut part, 1_000);
    part.advance_to(VirtualNanos(3_000_999));
    assert!(part.drain_interrupts().is_empty());
    part.advance_to(VirtualNanos(3_001_000));
    assert_eq!(changes(&mut part), [(101, Level::High)]);
    put(&mut part, 3_002_000, WINDOW + 0x14, 1 << 11);
    assert_eq!(changes(&mut part), [(101, Level::Low)]);
    let violations = host.violations();
    assert!(violations.iter().all(|v| v.text.contains("kernel clock")), "{violations:?}");
}
