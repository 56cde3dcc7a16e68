//! Model of the USB core in device mode, with FIFO access by the processor.
//!
//! This file contains the state of the core, the reads of registers and the interrupt flags.
//! [`write`] contains the writes of registers, and [`bus`] the packets and signals from the host.

mod bus;
mod write;

use rigless::soc::Width;

use super::endpoint::{Endpoint, InEndpoint};
use super::fifo::{Extent, PacketStatus, RxFifo};
use super::instance::Instance;
use super::register::{MAX_ENDPOINTS, Register, bit, dctl, epint, gintsts, grstctl};
use super::violation::Violations;

/// Duration of a soft reset, in ns: longer than the 3 PHY clocks for which software must wait.
const SOFT_RESET_NS: u64 = 100;
/// Time that flushing a FIFO takes, in ns: 8 clocks of the PHY at 48 MHz (RM0433 57.14.5).
const FLUSH_NS: u64 = 167;
/// Duration of a USB frame at full speed, in ns.
const FRAME_NS: u64 = 1_000_000;
/// Time in ns from the start of a frame until the flag `EOPF` is set: 80 % of the frame (`PFIVL` =
/// 0b00).
const EOPF_NS: u64 = 800_000;
/// Depth of every FIFO after a reset, in words.
const RESET_FIFO_WORDS: u32 = 0x200;

/// What the rest of the microcontroller provides to the USB core: clocks and connections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Supply {
    /// True if the microcontroller's clock controller enables the core's bus clock.
    pub(super) clocked: bool,
    /// Reason why the transceiver is not connected to the cable; `None` if it is connected.
    pub(super) unwired: Option<&'static str>,
    /// Frequency of the core's kernel clock in Hz; `None` if the emulated part does not report it.
    pub(super) kernel_hz: Option<u64>,
}

/// Values last written to the registers that belong to no endpoint.
#[derive(Clone, Debug, Default)]
struct Registers {
    gotgctl: u32,
    gotgint: u32,
    gahbcfg: u32,
    gusbcfg: u32,
    /// Fields `TXFNUM`, `TXFFLSH` and `RXFFLSH` as last written; the bit of an ended flush reads as
    /// 0.
    grstctl: u32,
    /// Those flags of `OTG_GINTSTS` that stay set until software clears them.
    gintsts: u32,
    gintmsk: u32,
    rx_depth: u32,
    tx: Vec<u32>,
    gccfg: u32,
    dcfg: u32,
    /// Fields `RWUSIG`, `SDIS`, `GINSTS`, `GONSTS`, `TCTL` and `POPRGDNE` of `OTG_DCTL`.
    dctl: u32,
    diepmsk: u32,
    doepmsk: u32,
    daintmsk: u32,
    diepempmsk: u32,
    pcgcctl: u32,
}

impl Registers {
    /// Returns the registers' reset values (RM0433 57.14) for a core with `endpoints` endpoints per
    /// direction.
    fn new(endpoints: usize) -> Self {
        let tx = (0..endpoints).map(|_| RESET_FIFO_WORDS << 16 | RESET_FIFO_WORDS);
        Self {
            gusbcfg: 0x1440,
            rx_depth: RESET_FIFO_WORDS,
            tx: tx.collect(),
            dcfg: 0x0220_0000,
            dctl: dctl::SDIS,
            ..Self::default()
        }
    }
}

/// State of the USB bus as the device's core sees it.
#[expect(clippy::struct_excessive_bools, reason = "independent signals")]
#[derive(Clone, Debug, Default)]
struct BusState {
    /// True if the cable's supply voltage VBUS is present.
    vbus: bool,
    /// Time in ns when the host last began to send frames; `None` while it sends none.
    frames_from: Option<u64>,
    /// Number of the frame that starts at the time `frames_from`.
    first_frame: u64,
    suspended: bool,
    in_reset: bool,
    /// USB address to which the device responds.
    address: u32,
    /// True from a SET_ADDRESS request to its status stage, when the new address takes effect.
    addressing: bool,
    /// True from a SETUP packet until the token that starts the next stage of the control transfer.
    in_setup_stage: bool,
}

const fn flag(bit: u32, on: bool) -> u32 {
    if on { bit } else { 0 }
}

/// The USB core: registers, endpoints, receive FIFO and state of the bus.
#[derive(Debug)]
pub(super) struct Core {
    instance: &'static Instance,
    pub(super) supply: Supply,
    registers: Registers,
    inputs: Vec<InEndpoint>,
    outputs: Vec<Endpoint>,
    rx: RxFifo,
    bus: BusState,
    /// Current virtual time, in ns.
    now: u64,
    soft_reset_until: u64,
    flush_until: u64,
    /// Times in ns at which software last cleared the flags `SOF` and `EOPF`.
    sof_cleared: u64,
    eopf_cleared: u64,
    pub(super) violations: Violations,
}

impl Core {
    /// Creates a core in its state after reset, with the cable unplugged.
    pub(super) fn new(instance: &'static Instance) -> Self {
        debug_assert!(instance.endpoints <= MAX_ENDPOINTS);
        Self {
            instance,
            supply: Supply::default(),
            registers: Registers::new(instance.endpoints),
            inputs: (0..instance.endpoints).map(InEndpoint::new).collect(),
            outputs: (0..instance.endpoints).map(Endpoint::new).collect(),
            rx: RxFifo::default(),
            bus: BusState::default(),
            now: 0,
            soft_reset_until: 0,
            flush_until: 0,
            sof_cleared: 0,
            eopf_cleared: 0,
            violations: Violations::default(),
        }
    }

    /// Sets all registers to their reset values; the state of the cable remains.
    pub(super) fn reset(&mut self) {
        let violations = std::mem::take(&mut self.violations);
        let bus = BusState {
            vbus: self.bus.vbus,
            frames_from: self.bus.frames_from,
            first_frame: self.bus.first_frame,
            ..BusState::default()
        };
        *self = Self {
            supply: self.supply,
            bus,
            now: self.now,
            violations,
            ..Self::new(self.instance)
        };
    }

    pub(super) fn set_now(&mut self, now: u64) {
        self.now = now;
    }

    /// Records that software has violated the given section of RM0433.
    fn report(&mut self, register: Register, what: &str, section: &str) {
        let text = format!("{register}: {what} (RM0433 {section})");
        self.violations.record(self.now, text);
    }

    /// Returns whether software may access `register` now; if not, records the violated rule.
    fn is_reachable(&mut self, register: Register, width: Width) -> bool {
        if !self.supply.clocked {
            let what = "access while the core's bus clock is off";
            self.report(register, what, "8.5.10");
            return false;
        }
        if width != Width::W32 {
            self.report(register, "access that is not a word", "57.14");
            return false;
        }
        if self.now < self.soft_reset_until && register != Register::Grstctl {
            self.report(register, "access during the core soft reset", "57.14.5");
            return false;
        }
        true
    }

    /// Reads the register at `offset` bytes from the core's base, with a read's side effects.
    pub(super) fn read(&mut self, offset: u64, width: Width) -> u32 {
        let Some(register) = Register::at(offset, self.instance.endpoints) else {
            let text = format!("OTG + {offset:#05x}: read of a reserved address (RM0433 57.14)");
            self.violations.record(self.now, text);
            return 0;
        };
        if !self.is_reachable(register, width) {
            return 0;
        }
        match register {
            Register::Grxstsr => self.rx.peek_status().unwrap_or_default(),
            Register::Grxstsp => self.pop_status(),
            Register::Fifo(_) => self.pop_data(register),
            _ => self.peek(register),
        }
    }

    /// Returns the value of a register, without the side effects of a read by software.
    pub(super) fn peek(&self, register: Register) -> u32 {
        let held = &self.registers;
        match register {
            Register::Gotgctl => self.gotgctl(),
            Register::Gotgint => held.gotgint,
            Register::Gahbcfg => held.gahbcfg,
            Register::Gusbcfg => held.gusbcfg,
            Register::Grstctl => self.grstctl(),
            Register::Gintsts => self.gintsts(),
            Register::Gintmsk => held.gintmsk,
            Register::Grxstsr | Register::Grxstsp => self.rx.peek_status().unwrap_or_default(),
            Register::Grxfsiz => held.rx_depth,
            Register::Dieptxf(n) => held.tx[n],
            Register::Gnptxsts => self.dtxfsts(0),
            Register::Gccfg => held.gccfg,
            Register::Cid => self.instance.core_id,
            Register::Dcfg => held.dcfg,
            Register::Dctl => held.dctl,
            Register::Dsts => self.dsts(),
            Register::Diepmsk => held.diepmsk,
            Register::Doepmsk => held.doepmsk,
            Register::Daint => self.daint(),
            Register::Daintmsk => held.daintmsk,
            Register::Diepempmsk => held.diepempmsk,
            Register::Diepctl(n) => self.inputs[n].registers.control,
            Register::Diepint(n) => {
                self.inputs[n].registers.flags | flag(epint::TXFE, self.tx_fifo_has_room(n))
            }
            Register::Dieptsiz(n) => self.inputs[n].registers.size,
            Register::Dtxfsts(n) => self.dtxfsts(n),
            Register::Doepctl(n) => self.outputs[n].control,
            Register::Doepint(n) => self.outputs[n].flags,
            Register::Doeptsiz(n) => self.outputs[n].size,
            Register::Pcgcctl => held.pcgcctl,
            Register::Undocumented(_) | Register::Fifo(_) => 0,
        }
    }

    fn gotgctl(&self) -> u32 {
        self.registers.gotgctl | bit::CIDSTS | flag(bit::BSVLD, self.session_valid())
    }

    fn grstctl(&self) -> u32 {
        let flushed = flag(grstctl::RXFFLSH | grstctl::TXFFLSH, self.now >= self.flush_until);
        let in_reset = flag(grstctl::CSRST, self.now < self.soft_reset_until);
        self.registers.grstctl & !flushed | grstctl::AHBIDL | in_reset
    }

    fn dsts(&self) -> u32 {
        bit::FULL_SPEED | flag(bit::SUSPSTS, self.bus.suspended) | self.frame() << 8
    }

    /// Returns the depth in words of the transmit FIFO that IN endpoint `n` uses.
    fn tx_depth(&self, n: usize) -> usize {
        let fifo = self.inputs[n].fifo();
        let value = self.registers.tx.get(fifo).copied().unwrap_or_default();
        Extent::from_dieptxf(value).depth as usize
    }

    /// Returns `INEPTFSAV`: the number of free words in the transmit FIFO of IN endpoint `n`.
    fn dtxfsts(&self, n: usize) -> u32 {
        let free = self.tx_depth(n).saturating_sub(self.inputs[n].words());
        u32::try_from(free).unwrap_or_default()
    }

    /// Returns the flag `TXFE` of IN endpoint `n`: whether its transmit FIFO is empty, or, if
    /// `TXFELVL` is clear, at least half empty.
    fn tx_fifo_has_room(&self, n: usize) -> bool {
        let words = self.inputs[n].words();
        if self.registers.gahbcfg & bit::TXFELVL != 0 {
            words == 0
        } else {
            words <= self.tx_depth(n) / 2
        }
    }

    fn pop_status(&mut self) -> u32 {
        let Some(word) = self.rx.pop_status() else {
            let what = if self.rx.is_empty() {
                "read while RXFLVL is clear"
            } else {
                "read before the packet's data was read"
            };
            self.report(Register::Grxstsp, what, "57.14, OTG_GRXSTSP");
            return 0;
        };
        if word >> 17 & 0xF == PacketStatus::GlobalOutNak as u32 {
            self.registers.dctl |= dctl::GONSTS;
        }
        let endpoint = (word & 0xF) as usize;
        if let Some(output) = self.outputs.get_mut(endpoint) {
            let status = word >> 17 & 0xF;
            if status == PacketStatus::OutDone as u32 {
                output.complete();
            } else if status == PacketStatus::SetupDone as u32 {
                output.flags |= epint::STUP;
            }
        }
        word
    }

    fn pop_data(&mut self, register: Register) -> u32 {
        if self.now < self.flush_until {
            self.report(register, "read during a flush", "57.14.5");
        }
        self.rx.pop_data().unwrap_or_else(|| {
            let what = if self.rx.is_empty() {
                "read while the receive FIFO is empty"
            } else {
                "read past the end of the packet"
            };
            self.report(register, what, "57.15.6");
            0
        })
    }

    /// Returns the number of the current USB frame, which has 11 bits.
    pub(super) fn frame(&self) -> u32 {
        let started = self.bus.frames_from.unwrap_or(self.now);
        let passed = self.now.saturating_sub(started) / FRAME_NS;
        u32::try_from((self.bus.first_frame + passed) & 0x7FF).unwrap_or_default()
    }

    /// Returns how many frames have reached the point `offset` ns after their start by the time
    /// `at` (inclusive), which is in ns.
    fn frames_at(&self, at: u64, offset: u64) -> u64 {
        let first = self.bus.frames_from.map(|from| from + offset);
        let since = first.and_then(|first| at.checked_sub(first));
        since.map_or(0, |since| since / FRAME_NS + 1)
    }

    /// Returns whether, since the time `cleared` in ns, a frame has reached the point `offset` ns
    /// after its start.
    fn frame_instant_since(&self, cleared: u64, offset: u64) -> bool {
        self.frames_at(self.now, offset) > self.frames_at(cleared, offset)
    }

    /// Returns the time in ns at which `SOF` or `EOPF` next causes an interrupt; `None` if both are
    /// masked or the host sends no frames.
    pub(super) fn next_frame_interrupt(&self) -> Option<u64> {
        let from = self.bus.frames_from?;
        let flags = [(gintsts::SOF, 0), (gintsts::EOPF, EOPF_NS)];
        let unmasked = flags.iter().filter(|(flag, _)| self.registers.gintmsk & flag != 0);
        let times = unmasked
            .map(|(_, offset)| from + offset + self.frames_at(self.now, *offset) * FRAME_NS);
        times.min()
    }

    /// Returns the value of `OTG_GINTSTS`: the stored flags and those that follow from the current
    /// state.
    pub(super) fn gintsts(&self) -> u32 {
        let endpoints = self.daint() & self.registers.daintmsk;
        let (sof, eopf) = (self.sof_cleared, self.eopf_cleared);
        let derived = [
            (gintsts::OTGINT, self.registers.gotgint != 0),
            (gintsts::SOF, self.frame_instant_since(sof, 0)),
            (gintsts::EOPF, self.frame_instant_since(eopf, EOPF_NS)),
            (gintsts::RXFLVL, !self.rx.is_empty()),
            (gintsts::NPTXFE, self.tx_fifo_has_room(0)),
            (gintsts::GINAKEFF, self.registers.dctl & dctl::GINSTS != 0),
            (gintsts::GONAKEFF, self.registers.dctl & dctl::GONSTS != 0),
            (gintsts::IEPINT, endpoints & 0xFFFF != 0),
            (gintsts::OEPINT, endpoints >> 16 != 0),
        ];
        derived.into_iter().fold(self.registers.gintsts, |flags, (bit, on)| flags | flag(bit, on))
    }

    /// Returns the value of `OTG_DAINT`, which has a bit for each endpoint with an unmasked flag:
    /// IN endpoints in bits 15:0, OUT endpoints in bits 31:16.
    pub(super) fn daint(&self) -> u32 {
        let held = &self.registers;
        let inputs = (0..self.inputs.len()).filter(|&n| {
            self.inputs[n].registers.flags & held.diepmsk != 0
                || held.diepempmsk & 1 << n != 0 && self.tx_fifo_has_room(n)
        });
        let outputs =
            (0..self.outputs.len()).filter(|&n| self.outputs[n].flags & held.doepmsk != 0);
        inputs.fold(0, |all, n| all | 1 << n) | outputs.fold(0, |all, n| all | 1 << (16 + n))
    }

    /// Returns the level of the core's interrupt line: high if the core has a clock, `GINT` enables
    /// the line, and an unmasked flag is set.
    pub(super) fn interrupt(&self) -> bool {
        self.supply.clocked
            && self.registers.gahbcfg & bit::GINT != 0
            && self.gintsts() & self.registers.gintmsk != 0
    }
}

#[cfg(test)]
mod tests;
