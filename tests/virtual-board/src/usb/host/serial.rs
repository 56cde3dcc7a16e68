//! The host's driver for the serial port: opens and closes it, and transfers bulk data in both
//! directions.

use std::collections::VecDeque;

use super::control::{Setup, Wire};
use super::descriptor::{EndpointDescriptor, SerialPort};
use crate::usb::core::Core;
use crate::usb::endpoint::{Handshake, Input};
use crate::usb::violation::Violations;

/// Size of the driver's read buffer in bytes, as in the driver of Windows. A program receives the
/// data when the buffer is full or after a short packet.
const READ_BYTES: usize = 4_096;
/// Bit rates in bit/s: the driver sets the first when the device is configured, the second when a
/// program opens the port.
const RATES: [u32; 2] = [9_600, 115_200];

/// Class-specific requests (CDC PSTN 1.2, 6.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Request {
    SetLineCoding(u32),
    GetLineCoding(u32),
    /// Sets both DTR and RTS if true, clears both if false.
    LineState(bool),
}

/// Endpoint of the serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pipe {
    Input,
    Output,
    Notification,
}

/// Encodes a line coding: bit rate, one stop bit, no parity, eight data bits (CDC PSTN 1.2, table
/// 17).
fn line_coding(rate: u32) -> Vec<u8> {
    [rate.to_le_bytes().as_slice(), &[0, 0, 8]].concat()
}

/// State of the driver, from the configuration of a device until the device is detached.
#[expect(
    clippy::struct_excessive_bools,
    reason = "independent states of the program and of the device"
)]
#[derive(Debug, Default)]
pub(super) struct Serial {
    ports: Option<SerialPort>,
    /// A program wants the port open.
    pub(super) wanted: bool,
    /// The device has accepted the request that sets DTR.
    pub(super) is_open: bool,
    /// The host reads the bulk IN endpoint: from just before DTR is set until just after it is
    /// cleared.
    is_reading: bool,
    /// The host has sent no token to the bulk IN endpoint since the port was opened.
    is_first_read: bool,
    /// Reading is paused although the port is open.
    pub(super) is_paused: bool,
    /// For each [`Pipe`], whether its next data PID is DATA1.
    toggles: [bool; 3],
    /// The last transaction was an OUT, so an IN comes next if both directions have data.
    was_output: bool,
    /// Data received so far for the read request in progress.
    read: Vec<u8>,
    /// Data received for the program that has opened the port.
    pub(super) received: Vec<u8>,
    pub(super) outgoing: VecDeque<u8>,
    requests: VecDeque<Request>,
}

impl Serial {
    /// Starts the driver for a device that has just been configured.
    pub(super) fn connect(&mut self, ports: SerialPort) {
        self.ports = Some(ports);
        self.toggles = [false; 3];
        self.requests = [Request::SetLineCoding(RATES[0]), Request::LineState(false)].into();
    }

    /// Stops the driver when the device is detached or reset, and closes the port.
    pub(super) fn disconnect(&mut self) {
        self.received.append(&mut self.read);
        self.outgoing.clear();
        self.requests.clear();
        self.ports = None;
        self.wanted = false;
        self.is_open = false;
        self.is_reading = false;
    }

    pub(super) fn is_connected(&self) -> bool {
        self.ports.is_some()
    }

    /// Returns the request to perform next. It remains the next one until
    /// [`Serial::complete_request`] is called.
    pub(super) fn next_request(&mut self) -> Option<Request> {
        self.ports?;
        if self.requests.is_empty() && self.wanted != self.is_open {
            self.requests = if self.wanted {
                self.is_reading = true;
                self.is_first_read = true;
                [
                    Request::SetLineCoding(RATES[1]),
                    Request::GetLineCoding(RATES[1]),
                    Request::LineState(true),
                ]
                .into()
            } else {
                [Request::LineState(false)].into()
            };
        }
        self.requests.front().copied()
    }

    /// Returns the SETUP packet of a request, and the data to send.
    pub(super) fn setup(&self, request: Request) -> (Setup, Vec<u8>) {
        let index = self.ports.map_or(0, |ports| ports.control_interface).into();
        let setup = |request_type, request, value, length| Setup {
            request_type,
            request,
            value,
            index,
            length,
        };
        match request {
            Request::SetLineCoding(rate) => (setup(0x21, 0x20, 0, 7), line_coding(rate)),
            Request::GetLineCoding(_) => (setup(0xA1, 0x21, 0, 7), Vec::new()),
            Request::LineState(on) => (setup(0x21, 0x22, if on { 3 } else { 0 }, 0), Vec::new()),
        }
    }

    /// Completes the current request. `data` is the response, empty after a failure.
    pub(super) fn complete_request(&mut self, data: &[u8], now: u64, violations: &mut Violations) {
        match self.requests.pop_front() {
            Some(Request::GetLineCoding(rate)) if data != line_coding(rate) => {
                let text = format!("GET_LINE_CODING: {data:02x?} (CDC PSTN 1.2, 6.3.11)");
                violations.record(now, text);
            }
            Some(Request::LineState(true)) => self.is_open = true,
            Some(Request::LineState(false)) if self.is_open => {
                self.is_open = false;
                self.is_reading = false;
                self.received.append(&mut self.read);
            }
            _ => {}
        }
    }

    /// Returns the endpoint and length of the next transaction; `None` while the device would
    /// respond with NAK.
    pub(super) fn next_transaction(&self, core: &Core) -> Option<(Pipe, usize)> {
        let ports = self.ports?;
        let input = || {
            let endpoint = number(ports.input);
            let reads = self.is_reading && !self.is_paused;
            (reads && (self.is_first_read || core.answers_in(endpoint)))
                .then(|| (Pipe::Input, core.next_in_len(endpoint)))
        };
        let output = || {
            let len = self.outgoing.len().min(ports.output.max_packet.into());
            let sends = self.is_open && len > 0;
            (sends && core.answers_out(number(ports.output), len)).then_some((Pipe::Output, len))
        };
        let notification = || {
            let endpoint = number(ports.notification);
            core.answers_in(endpoint)
                .then(|| (Pipe::Notification, core.next_in_len(endpoint)))
        };
        let bulk = if self.was_output {
            input().or_else(output)
        } else {
            output().or_else(input)
        };
        bulk.or_else(notification)
    }

    /// Performs a transaction on `pipe`.
    pub(super) fn perform(&mut self, pipe: Pipe, wire: &mut Wire<'_>) {
        let Some(ports) = self.ports else {
            return;
        };
        self.was_output = pipe == Pipe::Output;
        match pipe {
            Pipe::Output => self.send(ports.output, wire),
            Pipe::Input => {
                self.is_first_read = false;
                let received = self.receive(ports.input, pipe, wire);
                let Some(bytes) = received else {
                    return;
                };
                let ends = bytes.len() < ports.input.max_packet.into();
                self.read.extend(bytes);
                if ends || self.read.len() >= READ_BYTES {
                    self.received.append(&mut self.read);
                }
            }
            Pipe::Notification => {
                // The scenarios do not use what a notification contains.
                self.receive(ports.notification, pipe, wire);
            }
        }
    }

    fn send(&mut self, endpoint: EndpointDescriptor, wire: &mut Wire<'_>) {
        let len = self.outgoing.len().min(endpoint.max_packet.into());
        let bytes: Vec<u8> = self.outgoing.iter().copied().take(len).collect();
        let toggle = &mut self.toggles[Pipe::Output as usize];
        match wire
            .core
            .output(wire.address, number(endpoint), *toggle, &bytes)
        {
            Handshake::Ack => {
                *toggle = !*toggle;
                self.outgoing.drain(..len);
            }
            Handshake::Nak => {}
            refused => {
                let text = format!("OUT endpoint {}: {refused:?}", number(endpoint));
                wire.violations.record(wire.now, text);
                self.outgoing.clear();
            }
        }
    }

    fn receive(
        &mut self,
        endpoint: EndpointDescriptor,
        pipe: Pipe,
        wire: &mut Wire<'_>,
    ) -> Option<Vec<u8>> {
        let n = number(endpoint);
        let toggle = &mut self.toggles[pipe as usize];
        let fault = match wire.core.input(wire.address, n) {
            Input::Nak => return None,
            Input::Packet { data1, .. } if data1 != *toggle => {
                "packet with the wrong data toggle, dropped (USB 2.0, 8.6.4)".to_owned()
            }
            Input::Packet { bytes, .. } if bytes.len() > endpoint.max_packet.into() => {
                format!("packet of {} bytes (USB 2.0, 5.8.3)", bytes.len())
            }
            Input::Packet { bytes, .. } => {
                *toggle = !*toggle;
                return Some(bytes);
            }
            refused @ (Input::Stall | Input::Silent) => {
                self.is_reading &= pipe != Pipe::Input;
                format!("{refused:?}")
            }
        };
        wire.violations
            .record(wire.now, format!("IN endpoint {n}: {fault}"));
        None
    }
}

/// Returns the number of an endpoint, without its direction bit.
fn number(endpoint: EndpointDescriptor) -> usize {
    usize::from(endpoint.address & 0xF)
}
