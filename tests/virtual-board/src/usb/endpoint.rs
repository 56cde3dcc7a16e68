//! Endpoints of the USB core: their registers, transfers and transmit FIFOs.

use std::collections::VecDeque;

use super::register::{epctl, epint};

/// How the device responds to a SETUP or OUT packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Handshake {
    Ack,
    Nak,
    Stall,
    /// No response, for example because the packet has another device's address or the device is
    /// not attached.
    Silent,
}

/// How the device responds to an IN token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    Packet {
        bytes: Vec<u8>,
        /// True if the packet's data PID is DATA1, false if it is DATA0.
        data1: bool,
    },
    Nak,
    Stall,
    /// No response, for example because the token has another device's address or the device is not
    /// attached.
    Silent,
}

/// Registers that an IN endpoint and an OUT endpoint both have.
#[derive(Clone, Debug, Default)]
pub(super) struct Endpoint {
    /// Register `DIEPCTLx` or `DOEPCTLx`, without the bits that always read as 0.
    pub(super) control: u32,
    /// Those flags of `DIEPINTx` or `DOEPINTx` that stay set until software clears them.
    pub(super) flags: u32,
    /// Register `DIEPTSIZx` or `DOEPTSIZx`, which counts the bytes and packets of a transfer.
    pub(super) size: u32,
    number: usize,
}

impl Endpoint {
    pub(super) fn new(number: usize) -> Self {
        Self {
            // Only endpoint 0 is active from the start.
            control: if number == 0 { epctl::USBAEP } else { 0 },
            number,
            ..Self::default()
        }
    }

    pub(super) fn has(&self, bit: u32) -> bool {
        self.control & bit != 0
    }

    fn set(&mut self, bit: u32, on: bool) {
        if on {
            self.control |= bit;
        } else {
            self.control &= !bit;
        }
    }

    /// Returns the maximum packet size in bytes, which endpoint 0 stores as a two-bit code for 64,
    /// 32, 16 or 8.
    pub(super) fn max_packet(&self) -> usize {
        let field = self.control & epctl::MPSIZ;
        if self.number == 0 { 64 >> (field & 3) } else { field as usize }
    }

    /// Returns how many bytes the transfer still has to move.
    pub(super) fn transfer_size(&self) -> u32 {
        self.size & 0x7_FFFF
    }

    /// Returns how many packets the transfer still has to move.
    pub(super) fn packet_count(&self) -> u32 {
        self.size >> 19 & 0x3FF
    }

    fn count_down(&mut self, bytes: usize) {
        let bytes = u32::try_from(bytes).unwrap_or(u32::MAX);
        let left = self.transfer_size().saturating_sub(bytes);
        let packets = self.packet_count().saturating_sub(1);
        self.size = self.size & 0x6000_0000 | packets << 19 | left;
    }

    pub(super) fn is_control(&self) -> bool {
        self.number == 0 || self.control & epctl::EPTYP == 0
    }

    /// Applies a write to the control register; the mask `writable` selects the fields that
    /// software may write in the endpoint's direction. Returns whether the write has enabled the
    /// endpoint. The caller has checked whether the endpoint may be enabled or disabled.
    fn write(&mut self, value: u32, writable: u32) -> bool {
        let (value, writable) = if self.number == 0 {
            let fixed = epctl::USBAEP | epctl::EPTYP | epctl::MPSIZ & !3;
            (value & !epctl::SD1PID, writable & !fixed)
        } else {
            (value, writable)
        };
        // STALL of a control endpoint stays set until the next SETUP packet.
        let stall = epctl::STALL & self.control;
        self.control = self.control & !writable | value & writable;
        if self.is_control() {
            self.control |= stall;
        }
        let enables = value & epctl::EPENA != 0 && !self.has(epctl::EPENA);
        for (bit, field, on) in [
            (epctl::SD0PID, epctl::DPID, false),
            (epctl::SD1PID, epctl::DPID, true),
            (epctl::CNAK, epctl::NAKSTS, false),
            (epctl::SNAK, epctl::NAKSTS, true),
            (epctl::EPENA, epctl::EPENA, true),
        ] {
            if value & bit != 0 {
                self.set(field, on);
            }
        }
        if value & epctl::EPDIS != 0 && self.has(epctl::EPENA) {
            self.set(epctl::EPENA, false);
            self.flags |= epint::EPDISD;
        }
        enables
    }

    /// Applies a bus reset, which deactivates every endpoint but 0. `EPENA` keeps its value, as
    /// driver authors found on real chips (Zephyr pull 99958, TinyUSB pull 2607, NuttX pull 4505).
    pub(super) fn bus_reset(&mut self) {
        if self.number != 0 {
            self.set(epctl::USBAEP, false);
        }
    }
}

/// An IN endpoint and the contents of its transmit FIFO.
#[derive(Clone, Debug)]
pub(super) struct InEndpoint {
    pub(super) registers: Endpoint,
    words: VecDeque<u32>,
    /// Number of words that software has written to the FIFO for the current transfer.
    written: u32,
    /// Number of words that the current transfer needs in all.
    needed: u32,
}

impl InEndpoint {
    pub(super) fn new(number: usize) -> Self {
        Self { registers: Endpoint::new(number), words: VecDeque::new(), written: 0, needed: 0 }
    }

    /// Returns the number of the transmit FIFO that the endpoint uses (`TXFNUM`).
    pub(super) fn fifo(&self) -> usize {
        ((self.registers.control & epctl::TXFNUM) >> 22) as usize
    }

    /// Returns the number of words in the transmit FIFO.
    pub(super) fn words(&self) -> usize {
        self.words.len()
    }

    pub(super) fn flush(&mut self) {
        self.words.clear();
    }

    /// Writes the control register; if this enables a transfer, stores the transfer's length.
    pub(super) fn write_control(&mut self, value: u32) {
        let fields = epctl::MPSIZ | epctl::USBAEP | epctl::EPTYP | epctl::STALL | epctl::TXFNUM;
        if self.registers.write(value, fields) {
            self.written = 0;
            self.needed = self.registers.transfer_size().div_ceil(4);
        }
        if value & epctl::SNAK != 0 {
            self.registers.flags |= epint::INEPNE;
        }
        if value & epctl::CNAK != 0 {
            self.registers.flags &= !epint::INEPNE;
        }
    }

    /// Appends a word to the transmit FIFO. Returns whether the current transfer needs the word.
    pub(super) fn write_fifo(&mut self, word: u32) -> bool {
        self.words.push_back(word);
        self.written += 1;
        self.registers.has(epctl::EPENA) && self.written <= self.needed
    }

    /// Returns the length in bytes of the next packet to the host.
    pub(super) fn next_len(&self) -> usize {
        (self.registers.transfer_size() as usize).min(self.registers.max_packet())
    }

    /// Returns whether the transmit FIFO contains the whole next packet.
    fn is_loaded(&self) -> bool {
        self.registers.has(epctl::EPENA) && self.words.len() >= self.next_len().div_ceil(4)
    }

    /// Returns whether the endpoint would respond to an IN token with anything but NAK.
    pub(super) fn answers(&self) -> bool {
        self.registers.has(epctl::STALL) || (!self.registers.has(epctl::NAKSTS) && self.is_loaded())
    }

    /// Returns the response to an IN token. If the response is a packet, the host counts as having
    /// acknowledged it.
    pub(super) fn on_in_token(&mut self) -> Input {
        if self.registers.has(epctl::STALL) {
            return Input::Stall;
        }
        if self.registers.has(epctl::NAKSTS) {
            return Input::Nak;
        }
        if !self.is_loaded() {
            self.registers.flags |= epint::ITTXFE;
            return Input::Nak;
        }
        let len = self.next_len();
        let bytes =
            self.words.drain(..len.div_ceil(4)).flat_map(u32::to_le_bytes).take(len).collect();
        let data1 = self.registers.has(epctl::DPID);
        self.registers.set(epctl::DPID, !data1);
        self.registers.count_down(len);
        if self.registers.packet_count() == 0 {
            self.registers.set(epctl::EPENA, false);
            self.registers.flags |= epint::XFRC;
        }
        Input::Packet { bytes, data1 }
    }
}

/// Methods of an OUT endpoint, whose data is in the receive FIFO that all OUT endpoints share.
impl Endpoint {
    pub(super) fn write_control(&mut self, value: u32) {
        let fields = epctl::MPSIZ | epctl::USBAEP | epctl::EPTYP | epctl::STALL | epctl::SNPM;
        self.write(value, fields);
    }

    /// Returns whether the endpoint would accept a packet, provided that the receive FIFO has room.
    ///
    /// Only NAK decides: with FIFO access by the processor, an active endpoint accepts packets even
    /// while `EPENA` is clear. Drivers that never set `EPENA` on endpoint 0, such as embassy's,
    /// rely on this.
    pub(super) fn accepts_data(&self) -> bool {
        !self.has(epctl::NAKSTS)
    }

    /// Returns whether the packet has the expected data PID. If not, the host has repeated a
    /// packet, which the device acknowledges and discards.
    pub(super) fn expects(&self, data1: bool) -> bool {
        self.has(epctl::DPID) == data1
    }

    /// Accepts a packet of `bytes` bytes. Returns whether it completes the transfer; the caller
    /// then appends a status word for this to the receive FIFO.
    pub(super) fn accept(&mut self, bytes: usize) -> bool {
        let data1 = self.has(epctl::DPID);
        self.set(epctl::DPID, !data1);
        self.count_down(bytes);
        let done = self.packet_count() == 0 || bytes < self.max_packet();
        if done {
            self.set(epctl::NAKSTS, true);
        }
        done
    }

    /// Ends the transfer after software has read its completion status from the receive FIFO.
    pub(super) fn complete(&mut self) {
        self.set(epctl::EPENA, false);
        self.flags |= epint::XFRC;
    }

    /// Handles a SETUP packet: clears STALL, sets NAK, and expects DATA1 as the next data PID.
    pub(super) fn on_setup(&mut self) {
        self.set(epctl::DPID, true);
        self.set(epctl::NAKSTS, true);
        self.set(epctl::STALL, false);
        // Count down the SETUP packets that software allows; IN endpoints lack this field.
        let left = (self.size >> 29 & 3).saturating_sub(1);
        self.size = self.size & 0x1FFF_FFFF | left << 29;
    }
}
