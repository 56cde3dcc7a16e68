//! Decides which transaction the host performs next; it performs one at a time.

use super::control::{Outcome, Transfer, Wire};
use super::enumeration::Next;
use super::{Host, Phase};
use crate::usb::core::Core;

/// Time that one byte takes at 12 Mbit/s, in ns.
const BYTE_NS: u64 = 667;
/// Bytes that a transaction takes in addition to its data: token, data header and CRC, handshake,
/// gaps (USB 2.0, table 5-9).
const OVERHEAD_BYTES: u64 = 13;

/// Returns how long a transaction with `len` data bytes takes, in ns; 51 us with 64 bytes.
fn wire_ns(len: usize) -> u64 {
    (OVERHEAD_BYTES + len as u64) * BYTE_NS
}

impl Host {
    /// Returns the next time, in ns, at which a control transfer starts or times out or a
    /// transaction ends.
    pub(super) fn traffic_due(&mut self, now: u64, core: &Core) -> Option<u64> {
        if self.transfer.is_none() && self.has_request() {
            return Some(now);
        }
        let transaction = self.next_transaction_len(core).map(|len| {
            let start = now.max(self.free_at);
            *self.busy_until.get_or_insert(start + wire_ns(len))
        });
        if transaction.is_none() {
            self.busy_until = None;
        }
        let deadline = self.transfer.as_ref().map(Transfer::deadline);
        transaction.into_iter().chain(deadline).min()
    }

    fn has_request(&mut self) -> bool {
        self.enumeration.is_some() || self.serial.next_request().is_some()
    }

    /// Returns the length in bytes of the next transaction's data; `None` while the device would
    /// respond with NAK.
    fn next_transaction_len(&self, core: &Core) -> Option<usize> {
        let control = self.transfer.as_ref();
        control
            .and_then(|transfer| transfer.next_len(core))
            .or_else(|| self.serial.next_transaction(core).map(|(_, len)| len))
    }

    /// Does what is due: starts the next control transfer, completes the transaction in progress,
    /// or ends a transfer that has exceeded its time.
    pub(super) fn advance_traffic(&mut self, now: u64, core: &mut Core) {
        if self.transfer.is_none() && self.has_request() {
            self.start_transfer(now);
            return;
        }
        if self.busy_until.is_some_and(|until| until <= now) {
            self.busy_until = None;
            self.free_at = now;
            self.transact(now, core);
        } else if let Some(transfer) = self.transfer.take() {
            let why = format!("timeout: {}", transfer.describe());
            self.transfer_failed(&why, now, core);
        }
    }

    fn start_transfer(&mut self, now: u64) {
        let (setup, data) = if let Some(enumeration) = &self.enumeration {
            (enumeration.request(), Vec::new())
        } else if let Some(request) = self.serial.next_request() {
            self.serial.setup(request)
        } else {
            return;
        };
        let enumerated = self.enumeration.as_ref().map(|e| &e.device);
        let device = enumerated.or(self.device.as_ref());
        let max_packet = device.map_or(64, |device| device.max_packet_0).into();
        self.transfer = Some(Transfer::new(setup, max_packet, data, now));
    }

    fn transact(&mut self, now: u64, core: &mut Core) {
        let transfer = self.transfer.take_if(|transfer| transfer.next_len(core).is_some());
        let mut wire = Wire { core, address: self.address, now, violations: &mut self.violations };
        let Some(mut transfer) = transfer else {
            if let Some((pipe, _)) = self.serial.next_transaction(wire.core) {
                self.serial.perform(pipe, &mut wire);
            }
            return;
        };
        match (transfer.perform(&mut wire), &mut self.enumeration) {
            (Outcome::Pending, _) => self.transfer = Some(transfer),
            (Outcome::Failed(why), _) => self.transfer_failed(&why, now, core),
            (Outcome::Done(data), Some(enumeration)) => {
                let next = enumeration.on_response(&data, now, &mut self.violations);
                self.continue_enumeration(next, now, core);
            }
            (Outcome::Done(data), None) => {
                self.serial.complete_request(&data, now, &mut self.violations);
            }
            (Outcome::Stalled, Some(enumeration)) => {
                let next = enumeration.on_stall();
                self.continue_enumeration(next, now, core);
            }
            (Outcome::Stalled, None) => self.transfer_failed("rejected with STALL", now, core),
        }
    }

    /// Copies the device's address from the enumeration, and does what the enumeration needs next.
    fn continue_enumeration(&mut self, next: Next, now: u64, core: &mut Core) {
        self.address = self.enumeration.as_ref().map_or(0, |e| e.address);
        match next {
            Next::Request => {}
            Next::Pause(ns) => self.phase = Phase::Recovery(now + ns),
            Next::Reset => self.reset_bus(now, core),
            Next::Failed(why) => self.enumeration_failed(&why, now, core),
            Next::Finished(ports) => {
                self.device = self.enumeration.take().map(|e| e.device);
                match ports {
                    Some(ports) => self.serial.connect(ports),
                    None => self.violations.record(now, "the device has no serial port"),
                }
            }
        }
    }

    fn transfer_failed(&mut self, why: &str, now: u64, core: &mut Core) {
        if self.enumeration.is_some() {
            self.enumeration_failed(why, now, core);
        } else {
            self.violations.record(now, format!("serial port: {why}"));
            self.serial.complete_request(&[], now, &mut self.violations);
        }
    }
}
