//! What reaches the core from the USB bus: VBUS, resets, suspend and packets.

use super::Core;
use crate::usb::endpoint::{Handshake, Input};
use crate::usb::fifo::{PacketStatus, RxFifo};
use crate::usb::register::{bit, dctl, epctl, epint, gintsts};

/// Number of words that must stay free in the receive FIFO, for status words without data.
const RESERVED_WORDS: usize = 2;
/// Values of `bmRequestType` and `bRequest` in a SET_ADDRESS request (USB 2.0, 9.4).
const SET_ADDRESS: [u8; 2] = [0x00, 0x05];

impl Core {
    /// Returns whether the B-session is valid: VBUS is present, or software overrides it.
    pub(super) fn session_valid(&self) -> bool {
        let control = self.registers.gotgctl;
        if control & bit::BVALOEN != 0 {
            control & bit::BVALOVAL != 0
        } else {
            self.bus.vbus && self.registers.gccfg & bit::VBDEN != 0
        }
    }

    /// Sets the flag for a session's start or end; `before` is true if a session was valid before
    /// the change.
    pub(super) fn session_changed(&mut self, before: bool) {
        match (before, self.session_valid()) {
            (false, true) => self.registers.gintsts |= gintsts::SRQINT,
            (true, false) => self.registers.gotgint |= bit::SEDET,
            _ => {}
        }
    }

    /// Sets whether VBUS is present, which can start or end a session.
    pub(crate) fn set_vbus(&mut self, on: bool) {
        let before = self.session_valid();
        self.bus.vbus = on;
        self.session_changed(before);
    }

    /// Returns whether the pull-up on D+, which shows the device to the host, is on.
    pub(crate) fn is_attached(&self) -> bool {
        self.supply.clocked
            && self.supply.unwired.is_none()
            && self.registers.gccfg & bit::PWRDWN != 0
            && self.registers.dctl & dctl::SDIS == 0
            && self.session_valid()
    }

    /// Returns whether the bus is idle: the device is attached and not suspended, and the host
    /// sends neither frames nor a reset.
    pub(crate) fn is_idle(&self) -> bool {
        self.is_attached()
            && self.bus.frames_from.is_none()
            && !self.bus.in_reset
            && !self.bus.suspended
    }

    /// Lets the host start or stop sending frames; the frame numbers continue from the last one.
    pub(crate) fn set_frames(&mut self, on: bool) {
        self.bus.first_frame = u64::from(self.frame());
        self.bus.frames_from = on.then_some(self.now);
        if on {
            self.sof_cleared = self.sof_cleared.max(self.now.saturating_sub(1));
            self.eopf_cleared = self.eopf_cleared.max(self.now.saturating_sub(1));
            self.bus.suspended = false;
        }
    }

    /// Suspends the device; the host model calls this when the bus has been idle for 3 ms.
    pub(crate) fn suspend(&mut self) {
        if self.is_attached() && !self.bus.suspended {
            self.bus.suspended = true;
            self.registers.gintsts |= gintsts::ESUSP | gintsts::USBSUSP;
        }
    }

    /// Resumes a suspended device and sets `WKUPINT`.
    pub(crate) fn resume(&mut self) {
        if self.bus.suspended {
            self.bus.suspended = false;
            self.registers.gintsts |= gintsts::WKUPINT;
        }
    }

    /// Starts a bus reset, which deactivates all endpoints but endpoint 0, and sets `USBRST`.
    pub(crate) fn start_reset(&mut self) {
        self.bus.in_reset = true;
        self.bus.suspended = false;
        self.bus.addressing = false;
        self.bus.in_setup_stage = false;
        for endpoint in &mut self.inputs {
            endpoint.registers.bus_reset();
        }
        for endpoint in &mut self.outputs {
            endpoint.bus_reset();
        }
        self.registers.dctl &= !dctl::RWUSIG;
        if self.is_attached() {
            self.registers.gintsts |= gintsts::USBRST;
        }
    }

    /// Ends the bus reset and sets `ENUMDNE`, because the speed of the bus is then known.
    pub(crate) fn end_reset(&mut self) {
        self.bus.in_reset = false;
        if self.is_attached() {
            self.registers.gintsts |= gintsts::ENUMDNE;
        }
    }

    /// Returns whether the device reacts to tokens that the host sends to `address`.
    fn accepts(&self, address: u8) -> bool {
        self.is_attached()
            && !self.bus.in_reset
            && !self.bus.suspended
            && u32::from(address) == self.bus.address
    }

    /// Receives a SETUP packet for endpoint 0, which the device must accept at any time.
    pub(crate) fn setup(&mut self, address: u8, bytes: [u8; 8]) -> Handshake {
        if !self.accepts(address) || !self.has_room(bytes.len()) {
            return Handshake::Silent;
        }
        self.bus.addressing = bytes[..2] == SET_ADDRESS;
        self.bus.in_setup_stage = true;
        self.inputs[0].registers.on_setup();
        self.outputs[0].on_setup();
        let frame = self.frame();
        self.rx.push(PacketStatus::SetupData, 0, false, frame, &bytes);
        Handshake::Ack
    }

    fn has_room(&self, bytes: usize) -> bool {
        let words = RxFifo::words_for(bytes) + RESERVED_WORDS;
        self.rx.len() + words <= self.registers.rx_depth as usize
    }

    /// At the first token after a SETUP packet, appends the status word for the end of the setup
    /// stage to the receive FIFO.
    fn end_setup_stage(&mut self, endpoint: usize) {
        if endpoint == 0 && self.bus.in_setup_stage {
            self.bus.in_setup_stage = false;
            let frame = self.frame();
            self.rx.push(PacketStatus::SetupDone, 0, false, frame, &[]);
        }
    }

    /// Returns whether the device would respond to an OUT packet of `len` bytes with anything but
    /// NAK.
    pub(crate) fn answers_out(&self, endpoint: usize, len: usize) -> bool {
        let output = &self.outputs[endpoint];
        endpoint == 0 && self.bus.in_setup_stage
            || output.has(epctl::STALL)
            || output.accepts_data()
                && self.registers.dctl & dctl::GONSTS == 0
                && self.has_room(len)
    }

    /// Receives an OUT packet; `data1` is true if its data PID is DATA1.
    pub(crate) fn output(
        &mut self,
        address: u8,
        endpoint: usize,
        data1: bool,
        bytes: &[u8],
    ) -> Handshake {
        if !self.accepts(address) || !self.outputs[endpoint].has(epctl::USBAEP) {
            return Handshake::Silent;
        }
        let fresh_setup = endpoint == 0 && self.bus.in_setup_stage;
        self.end_setup_stage(endpoint);
        let output = &mut self.outputs[endpoint];
        if output.has(epctl::STALL) {
            return Handshake::Stall;
        }
        let refuses = !output.accepts_data() || self.registers.dctl & dctl::GONSTS != 0;
        if fresh_setup || refuses || !self.has_room(bytes.len()) {
            if !self.outputs[endpoint].has(epctl::EPENA) {
                self.outputs[endpoint].flags |= epint::OTEPDIS;
            }
            return Handshake::Nak;
        }
        let output = &mut self.outputs[endpoint];
        if bytes.len() > output.max_packet() {
            return Handshake::Silent;
        }
        if !output.expects(data1) {
            return Handshake::Ack;
        }
        let done = output.accept(bytes.len());
        let frame = self.frame();
        self.rx.push(PacketStatus::OutData, endpoint, data1, frame, bytes);
        if done {
            self.rx.push(PacketStatus::OutDone, endpoint, data1, frame, &[]);
        }
        Handshake::Ack
    }

    /// Returns whether the device would respond to an IN token with anything but NAK.
    pub(crate) fn answers_in(&self, endpoint: usize) -> bool {
        endpoint == 0 && self.bus.in_setup_stage
            || self.inputs[endpoint].answers() && self.registers.dctl & dctl::GINSTS == 0
    }

    /// Returns the length in bytes of the packet that the next IN token fetches.
    pub(crate) fn next_in_len(&self, endpoint: usize) -> usize {
        self.inputs[endpoint].next_len()
    }

    /// Receives an IN token and returns the response. If the response is a packet, the host counts
    /// as having acknowledged it.
    pub(crate) fn input(&mut self, address: u8, endpoint: usize) -> Input {
        if !self.accepts(address) || !self.inputs[endpoint].registers.has(epctl::USBAEP) {
            return Input::Silent;
        }
        self.end_setup_stage(endpoint);
        if self.registers.dctl & dctl::GINSTS != 0 {
            return Input::Nak;
        }
        let response = self.inputs[endpoint].on_in_token();
        if let Input::Packet { bytes, .. } = &response
            && endpoint == 0
            && self.bus.addressing
            && bytes.is_empty()
        {
            self.bus.addressing = false;
            self.bus.address = self.registers.dcfg >> 4 & 0x7F;
        }
        response
    }

    /// Returns whether the device asks the host to wake up the bus (remote wake-up).
    pub(crate) fn signals_wakeup(&self) -> bool {
        self.bus.suspended && self.registers.dctl & dctl::RWUSIG != 0
    }
}
