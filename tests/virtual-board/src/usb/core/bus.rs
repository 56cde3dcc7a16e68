//! The core as the bus sees it: its pull-up, resets, suspend and tokens.

use super::Core;
use crate::usb::endpoint::Reply;
use crate::usb::fifo::{PacketStatus, RxFifo};
use crate::usb::register::{bit, dctl, epctl, epint, gintsts};
use crate::usb::response::{Handshake, Input};

/// Words the receive FIFO keeps free for reports without data.
const RESERVED_WORDS: usize = 2;
/// `bmRequestType` and `bRequest` of SET_ADDRESS (USB 2.0, 9.4).
const SET_ADDRESS: [u8; 2] = [0x00, 0x05];

impl Core {
    /// Whether the B-session is valid: VBUS, or what overrides it.
    pub(super) fn session_valid(&self) -> bool {
        let control = self.registers.gotgctl;
        if control & bit::BVALOEN != 0 {
            control & bit::BVALOVAL != 0
        } else {
            self.line.vbus && self.registers.gccfg & bit::VBDEN != 0
        }
    }

    /// Reports a session that has begun or ended, if it was `before`.
    pub(super) fn session_changed(&mut self, before: bool) {
        match (before, self.session_valid()) {
            (false, true) => self.registers.gintsts |= gintsts::SRQINT,
            (true, false) => self.registers.gotgint |= bit::SEDET,
            _ => {}
        }
    }

    /// VBUS has come or gone.
    pub(crate) fn set_vbus(&mut self, on: bool) {
        let before = self.session_valid();
        self.line.vbus = on;
        self.session_changed(before);
    }

    /// Whether the pull-up on D+ is on.
    pub(crate) fn is_attached(&self) -> bool {
        self.supply.clocked
            && self.supply.unwired.is_none()
            && self.registers.gccfg & bit::PWRDWN != 0
            && self.registers.dctl & dctl::SDIS == 0
            && self.session_valid()
    }

    /// Whether the device keeps the bus idle: attached, and the host neither sends frames nor resets it.
    pub(crate) fn is_idle(&self) -> bool {
        self.is_attached()
            && self.line.frames_from.is_none()
            && !self.line.in_reset
            && !self.line.suspended
    }

    /// The host begins to send frames, or stops.
    pub(crate) fn set_frames(&mut self, on: bool) {
        self.line.first_frame = u64::from(self.frame());
        self.line.frames_from = on.then_some(self.now);
        if on {
            self.sof_cleared = self.sof_cleared.max(self.now.saturating_sub(1));
            self.eopf_cleared = self.eopf_cleared.max(self.now.saturating_sub(1));
            self.line.suspended = false;
        }
    }

    /// The bus has been idle for 3 ms.
    pub(crate) fn suspend(&mut self) {
        if self.is_attached() && !self.line.suspended {
            self.line.suspended = true;
            self.registers.gintsts |= gintsts::ESUSP | gintsts::USBSUSP;
        }
    }

    /// The host signals resume.
    pub(crate) fn resume(&mut self) {
        if self.line.suspended {
            self.line.suspended = false;
            self.registers.gintsts |= gintsts::WKUPINT;
        }
    }

    /// The host begins a bus reset.
    pub(crate) fn begin_reset(&mut self) {
        self.line.in_reset = true;
        self.line.suspended = false;
        self.line.addressing = false;
        self.line.setup_open = false;
        for endpoint in &mut self.inputs {
            endpoint.registers.bus_reset();
        }
        for endpoint in &mut self.outputs {
            endpoint.registers.bus_reset();
        }
        self.registers.dctl &= !dctl::RWUSIG;
        if self.is_attached() {
            self.registers.gintsts |= gintsts::USBRST;
        }
    }

    /// The host ends the bus reset: the speed is known.
    pub(crate) fn end_reset(&mut self) {
        self.line.in_reset = false;
        if self.is_attached() {
            self.registers.gintsts |= gintsts::ENUMDNE;
        }
    }

    /// Whether a token for `address` reaches the device.
    fn accepts(&self, address: u8) -> bool {
        self.is_attached()
            && !self.line.in_reset
            && !self.line.suspended
            && u32::from(address) == self.line.address
    }

    /// A SETUP packet to endpoint 0, which a device never refuses.
    pub(crate) fn setup(&mut self, address: u8, bytes: [u8; 8]) -> Handshake {
        if !self.accepts(address) || !self.has_room(bytes.len()) {
            return Handshake::Silent;
        }
        self.line.addressing = bytes[..2] == SET_ADDRESS;
        self.line.setup_open = true;
        self.inputs[0].setup();
        self.outputs[0].setup();
        let frame = self.frame();
        self.rx
            .push(PacketStatus::SetupData, 0, false, frame, &bytes);
        Handshake::Ack
    }

    fn has_room(&self, bytes: usize) -> bool {
        let words = RxFifo::words_of(bytes) + RESERVED_WORDS;
        self.rx.len() + words <= self.registers.rx_depth as usize
    }

    /// The token that starts the stage after SETUP: the core reports that the setup stage is done.
    fn close_setup(&mut self, endpoint: usize) {
        if endpoint == 0 && self.line.setup_open {
            self.line.setup_open = false;
            let frame = self.frame();
            self.rx.push(PacketStatus::SetupDone, 0, false, frame, &[]);
        }
    }

    /// Whether an OUT packet of `len` bytes would be answered with other than NAK.
    pub(crate) fn answers_out(&self, endpoint: usize, len: usize) -> bool {
        let output = &self.outputs[endpoint];
        endpoint == 0 && self.line.setup_open
            || output.registers.has(epctl::STALL)
            || output.takes() && self.registers.dctl & dctl::GONSTS == 0 && self.has_room(len)
    }

    /// An OUT packet.
    pub(crate) fn output(
        &mut self,
        address: u8,
        endpoint: usize,
        data1: bool,
        bytes: &[u8],
    ) -> Handshake {
        if !self.accepts(address) || !self.outputs[endpoint].registers.has(epctl::USBAEP) {
            return Handshake::Silent;
        }
        let fresh_setup = endpoint == 0 && self.line.setup_open;
        self.close_setup(endpoint);
        let output = &mut self.outputs[endpoint];
        if output.registers.has(epctl::STALL) {
            return Handshake::Stall;
        }
        let refuses = !output.takes() || self.registers.dctl & dctl::GONSTS != 0;
        if fresh_setup || refuses || !self.has_room(bytes.len()) {
            if !self.outputs[endpoint].registers.has(epctl::EPENA) {
                self.outputs[endpoint].registers.flags |= epint::OTEPDIS;
            }
            return Handshake::Nak;
        }
        let output = &mut self.outputs[endpoint];
        if bytes.len() > output.registers.max_packet() {
            return Handshake::Silent;
        }
        if !output.expects(data1) {
            return Handshake::Ack;
        }
        let done = output.take(bytes.len());
        let frame = self.frame();
        self.rx
            .push(PacketStatus::OutData, endpoint, data1, frame, bytes);
        if done {
            self.rx
                .push(PacketStatus::OutDone, endpoint, data1, frame, &[]);
        }
        Handshake::Ack
    }

    /// Whether an IN token would be answered with other than NAK.
    pub(crate) fn answers_in(&self, endpoint: usize) -> bool {
        endpoint == 0 && self.line.setup_open
            || self.inputs[endpoint].answers() && self.registers.dctl & dctl::GINSTS == 0
    }

    /// Bytes of the packet that the next IN token would find.
    pub(crate) fn next_in_len(&self, endpoint: usize) -> usize {
        self.inputs[endpoint].next_len()
    }

    /// An IN token; the host acknowledges a packet it gets.
    pub(crate) fn input(&mut self, address: u8, endpoint: usize) -> Input {
        if !self.accepts(address) || !self.inputs[endpoint].registers.has(epctl::USBAEP) {
            return Input::Silent;
        }
        self.close_setup(endpoint);
        if self.registers.dctl & dctl::GINSTS != 0 {
            return Input::Nak;
        }
        match self.inputs[endpoint].token() {
            Reply::Nak => Input::Nak,
            Reply::Stall => Input::Stall,
            Reply::Packet { bytes, data1 } => {
                if endpoint == 0 && self.line.addressing && bytes.is_empty() {
                    self.line.addressing = false;
                    self.line.address = self.registers.dcfg >> 4 & 0x7F;
                }
                Input::Packet { bytes, data1 }
            }
        }
    }

    /// Whether the device asks the host to resume.
    pub(crate) fn signals_wakeup(&self) -> bool {
        self.line.suspended && self.registers.dctl & dctl::RWUSIG != 0
    }
}
