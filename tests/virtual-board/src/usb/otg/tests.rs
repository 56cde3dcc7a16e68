use rigless::device::ResetCause;
use rigless::mcu::{Mcu, Operate};
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::otg_fs_global;
use rigless::soc::stm32h743::Stm32h743;
use rigless::soc::stm32h743::generated::otg1_hs_global;

use super::*;
use crate::usb::host::status::State;
use crate::usb::instance::{F446_OTG_FS, H743_USB2};

const AHB1ENR: u64 = 0x5802_44D8;
const AHB1RSTR: u64 = 0x5802_4480;
const PWR_CR3: u64 = 0x5802_480C;
const AHB4ENR: u64 = 0x5802_44E0;
const GPIOA: u64 = 0x5802_0000;
const WINDOW: u64 = H743_USB2.window_base;

/// The emulator's part extended with the USB core, as in the models of the boards' chips.
#[derive(Debug)]
struct Wrapped<M> {
    part: M,
    otg: Otg,
}

impl<M: Mcu> Wrapped<M> {
    fn new<L: Layout + Send + 'static>(
        mut part: M,
        instance: &'static Instance,
    ) -> (Self, UsbHost) {
        let host = UsbHost::new();
        let otg = Otg::new::<L>(instance, &host, part.bus_mut()).unwrap();
        (Self { part, otg }, host)
    }

    fn put(&mut self, at: u64, address: u64, value: u64) {
        self.write(VirtualNanos(at), address, Width::W32, value)
            .unwrap();
    }

    fn get(&mut self, at: u64, address: u64) -> u64 {
        self.read(VirtualNanos(at), address, Width::W32).unwrap()
    }
}

impl<M: Mcu> Mcu for Wrapped<M> {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        self.otg.reset();
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.part.poll(now);
        self.otg.poll(now, self.part.bus_mut());
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let (bus, model) = self.part.split(slot);
        match self.otg.model(slot, bus) {
            Some(own) => (bus, Some(own)),
            None => (bus, model),
        }
    }
}

fn h743() -> (Wrapped<Stm32h743>, UsbHost) {
    Wrapped::new::<otg1_hs_global::Register>(Stm32h743::new().unwrap(), &H743_USB2)
}

/// Enables clock, supply and pins at time `at`, in ns, and connects the device.
fn connect(part: &mut Wrapped<Stm32h743>, at: u64) {
    part.put(at, AHB1ENR, 1 << 27);
    part.put(at, AHB4ENR, 1);
    part.put(at, PWR_CR3, 1 << 24 | 6);
    part.put(at, GPIOA, 0xABFF_FFFF & !(5 << 22));
    part.put(at, GPIOA + 0x24, 0xAA << 12);
    for (offset, value) in [
        (0x0C, 1 << 30),
        (0x38, 1 << 16),
        (0x00, 0xC0),
        (0x800, 3),
        (0x18, 1 << 11),
        (0x08, 1),
        (0x804, 0),
    ] {
        part.put(at, WINDOW + offset, value);
    }
}

#[test]
fn every_slot_has_a_model_of_its_layout() {
    let (mut part, _) = h743();
    part.check().unwrap();
}

#[test]
fn the_core_responds_only_while_its_clock_is_on() {
    let (mut part, host) = h743();
    assert_eq!(part.get(0, WINDOW + 0x3C), 0);
    let violations = host.violations();
    assert!(
        violations[0].text.contains("bus clock is off"),
        "{violations:?}"
    );
    part.put(0, AHB1ENR, 1 << 27);
    assert_eq!(part.get(0, WINDOW + 0x3C), 0x2300);
}

#[test]
fn the_reset_line_in_the_clock_controller_resets_the_core() {
    let (mut part, _) = h743();
    part.put(0, AHB1ENR, 1 << 27);
    part.put(0, WINDOW + 0x18, 1 << 12);
    part.put(0, AHB1RSTR, 1 << 27);
    part.put(0, AHB1RSTR, 0);
    assert_eq!(part.get(0, WINDOW + 0x18), 0);
}

/// Returns the interrupts whose level has changed since the last call.
fn changes(part: &mut Wrapped<Stm32h743>) -> Vec<(u16, Level)> {
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
    part.put(3_002_000, WINDOW + 0x14, 1 << 11);
    assert_eq!(changes(&mut part), [(101, Level::Low)]);
    let violations = host.violations();
    assert!(
        violations.iter().all(|v| v.text.contains("kernel clock")),
        "{violations:?}"
    );
}

#[test]
fn a_system_reset_takes_the_device_off_the_bus() {
    let (mut part, host) = h743();
    connect(&mut part, 0);
    host.plug();
    part.poll(VirtualNanos(10));
    assert_eq!(host.state(), State::Attached);
    part.reset(VirtualNanos(20), ResetCause::Core);
    part.poll(VirtualNanos(30));
    assert_eq!(host.state(), State::Detached);
    connect(&mut part, 40);
    part.poll(VirtualNanos(50));
    assert_eq!(host.state(), State::Attached);
}

#[test]
fn the_stm32f427_accepts_the_core_of_the_stm32f446() {
    let part = Stm32f427::new().unwrap();
    let (mut part, _) = Wrapped::new::<otg_fs_global::Register>(part, &F446_OTG_FS);
    part.check().unwrap();
    part.put(0, 0x4002_3834, 1 << 7);
    assert_eq!(part.get(0, F446_OTG_FS.window_base + 0x3C), 0x2000);
    assert_eq!(part.otg.redirect().from, 0x5000_0000..0x5004_0000);
}
