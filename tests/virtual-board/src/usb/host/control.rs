//! One control transfer: SETUP, data and status (USB 2.0, 8.5.3), with its toggles and its times.

use crate::usb::core::Core;
use crate::usb::response::{Handshake, Input};
use crate::usb::violation::Violations;

/// Attempts at a transaction that the device does not answer (USB 2.0, 10.2.6).
const ATTEMPTS: u32 = 3;
/// How long the host waits for a transfer, ns, as Linux does (`USB_CTRL_GET_TIMEOUT`).
const TIMEOUT_NS: u64 = 5_000_000_000;
/// How long a standard request may take to its next data packet, ns (USB 2.0, 9.2.6.4).
const DATA_NS: u64 = 500_000_000;
/// How long a standard request may take to its status after the last data, ns (USB 2.0, 9.2.6.4).
const STATUS_NS: u64 = 50_000_000;

/// The eight bytes of a SETUP packet (USB 2.0, 9.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Setup {
    pub(super) request_type: u8,
    pub(super) request: u8,
    pub(super) value: u16,
    pub(super) index: u16,
    pub(super) length: u16,
}

impl Setup {
    fn bytes(self) -> [u8; 8] {
        let [value, index, length] = [self.value, self.index, self.length].map(u16::to_le_bytes);
        [
            self.request_type,
            self.request,
            value[0],
            value[1],
            index[0],
            index[1],
            length[0],
            length[1],
        ]
    }

    fn is_in(self) -> bool {
        self.request_type & 0x80 != 0
    }

    fn is_standard(self) -> bool {
        self.request_type & 0x60 == 0
    }
}

impl std::fmt::Display for Setup {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            formatter,
            "request {:02x} {:02x} value {:04x} index {:04x} length {}",
            self.request_type, self.request, self.value, self.index, self.length
        )
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Setup,
    DataIn,
    DataOut,
    StatusIn,
    StatusOut,
}

/// How a transfer stands after a transaction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    Pending,
    /// Ended well, with the data of an IN transfer.
    Done(Vec<u8>),
    /// The device refuses the request.
    Stalled,
    /// The device broke the protocol, or is not there.
    Failed(String),
}

/// A control transfer in progress.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    pub(super) setup: Setup,
    address: u8,
    max_packet: usize,
    stage: Stage,
    /// Data to send, or received.
    data: Vec<u8>,
    sent: usize,
    data1: bool,
    errors: u32,
    started: u64,
    /// When the stage or the last data packet ended, ns.
    progress: u64,
}

impl Transfer {
    /// A transfer to `address`, whose endpoint 0 has packets of `max_packet` bytes; `data` goes out.
    pub(super) fn new(
        setup: Setup,
        address: u8,
        max_packet: usize,
        data: Vec<u8>,
        now: u64,
    ) -> Self {
        debug_assert!(setup.is_in() || data.len() == usize::from(setup.length));
        Self {
            setup,
            address,
            max_packet,
            stage: Stage::Setup,
            data,
            sent: 0,
            data1: true,
            errors: 0,
            started: now,
            progress: now,
        }
    }

    /// When the transfer times out, ns.
    pub(super) fn deadline(&self) -> u64 {
        self.started + TIMEOUT_NS
    }

    /// What the transfer is, and how far it got.
    pub(super) fn describe(&self) -> String {
        format!("{}, {:?} stage", self.setup, self.stage)
    }

    /// Bytes of the next packet on the wire, if the device would not answer it with NAK.
    pub(super) fn next_len(&self, core: &Core) -> Option<usize> {
        match self.stage {
            Stage::Setup => Some(8),
            Stage::DataIn => core.answers_in(0).then(|| core.next_in_len(0)),
            Stage::StatusIn => core.answers_in(0).then_some(0),
            Stage::DataOut => {
                let len = self.chunk().len();
                core.answers_out(0, len).then_some(len)
            }
            Stage::StatusOut => core.answers_out(0, 0).then_some(0),
        }
    }

    fn chunk(&self) -> &[u8] {
        let end = self.data.len().min(self.sent + self.max_packet);
        &self.data[self.sent..end]
    }

    /// Makes the next transaction.
    pub(super) fn perform(
        &mut self,
        now: u64,
        core: &mut Core,
        violations: &mut Violations,
    ) -> Outcome {
        match self.stage {
            Stage::Setup => match core.setup(self.address, self.setup.bytes()) {
                Handshake::Ack => {
                    self.progress = now;
                    self.stage = match (self.setup.length, self.setup.is_in()) {
                        (0, _) => Stage::StatusIn,
                        (_, true) => Stage::DataIn,
                        (_, false) => Stage::DataOut,
                    };
                    Outcome::Pending
                }
                _ => self.no_answer(),
            },
            Stage::DataIn | Stage::StatusIn => match core.input(self.address, 0) {
                Input::Packet { bytes, data1 } => self.received(now, bytes, data1, violations),
                Input::Nak => Outcome::Pending,
                Input::Stall => Outcome::Stalled,
                Input::Silent => self.no_answer(),
            },
            Stage::DataOut => {
                let chunk = self.chunk().to_vec();
                match core.output(self.address, 0, self.data1, &chunk) {
                    Handshake::Ack => {
                        self.check_time(now, DATA_NS, violations);
                        self.data1 = !self.data1;
                        self.sent += chunk.len();
                        if self.sent == self.data.len() {
                            self.stage = Stage::StatusIn;
                        }
                        Outcome::Pending
                    }
                    Handshake::Nak => Outcome::Pending,
                    Handshake::Stall => Outcome::Stalled,
                    Handshake::Silent => self.no_answer(),
                }
            }
            Stage::StatusOut => match core.output(self.address, 0, true, &[]) {
                Handshake::Ack => {
                    self.check_time(now, STATUS_NS, violations);
                    Outcome::Done(std::mem::take(&mut self.data))
                }
                Handshake::Nak => Outcome::Pending,
                Handshake::Stall => Outcome::Stalled,
                Handshake::Silent => self.no_answer(),
            },
        }
    }

    fn no_answer(&mut self) -> Outcome {
        self.errors += 1;
        if self.errors < ATTEMPTS {
            Outcome::Pending
        } else {
            Outcome::Failed(format!("no answer: {}", self.describe()))
        }
    }

    fn received(
        &mut self,
        now: u64,
        bytes: Vec<u8>,
        data1: bool,
        violations: &mut Violations,
    ) -> Outcome {
        if data1 != self.data1 && self.stage == Stage::DataIn
            || self.stage == Stage::StatusIn && !data1
        {
            let text = format!("{}: wrong data toggle (USB 2.0, 8.5.3)", self.describe());
            violations.record(now, text);
            return Outcome::Pending;
        }
        if self.stage == Stage::StatusIn {
            self.check_time(now, STATUS_NS, violations);
            if !bytes.is_empty() {
                return Outcome::Failed(format!("data in the status stage: {}", self.setup));
            }
            return Outcome::Done(Vec::new());
        }
        self.check_time(now, DATA_NS, violations);
        if bytes.len() > self.max_packet {
            return Outcome::Failed(format!("packet of {} bytes: {}", bytes.len(), self.setup));
        }
        self.data1 = !self.data1;
        let is_short = bytes.len() < self.max_packet;
        self.data.extend(bytes);
        let asked = usize::from(self.setup.length);
        if self.data.len() > asked {
            return Outcome::Failed(format!("{} bytes: {}", self.data.len(), self.setup));
        }
        if is_short || self.data.len() == asked {
            self.stage = Stage::StatusOut;
        }
        Outcome::Pending
    }

    /// Checks how long the device took since the last progress.
    fn check_time(&mut self, now: u64, limit: u64, violations: &mut Violations) {
        let took = now - self.progress;
        self.progress = now;
        if self.setup.is_standard() && took > limit {
            let text = format!(
                "{}: took {} ms, more than {} ms (USB 2.0, 9.2.6.4)",
                self.describe(),
                took / 1_000_000,
                limit / 1_000_000
            );
            violations.record(now, text);
        }
    }
}
