//! Control transfers with their SETUP, data and status stages (USB 2.0, 8.5.3), whose data toggles
//! and response times are checked.

use crate::usb::core::Core;
use crate::usb::endpoint::{Handshake, Input};
use crate::usb::violation::Violations;

/// Number of transactions without response after which a transfer fails (USB 2.0, 10.2.6).
const ATTEMPTS: u32 = 3;
/// Time limit for a control transfer in ns, as in Linux (`USB_CTRL_GET_TIMEOUT`).
const TIMEOUT_NS: u64 = 5_000_000_000;
/// Longest permitted time in ns to the next data packet of a standard request (USB 2.0, 9.2.6.4).
const DATA_NS: u64 = 500_000_000;
/// Longest permitted time in ns from the last data packet of a standard request to the end of the
/// request's status stage (USB 2.0, 9.2.6.4).
const STATUS_NS: u64 = 50_000_000;

/// What a transaction needs: the device's core, its address, and where to record violations.
#[derive(Debug)]
pub(super) struct Wire<'a> {
    pub(super) core: &'a mut Core,
    /// USB address of the device.
    pub(super) address: u8,
    /// Virtual time of the transaction, in ns.
    pub(super) now: u64,
    pub(super) violations: &'a mut Violations,
}

/// The request in a SETUP packet (USB 2.0, 9.3).
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

/// State of a control transfer after one of its transactions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    Pending,
    /// The transfer has succeeded; holds the data that the device has sent, if any.
    Done(Vec<u8>),
    /// The device has rejected the request with STALL.
    Stalled,
    /// The device has violated the protocol or does not respond; holds the reason.
    Failed(String),
}

/// A control transfer in progress.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    pub(super) setup: Setup,
    max_packet: usize,
    stage: Stage,
    /// Data to send in an OUT transfer, or data received so far in an IN transfer.
    data: Vec<u8>,
    sent: usize,
    data1: bool,
    errors: u32,
    started: u64,
    /// Time in ns at which the last stage or data packet ended.
    progress: u64,
}

impl Transfer {
    /// Creates a transfer with packets of at most `max_packet` bytes; `data` is what an OUT
    /// transfer sends in its data stage.
    pub(super) fn new(setup: Setup, max_packet: usize, data: Vec<u8>, now: u64) -> Self {
        debug_assert!(setup.is_in() || data.len() == usize::from(setup.length));
        Self {
            setup,
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

    /// Returns the time in ns at which the transfer fails if it has not ended.
    pub(super) fn deadline(&self) -> u64 {
        self.started + TIMEOUT_NS
    }

    /// Describes the request and the current stage in words, for error messages.
    pub(super) fn describe(&self) -> String {
        format!("{}, {:?} stage", self.setup, self.stage)
    }

    /// Returns the byte length of the next packet; `None` while the device would respond with NAK.
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

    /// Performs the next transaction, and returns the state of the transfer afterwards.
    pub(super) fn perform(&mut self, wire: &mut Wire<'_>) -> Outcome {
        let address = wire.address;
        let handshake = match self.stage {
            Stage::Setup => wire.core.setup(address, self.setup.bytes()),
            Stage::DataIn | Stage::StatusIn => {
                return match wire.core.input(address, 0) {
                    Input::Packet { bytes, data1 } => self.received(bytes, data1, wire),
                    Input::Nak => Outcome::Pending,
                    Input::Stall => Outcome::Stalled,
                    Input::Silent => self.no_response(),
                };
            }
            Stage::DataOut => {
                let chunk = self.chunk().to_vec();
                wire.core.output(address, 0, self.data1, &chunk)
            }
            Stage::StatusOut => wire.core.output(address, 0, true, &[]),
        };
        match handshake {
            Handshake::Ack => self.acknowledged(wire),
            Handshake::Nak => Outcome::Pending,
            Handshake::Stall => Outcome::Stalled,
            Handshake::Silent => self.no_response(),
        }
    }

    /// Advances the transfer after the device has acknowledged a packet.
    fn acknowledged(&mut self, wire: &mut Wire<'_>) -> Outcome {
        match self.stage {
            Stage::Setup => {
                self.progress = wire.now;
                self.stage = match (self.setup.length, self.setup.is_in()) {
                    (0, _) => Stage::StatusIn,
                    (_, true) => Stage::DataIn,
                    (_, false) => Stage::DataOut,
                };
            }
            Stage::DataOut => {
                self.check_time(DATA_NS, wire);
                self.data1 = !self.data1;
                self.sent += self.chunk().len();
                if self.sent == self.data.len() {
                    self.stage = Stage::StatusIn;
                }
            }
            Stage::DataIn | Stage::StatusIn | Stage::StatusOut => {
                self.check_time(STATUS_NS, wire);
                return Outcome::Done(std::mem::take(&mut self.data));
            }
        }
        Outcome::Pending
    }

    fn no_response(&mut self) -> Outcome {
        self.errors += 1;
        if self.errors < ATTEMPTS {
            Outcome::Pending
        } else {
            Outcome::Failed(format!("no response: {}", self.describe()))
        }
    }

    fn received(&mut self, bytes: Vec<u8>, data1: bool, wire: &mut Wire<'_>) -> Outcome {
        if data1 != self.data1 && self.stage == Stage::DataIn
            || self.stage == Stage::StatusIn && !data1
        {
            let text = format!("{}: wrong data toggle (USB 2.0, 8.5.3)", self.describe());
            wire.violations.record(wire.now, text);
            return Outcome::Pending;
        }
        if self.stage == Stage::StatusIn {
            self.check_time(STATUS_NS, wire);
            if !bytes.is_empty() {
                return Outcome::Failed(format!("data in the status stage: {}", self.setup));
            }
            return Outcome::Done(Vec::new());
        }
        self.check_time(DATA_NS, wire);
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

    /// Checks that at most `limit` ns have passed since the last stage or data packet.
    fn check_time(&mut self, limit: u64, wire: &mut Wire<'_>) {
        let took = wire.now - self.progress;
        self.progress = wire.now;
        if self.setup.is_standard() && took > limit {
            let text = format!(
                "{}: took {} ms, more than {} ms (USB 2.0, 9.2.6.4)",
                self.describe(),
                took / 1_000_000,
                limit / 1_000_000
            );
            wire.violations.record(wire.now, text);
        }
    }
}
