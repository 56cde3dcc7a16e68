//! The core in device mode with FIFO access by the processor: its registers as software sees them.
//!
//! [`write`] holds what writes do, [`bus`] what the host's side sees, [`interrupt`] the flags.

mod bus;
mod interrupt;
mod write;

use rigless::soc::Width;

use super::endpoint::{InEndpoint, OutEndpoint};
use super::fifo::{Extent, PacketStatus, RxFifo};
use super::instance::Instance;
use super::register::{MAX_ENDPOINTS, Register, bit, dctl, epint, gintsts, grstctl};
use super::violation::Violations;

/// How long a core soft reset takes, ns: longer than the 3 PHY clocks that software must wait.
const SOFT_RESET_NS: u64 = 100;
/// How long a FIFO flush takes, ns: 8 clocks of the PHY at 48 MHz (RM0433 57.14.5).
const FLUSH_NS: u64 = 167;
/// Words of every FIFO out of reset.
const RESET_FIFO_WORDS: u32 = 0x200;

/// What the rest of the part does for the core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Supply {
    /// The bus clock is on.
    pub(super) clocked: bool,
    /// Why the transceiver cannot reach the connector, if so.
    pub(super) unwired: Option<&'static str>,
    /// The kernel clock, Hz, where the part's model reports it.
    pub(super) kernel_hz: Option<u64>,
}

/// Registers outside the endpoints, as last written.
#[derive(Clone, Debug)]
struct Registers {
    gotgctl: u32,
    gotgint: u32,
    gahbcfg: u32,
    gusbcfg: u32,
    /// `TXFNUM` of the last flush.
    grstctl: u32,
    /// Latched bits of `OTG_GINTSTS`.
    gintsts: u32,
    gintmsk: u32,
    rx_depth: u32,
    tx: Vec<u32>,
    gccfg: u32,
    glpmcfg: u32,
    dcfg: u32,
    /// `RWUSIG`, `SDIS`, `GINSTS`, `GONSTS` and `POPRGDNE`.
    dctl: u32,
    diepmsk: u32,
    doepmsk: u32,
    daintmsk: u32,
    dvbusdis: u32,
    dvbuspulse: u32,
    dthrctl: u32,
    diepempmsk: u32,
    pcgcctl: u32,
}

impl Registers {
    /// The values out of reset (RM0433 57.14).
    fn new(endpoints: usize) -> Self {
        let tx = (0..endpoints).map(|_| RESET_FIFO_WORDS << 16 | RESET_FIFO_WORDS);
        Self {
            gotgctl: 0,
            gotgint: 0,
            gahbcfg: 0,
            gusbcfg: 0x1440,
            grstctl: 0,
            gintsts: 0,
            gintmsk: 0,
            rx_depth: RESET_FIFO_WORDS,
            tx: tx.collect(),
            gccfg: 0,
            glpmcfg: 0,
            dcfg: 0x0220_0000,
            dctl: dctl::SDIS,
            diepmsk: 0,
            doepmsk: 0,
            daintmsk: 0,
            dvbusdis: 0x17D7,
            dvbuspulse: 0x05B8,
            dthrctl: 0,
            diepempmsk: 0,
            pcgcctl: 0,
        }
    }
}

/// What the core knows of the bus.
#[expect(clippy::struct_excessive_bools, reason = "each is a signal of its own")]
#[derive(Clone, Debug, Default)]
struct Line {
    /// VBUS is there.
    vbus: bool,
    /// When the first frame began since the host last started sending them, ns.
    frames_from: Option<u64>,
    /// Number of the frame at that time.
    first_frame: u64,
    suspended: bool,
    in_reset: bool,
    /// The address it answers at.
    address: u32,
    /// A SET_ADDRESS is being answered: the new address counts after its status stage.
    addressing: bool,
    /// A SETUP has been taken, the token that starts its next stage has not come yet.
    setup_open: bool,
}

/// The core.
#[derive(Debug)]
pub(super) struct Core {
    instance: &'static Instance,
    pub(super) supply: Supply,
    registers: Registers,
    inputs: Vec<InEndpoint>,
    outputs: Vec<OutEndpoint>,
    rx: RxFifo,
    line: Line,
    /// Virtual time of the call in progress, ns.
    now: u64,
    soft_reset_until: u64,
    flush_until: u64,
    /// When software last cleared `SOF` and `EOPF`, ns.
    sof_cleared: u64,
    eopf_cleared: u64,
    pub(super) violations: Violations,
}

impl Core {
    /// The core out of reset, with nothing plugged in.
    pub(super) fn new(instance: &'static Instance) -> Self {
        debug_assert!(instance.endpoints <= MAX_ENDPOINTS);
        Self {
            instance,
            supply: Supply::default(),
            registers: Registers::new(instance.endpoints),
            inputs: (0..instance.endpoints).map(InEndpoint::new).collect(),
            outputs: (0..instance.endpoints).map(OutEndpoint::new).collect(),
            rx: RxFifo::default(),
            line: Line::default(),
            now: 0,
            soft_reset_until: 0,
            flush_until: 0,
            sof_cleared: 0,
            eopf_cleared: 0,
            violations: Violations::default(),
        }
    }

    /// Puts every register back to its reset value; what is plugged in stays.
    pub(super) fn reset(&mut self) {
        let violations = std::mem::take(&mut self.violations);
        let line = Line {
            vbus: self.line.vbus,
            frames_from: self.line.frames_from,
            first_frame: self.line.first_frame,
            ..Line::default()
        };
        *self = Self {
            supply: self.supply,
            line,
            now: self.now,
            violations,
            ..Self::new(self.instance)
        };
    }

    pub(super) fn set_now(&mut self, now: u64) {
        self.now = now;
    }

    /// Records a violation: `register`, `what` and the section of RM0433 that forbids it.
    fn report(&mut self, register: Register, what: &str, section: &str) {
        let text = format!("{register}: {what} (RM0433 {section})");
        self.violations.record(self.now, text);
    }

    /// Whether software may access the registers now, from `register` on.
    fn is_reachable(&mut self, register: Register, width: Width) -> bool {
        if !self.supply.clocked {
            self.report(
                register,
                "access while the core's bus clock is off",
                "8.5.10",
            );
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

    /// Answers a read of `width` at `offset` bytes from the base.
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

    /// What a read of `register` would answer, for one whose read changes nothing.
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
            Register::Glpmcfg => held.glpmcfg,
            Register::Dcfg => held.dcfg,
            Register::Dctl => held.dctl,
            Register::Dsts => self.dsts(),
            Register::Diepmsk => held.diepmsk,
            Register::Doepmsk => held.doepmsk,
            Register::Daint => self.daint(),
            Register::Daintmsk => held.daintmsk,
            Register::Dvbusdis => held.dvbusdis,
            Register::Dvbuspulse => held.dvbuspulse,
            Register::Dthrctl => held.dthrctl,
            Register::Diepempmsk => held.diepempmsk,
            Register::Diepctl(n) => self.inputs[n].registers.control,
            Register::Diepint(n) => {
                let txfe = if self.tx_fifo_has_room(n) {
                    epint::TXFE
                } else {
                    0
                };
                self.inputs[n].registers.flags | txfe
            }
            Register::Dieptsiz(n) => self.inputs[n].registers.size,
            Register::Dtxfsts(n) => self.dtxfsts(n),
            Register::Doepctl(n) => self.outputs[n].registers.control,
            Register::Doepint(n) => self.outputs[n].registers.flags,
            Register::Doeptsiz(n) => self.outputs[n].registers.size,
            Register::Pcgcctl => held.pcgcctl,
            Register::Undocumented(_) | Register::Fifo(_) => 0,
        }
    }

    fn gotgctl(&self) -> u32 {
        let session = if self.session_valid() { bit::BSVLD } else { 0 };
        self.registers.gotgctl | bit::CIDSTS | session
    }

    fn grstctl(&self) -> u32 {
        let mut value = self.registers.grstctl | grstctl::AHBIDL;
        if self.now < self.soft_reset_until {
            value |= grstctl::CSRST;
        }
        if self.now >= self.flush_until {
            value &= !(grstctl::RXFFLSH | grstctl::TXFFLSH);
        }
        value
    }

    fn dsts(&self) -> u32 {
        let suspended = if self.line.suspended { bit::SUSPSTS } else { 0 };
        bit::FULL_SPEED | suspended | self.frame() << 8
    }

    /// Words of the FIFO that IN endpoint `n` sends from.
    fn tx_depth(&self, n: usize) -> usize {
        let fifo = self.inputs[n].fifo();
        let value = self.registers.tx.get(fifo).copied().unwrap_or_default();
        Extent::of_dieptxf(value).depth as usize
    }

    /// `INEPTFSAV`: free words of the endpoint's FIFO.
    fn dtxfsts(&self, n: usize) -> u32 {
        let free = self.tx_depth(n).saturating_sub(self.inputs[n].words());
        u32::try_from(free).unwrap_or_default()
    }

    /// `TXFE`: the endpoint's FIFO is empty, or half empty, by `TXFELVL`.
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
                "read before the packet's data was taken"
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
                output.registers.flags |= epint::STUP;
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

    /// Whether any flag that is not masked asks for the interrupt.
    pub(super) fn interrupt(&self) -> bool {
        self.supply.clocked
            && self.registers.gahbcfg & bit::GINT != 0
            && self.gintsts() & self.registers.gintmsk != 0
    }

    /// The next instant at which a frame raises an interrupt that software asked for, ns.
    pub(super) fn next_frame_interrupt(&self) -> Option<u64> {
        let wanted = self.registers.gintmsk & (gintsts::SOF | gintsts::EOPF);
        (wanted != 0).then(|| self.next_frame_event(wanted))?
    }
}

#[cfg(test)]
mod tests;
