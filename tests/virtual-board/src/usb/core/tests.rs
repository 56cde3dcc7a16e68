use super::*;
use crate::usb::endpoint::Handshake;
use crate::usb::instance::H743_USB2;
use crate::usb::register::epctl;

const GAHBCFG: u64 = 0x08;
const GUSBCFG: u64 = 0x0C;
const GRSTCTL: u64 = 0x10;
const GINTSTS: u64 = 0x14;
const GINTMSK: u64 = 0x18;
const GRXSTSP: u64 = 0x20;
const GRXFSIZ: u64 = 0x24;
const GCCFG: u64 = 0x38;
const DCFG: u64 = 0x800;
const DCTL: u64 = 0x804;
const FIFO_2: u64 = 0x3000;

const fn dieptxf(n: u64) -> u64 {
    0x100 + 4 * n
}
const fn diepctl(n: u64) -> u64 {
    0x900 + 0x20 * n
}
const fn dieptsiz(n: u64) -> u64 {
    0x910 + 0x20 * n
}
const fn doepctl(n: u64) -> u64 {
    0xB00 + 0x20 * n
}

/// Returns a core that has a clock and VBUS, and whose pins are connected to the cable.
fn supplied() -> Core {
    let mut core = Core::new(&H743_USB2);
    core.supply = Supply { clocked: true, unwired: None, kernel_hz: Some(48_000_000) };
    core.set_vbus(true);
    core
}

impl Core {
    fn put(&mut self, offset: u64, value: u32) {
        self.write(offset, Width::W32, value);
    }

    fn get(&mut self, offset: u64) -> u32 {
        self.read(offset, Width::W32)
    }

    /// Returns the texts of all violations, and removes these from the core.
    fn violation_texts(&mut self) -> Vec<String> {
        let taken = std::mem::take(&mut self.violations).to_vec();
        taken.into_iter().map(|violation| violation.text).collect()
    }

    #[track_caller]
    fn expect_violation(&mut self, part: &str) {
        let texts = self.violation_texts();
        assert!(texts.len() == 1 && texts[0].contains(part), "{texts:?} is not one with {part:?}");
    }
}

/// Enables the endpoint whose control register is at `control`, for one packet of `bytes` bytes.
fn enable(core: &mut Core, control: u64, bytes: u32) {
    core.put(control + 0x10, 1 << 19 | bytes);
    let before = core.get(control);
    core.put(control, before | epctl::CNAK | epctl::EPENA);
}

/// Returns a core that a driver has configured, with the bulk endpoints 1 OUT and 2 IN.
fn configured() -> Core {
    let mut core = supplied();
    core.put(GUSBCFG, 1 << 30 | 6 << 10 | 1 << 6);
    core.put(GCCFG, bit::PWRDWN);
    core.put(0x00, bit::BVALOEN | bit::BVALOVAL);
    core.put(DCFG, 3);
    core.put(GINTMSK, gintsts::RXFLVL | gintsts::USBRST | gintsts::OEPINT);
    core.put(GAHBCFG, bit::GINT);
    core.put(DCTL, 0);
    core.start_reset();
    core.put(GRXFSIZ, 64);
    core.put(0x28, 16 << 16 | 64);
    core.put(dieptxf(2), 0x0010_0050);
    core.end_reset();
    core.set_frames(true);
    core.put(GINTSTS, u32::MAX);
    core.put(diepctl(2), epctl::USBAEP | 2 << 18 | 2 << 22 | 64);
    core.put(doepctl(1), epctl::USBAEP | 2 << 18 | 64);
    assert_eq!(core.violation_texts(), [] as [String; 0]);
    core
}

#[test]
fn a_device_is_attached_after_software_has_connected_it() {
    let mut core = supplied();
    assert!(!core.is_attached(), "out of reset");
    core.put(DCTL, 0);
    assert_eq!(core.violation_texts().len(), 3, "software has configured nothing");
    assert!(configured().is_attached());
}

#[test]
fn connecting_with_a_kernel_clock_other_than_48_mhz_is_reported() {
    let mut core = configured();
    core.put(DCTL, dctl::SDIS);
    core.supply.kernel_hz = Some(48_480_000);
    core.put(DCTL, 0);
    core.expect_violation("48480000 Hz");
}

#[test]
fn accesses_without_a_clock_of_bytes_and_to_reserved_addresses_are_reported() {
    let mut core = supplied();
    core.read(GINTSTS, Width::W8);
    core.expect_violation("not a word");
    core.get(0x30);
    core.expect_violation("reserved");
    core.put(0x3C, 1);
    core.expect_violation("OTG_CID: write to a read-only register");
    core.supply.clocked = false;
    assert_eq!(core.get(GINTSTS), 0);
    core.expect_violation("clock is off");
}

#[test]
fn a_core_soft_reset_takes_time() {
    let mut core = configured();
    core.put(GRSTCTL, grstctl::CSRST);
    assert_ne!(core.get(GRSTCTL) & grstctl::CSRST, 0);
    core.get(GINTSTS);
    core.expect_violation("during the core soft reset");
    core.set_now(SOFT_RESET_NS);
    assert_eq!(core.get(GRSTCTL), grstctl::AHBIDL);
    assert_eq!(core.get(DCTL), dctl::SDIS);
}

#[test]
fn reading_an_empty_receive_fifo_is_reported() {
    let mut core = configured();
    core.get(GRXSTSP);
    core.expect_violation("OTG_GRXSTSP: read while RXFLVL is clear");
    core.get(0x1000);
    core.expect_violation("the receive FIFO is empty");
    core.setup(0, [0; 8]);
    core.get(GRXSTSP);
    core.get(GRXSTSP);
    core.expect_violation("before the packet's data was read");
    core.get(0x1000);
    core.get(0x1000);
    core.input(0, 0);
    core.get(0x1000);
    core.expect_violation("past the end of the packet");
}

#[test]
fn an_out_packet_is_accepted_once_and_its_transfer_is_reported() {
    let mut core = configured();
    enable(&mut core, doepctl(1), 64);
    assert_eq!(core.output(0, 1, false, &[1, 2, 3]), Handshake::Ack);
    assert_eq!(core.output(0, 1, true, &[4]), Handshake::Nak, "the transfer has one packet");
    assert_eq!(core.get(GRXSTSP), 1 | 3 << 4 | 2 << 17);
    assert_eq!(core.get(0x1000), 0x0003_0201);
    assert_ne!(core.peek(Register::Doepctl(1)) & epctl::EPENA, 0);
    assert_eq!(core.get(GRXSTSP), 1 | 3 << 17);
    assert_eq!(core.peek(Register::Doepctl(1)) & epctl::EPENA, 0);
    core.put(doepctl(1), core.peek(Register::Doepctl(1)) | epctl::CNAK);
    assert_eq!(core.output(0, 1, false, &[1, 2, 3]), Handshake::Ack, "repeated");
    assert_eq!(core.get(GINTSTS) & gintsts::RXFLVL, 0, "and dropped");
}

#[test]
fn wrong_writes_to_a_transmit_fifo_are_reported() {
    let mut core = configured();
    core.put(FIFO_2, 1);
    core.expect_violation("FIFO 2: written with no transfer enabled");
    for word in 0..15 {
        core.put(FIFO_2, word);
    }
    core.violation_texts();
    core.put(FIFO_2, 16);
    core.expect_violation("FIFO 2: written while it is full");
    let mut core = configured();
    enable(&mut core, diepctl(2), 4);
    core.put(FIFO_2, 1);
    core.put(FIFO_2, 2);
    core.expect_violation("FIFO 2: written with no transfer enabled that needs the word");
}

#[test]
fn the_next_setup_clears_the_stall_of_endpoint_0() {
    let mut core = configured();
    core.put(doepctl(0), epctl::STALL);
    core.put(doepctl(0), 0);
    assert_ne!(core.get(doepctl(0)) & epctl::STALL, 0, "a write does not clear it");
    core.setup(0, [0; 8]);
    assert_eq!(core.get(doepctl(0)) & epctl::STALL, 0);
}

#[test]
fn enabling_an_endpoint_in_the_wrong_order_is_reported() {
    let mut core = configured();
    core.put(diepctl(2), core.peek(Register::Diepctl(2)) | epctl::EPENA);
    core.expect_violation("OTG_DIEPCTL2: enabled with PKTCNT 0");
    core.put(dieptsiz(2), 1 << 19 | 5);
    core.expect_violation("OTG_DIEPTSIZ2: changed while the endpoint is enabled");
    core.put(diepctl(1), epctl::EPDIS | epctl::SNAK);
    core.expect_violation("OTG_DIEPCTL1: EPDIS of an endpoint that is not enabled");
    core.put(diepctl(1), epctl::SNAK | epctl::CNAK);
    core.expect_violation("CNAK and SNAK at once");
}

#[test]
fn overlapping_fifos_are_reported_when_an_endpoint_is_enabled() {
    let mut core = configured();
    core.put(dieptxf(2), 0x0010_0046);
    enable(&mut core, diepctl(2), 0);
    core.expect_violation("transmit FIFO 2 overlaps transmit FIFO 0");
}

#[test]
fn an_out_endpoint_can_be_disabled_only_after_the_global_nak() {
    let mut core = configured();
    enable(&mut core, doepctl(1), 64);
    core.put(doepctl(1), core.peek(Register::Doepctl(1)) | epctl::SNAK | epctl::EPDIS);
    core.expect_violation("without the global OUT NAK");
    enable(&mut core, doepctl(1), 64);
    core.put(DCTL, dctl::SGONAK);
    assert_eq!(core.get(GINTSTS) & gintsts::GONAKEFF, 0, "not before its report");
    assert_eq!(core.get(GRXSTSP), 1 << 17);
    assert_ne!(core.get(GINTSTS) & gintsts::GONAKEFF, 0);
    core.put(doepctl(1), core.peek(Register::Doepctl(1)) | epctl::SNAK | epctl::EPDIS);
    assert_eq!(core.violation_texts(), [] as [String; 0]);
    assert_ne!(core.peek(Register::Doepint(1)) & epint::EPDISD, 0);
}

#[test]
fn frame_numbers_and_flags_follow_virtual_time() {
    let mut core = configured();
    core.set_now(700_000);
    assert_eq!(core.get(0x808) >> 8, 0);
    assert_eq!(core.get(GINTSTS) & (gintsts::SOF | gintsts::EOPF), 0);
    core.set_now(1_000_000);
    assert_eq!(core.get(0x808) >> 8, 1);
    let flags = core.get(GINTSTS) & (gintsts::SOF | gintsts::EOPF);
    assert_eq!(flags, gintsts::SOF | gintsts::EOPF);
    core.put(GINTSTS, gintsts::SOF);
    assert_eq!(core.get(GINTSTS) & (gintsts::SOF | gintsts::EOPF), gintsts::EOPF);
    assert_eq!(core.next_frame_interrupt(), None, "masked");
    core.put(GINTMSK, gintsts::SOF);
    assert_eq!(core.next_frame_interrupt(), Some(2_000_000));
}

#[test]
fn vbus_is_sensed_unless_it_is_overridden() {
    let mut core = supplied();
    core.put(GCCFG, bit::PWRDWN | bit::VBDEN);
    core.set_vbus(false);
    core.put(GINTSTS, u32::MAX);
    core.set_vbus(true);
    assert_ne!(core.get(GINTSTS) & gintsts::SRQINT, 0);
    core.set_vbus(false);
    assert_eq!(core.get(0x04), bit::SEDET);
    assert_ne!(core.get(GINTSTS) & gintsts::OTGINT, 0);
    core.put(0x00, bit::BVALOEN | bit::BVALOVAL);
    assert_ne!(core.get(0x00) & bit::BSVLD, 0);
}
