//! A device with a serial port: a driver that polls the registers of the core.

use std::collections::VecDeque;

use rigless::soc::Width;

use crate::usb::core::Core;
use crate::usb::register::epctl::{CNAK, EPDIS, EPENA, SD0PID, SNAK, USBAEP};

/// Fault of the device under test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Fault {
    #[default]
    None,
    /// The device never responds to a request.
    Mute,
    TotalLength,
    NoBos,
    PacketSize,
    /// The data stage starts with DATA0 instead of DATA1.
    Toggle,
}

const DEVICE: [u8; 18] = [
    18, 1, 0x10, 2, 0xEF, 2, 1, 64, 9, 0x12, 1, 0, 0, 1, 0, 1, 0, 1,
];
const BOS: [u8; 5] = [5, 15, 5, 0, 0];
const CONFIGURATION: [u8; 62] = [
    9, 2, 62, 0, 2, 1, 0, 0x80, 50, //
    9, 4, 0, 0, 1, 2, 2, 0, 0, //
    5, 0x24, 0, 0x10, 1, 4, 0x24, 2, 2, 5, 0x24, 6, 0, 1, //
    7, 5, 0x81, 3, 8, 0, 255, //
    9, 4, 1, 0, 2, 0x0A, 0, 0, 0, //
    7, 5, 1, 2, 64, 0, 0, //
    7, 5, 0x82, 2, 64, 0, 0,
];

/// The device: state of its driver, and what the host has set or sent.
#[derive(Default)]
pub(super) struct Gadget {
    fault: Fault,
    pub(super) dtr: bool,
    pub(super) line_coding: [u8; 7],
    pub(super) received: Vec<u8>,
    /// True if [`Gadget::send`] appends an empty packet to a transfer whose last packet is full.
    pub(super) ends_transfers: bool,
    outgoing: VecDeque<Vec<u8>>,
    /// Packets of the current data stage that have not been sent yet.
    answer: VecDeque<Vec<u8>>,
    setup: [u8; 8],
    out: Vec<u8>,
}

fn put(core: &mut Core, offset: u64, value: u32) {
    core.write(offset, Width::W32, value);
}

fn get(core: &mut Core, offset: u64) -> u32 {
    core.read(offset, Width::W32)
}

impl Gadget {
    /// Configures the core and connects to the host.
    pub(super) fn start(core: &mut Core, fault: Fault) -> Self {
        put(core, 0x0C, 1 << 30 | 6 << 10);
        put(core, 0x38, 1 << 16);
        put(core, 0x00, 3 << 6);
        put(core, 0x800, 3);
        put(core, 0x804, 0);
        Self {
            fault,
            ends_transfers: true,
            ..Self::default()
        }
    }

    /// Queues `bytes` in packets for the bulk IN endpoint.
    pub(super) fn send(&mut self, bytes: &[u8]) {
        self.outgoing.extend(bytes.chunks(64).map(<[u8]>::to_vec));
        if self.ends_transfers && bytes.len().is_multiple_of(64) {
            self.outgoing.push_back(Vec::new());
        }
    }

    /// Handles all interrupt flags and sends pending packets.
    pub(super) fn service(&mut self, core: &mut Core) {
        let flags = get(core, 0x14);
        put(core, 0x14, flags & 0x8000_3C00);
        if flags & 1 << 12 != 0 {
            self.reset(core);
        }
        while get(core, 0x14) & 1 << 4 != 0 {
            self.receive(core);
        }
        for endpoint in [0, 2] {
            let queue = if endpoint == 0 {
                &mut self.answer
            } else {
                &mut self.outgoing
            };
            let control = get(core, 0x900 + 0x20 * endpoint);
            let is_free = control & (EPENA | USBAEP) == USBAEP;
            if let Some(packet) = queue.pop_front_if(|_| is_free) {
                load(core, endpoint, &packet);
            }
        }
    }

    fn reset(&mut self, core: &mut Core) {
        self.answer.clear();
        self.outgoing.clear();
        self.dtr = false;
        for endpoint in [0, 2] {
            let control = 0x900 + 0x20 * endpoint;
            if get(core, control) & EPENA != 0 {
                put(core, control, SNAK);
                put(core, control, SNAK | EPDIS);
            }
        }
        put(core, 0x24, 64);
        put(core, 0x28, 16 << 16 | 64);
        put(core, 0x104, 0x0010_0050);
        put(core, 0x108, 0x0010_0060);
        put(core, 0x10, 0x430);
        put(core, 0x800, 3);
        put(core, 0xB10, 3 << 29 | 64);
    }

    fn receive(&mut self, core: &mut Core) {
        let status = get(core, 0x20);
        let (endpoint, count) = (status & 0xF, (status >> 4 & 0x7FF) as usize);
        let words = (0..count.div_ceil(4)).map(|_| get(core, 0x1000));
        let mut bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
        bytes.truncate(count);
        match (status >> 17 & 0xF, endpoint) {
            (6, _) => self.setup.copy_from_slice(&bytes),
            (4, _) => self.request(core),
            (2, 0) => {
                self.out.extend(bytes);
                if !self.out.is_empty() && self.out.len() >= usize::from(self.setup[6]) {
                    self.line_coding
                        .copy_from_slice(&std::mem::take(&mut self.out));
                    self.answer.push_back(Vec::new());
                }
            }
            (2, _) => self.received.extend(bytes),
            (3, 1) => enable_bulk_out(core),
            _ => {}
        }
    }

    fn request(&mut self, core: &mut Core) {
        if self.fault == Fault::Mute {
            return;
        }
        let [request_type, request, value, kind, .., low, high] = self.setup;
        let length = usize::from(u16::from_le_bytes([low, high]));
        put(core, 0xB10, 3 << 29 | 1 << 19 | 64);
        put(core, 0xB00, CNAK);
        let text = |text: &str| {
            let units = text.encode_utf16().flat_map(u16::to_le_bytes);
            let mut bytes = vec![0, 3];
            bytes.extend(units);
            bytes[0] = u8::try_from(bytes.len()).unwrap();
            bytes
        };
        let mut configuration = CONFIGURATION.to_vec();
        if self.fault == Fault::TotalLength {
            configuration[2] = 70;
        }
        if self.fault == Fault::PacketSize {
            configuration[59] = 65;
        }
        let data = match (request_type, request, kind) {
            (0x80, 6, 1) => DEVICE.to_vec(),
            (0x80, 6, 2) => configuration,
            (0x80, 6, 3) if value == 0 => vec![4, 3, 9, 4],
            (0x80, 6, 3) => text("Gadget"),
            (0x80, 6, 15) if self.fault == Fault::NoBos => Vec::new(),
            (0x80, 6, 15) => BOS.to_vec(),
            (0xA1, 0x21, _) => self.line_coding.to_vec(),
            (0x00, 5, _) => {
                put(core, 0x800, 3 | u32::from(value) << 4);
                Vec::new()
            }
            (0x00, 9, _) => {
                put(core, 0x920, USBAEP | 3 << 18 | 1 << 22 | SD0PID | SNAK | 8);
                put(core, 0x940, USBAEP | 2 << 18 | 2 << 22 | SD0PID | SNAK | 64);
                put(core, 0xB20, USBAEP | 2 << 18 | SD0PID | 64);
                enable_bulk_out(core);
                Vec::new()
            }
            (0x21, 0x22, _) => {
                self.dtr = value & 1 != 0;
                Vec::new()
            }
            // The request is complete only after its data stage, which contains the line coding.
            (0x21, 0x20, _) => return,
            _ => {
                put(core, 0x900, 1 << 21);
                put(core, 0xB00, 1 << 21);
                return;
            }
        };
        if self.fault == Fault::Toggle && request_type == 0x80 {
            put(core, 0x900, SD0PID);
        }
        let data = &data[..data.len().min(length)];
        self.answer.extend(data.chunks(64).map(<[u8]>::to_vec));
        if data.is_empty() || data.len() < length && data.len().is_multiple_of(64) {
            self.answer.push_back(Vec::new());
        }
    }
}

/// Enables bulk OUT endpoint 1 for the next packet.
fn enable_bulk_out(core: &mut Core) {
    put(core, 0xB30, 1 << 19 | 64);
    let control = get(core, 0xB20);
    put(core, 0xB20, control | CNAK | EPENA);
}

/// Enables an IN endpoint and writes a packet to its FIFO.
fn load(core: &mut Core, endpoint: u64, packet: &[u8]) {
    let size = u32::try_from(packet.len()).unwrap();
    put(core, 0x910 + 0x20 * endpoint, 1 << 19 | size);
    let control = get(core, 0x900 + 0x20 * endpoint);
    put(core, 0x900 + 0x20 * endpoint, control | CNAK | EPENA);
    for chunk in packet.chunks(4) {
        let mut word = [0; 4];
        word[..chunk.len()].copy_from_slice(chunk);
        put(core, 0x1000 * (endpoint + 1), u32::from_le_bytes(word));
    }
}
