//! The host's driver of the device's serial port: opens and closes the port, and transfers bulk
//! data in both directions.

use std::collections::VecDeque;

use super::control::{Setup, Wire};
use super::descriptor::{EndpointDescriptor, SerialPort};
use crate::usb::core::Core;
use crate::usb::endpoint::{Handshake, Input};
use crate::usb::violation::Violations;

/// Size in bytes of the driver's read buffer, as in the driver of Windows. A program receives the
/// data when the buffer is full or a short packet has arrived.
const READ_BYTES: usize = 4_096;
/// Bit rates in bit/s that the driver sets: the first when the device is configured, the second
/// when a program opens the port.
const RATES: [u32; 2] = [9_600, 115_200];

/// Requests of the device class for serial ports (CDC PSTN 1.2, 6.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Request {
    SetLineCoding(u32),
    GetLineCoding(u32),
    /// Sets DTR and RTS if true, and clears both if false.
    LineState(bool),
}

/// The endpoints of the serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pipe {
    Input,
    Output,
    Notification,
}

/// Encodes the bit rate `rate` with one stop bit, no parity and eight data bits (CDC PSTN 1.2,
/// table 17).
fn line_coding(rate: u32) -> Vec<u8> {
    [rate.to_le_bytes().as_slice(), &[0, 0, 8]].concat()
}

/// State of the driver from the time when a device is configured until it is detached.
#[expect(
    clippy::struct_excessive_bools,
    reason = "independent states of the program and of the device"
)]
#[derive(Debug, Default)]
pub(super) struct Serial {
    ports: Option<SerialPort>,
    /// Whether a program wants the port to be open.
    pub(super) wanted: bool,
    /// Whether the port is open: the device has accepted the request that sets DTR.
    pub(super) is_open: bool,
    /// Whether the host reads the bulk IN endpoint: from just before it sets DTR until just after
    /// it has cleared DTR.
    is_reading: bool,
    /// True until the host has sent a token to the bulk IN endpoint of the opened port.
    is_first_read: bool,
    /// Whether the host stops reading although the port is open.
    pub(super) is_paused: bool,
    /// Whether the next data PID of each [`Pipe`] is DATA1.
    toggles: [bool; 3],
    /// Whether the last transaction was an OUT: while both directions have data, they alternate.
    was_output: bool,
    /// Data in the driver's read buffer, which the program has not received yet.
    read: Vec<u8>,
    /// Data that the program with the open port has received.
    pub(super) received: Vec<u8>,
    pub(super) outgoing: VecDeque<u8>,
    requests: VecDeque<Request>,
}

impl Serial {
    /// Starts the driver for the serial port of a device that has just been configured.
    pub(super) fn connect(&mut self, ports: SerialPort) {
        self.ports = Some(ports);
        self.toggles = [false; 3];
        self.requests = [Request::SetLineCoding(RATES[0]), Request::LineState(false)].into();
    }

    /// Stops the driver and closes the port, because the device was detached or reset.
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

    /// Returns the request that the host must make now, if any. Returns the same request until
    /// [`Serial::complete_request`] ends it.
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

    /// Returns the SETUP packet of a request, and the data that the host sends after it.
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

    /// Ends the current request. `data` is the device's response, empty after a failure.
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

    /// Returns endpoint and length in bytes of the next transaction; `None` while the device would
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
            core.answers_in(endpoint).then(|| (Pipe::Notification, core.next_in_len(endpoint)))
        };
        let bulk = if self.was_output { input().or_else(output) } else { output().or_else(input) };
        bulk.or_else(notification)
    }

    /// Exchanges one packet with the device over the endpoint `pipe`.
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
                // Discard the contents of the notification, which no scenario uses.
                self.receive(ports.notification, pipe, wire);
            }
        }
    }

    fn send(&mut self, endpoint: EndpointDescriptor, wire: &mut Wire<'_>) {
        let len = self.outgoing.len().min(endpoint.max_packet.into());
        let bytes: Vec<u8> = self.outgoing.iter().copied().take(len).collect();
        let toggle = &mut self.toggles[Pipe::Output as usize];
        match wire.core.output(wire.address, number(endpoint), *toggle, &bytes) {
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
        wire.violations.record(wire.now, format!("IN endpoint {n}: {fault}"));
        None
    }
}

/// Returns the number of an endpoint, without the bit for its direction.
fn number(endpoint: EndpointDescriptor) -> usize {
    usize::from(endpoint.address & 0xF)
}
