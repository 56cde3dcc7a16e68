//! Register writes by software, checked against the rules of the reference manual.

use rigless::soc::Width;

use super::{Core, FLUSH_NS, SOFT_RESET_NS};
use crate::usb::fifo::{Extent, PacketStatus, layout_error};
use crate::usb::register::{Register, bit, dctl, epctl, gintsts, grstctl};

/// Kernel clock in Hz that USB permits at full speed: 48 MHz +- 0.25 % (USB 2.0, 7.1.11).
const KERNEL_HZ: std::ops::RangeInclusive<u64> = 47_880_000..=48_120_000;
/// Number of the section in RM0433 on programming the endpoints in device mode.
const PROGRAMMING: &str = "57.15.6";

impl Core {
    /// Writes the register at `offset` bytes from the core's base address.
    pub(crate) fn write(&mut self, offset: u64, width: Width, value: u32) {
        let Some(register) = Register::at(offset, self.instance.endpoints) else {
            let text = format!("OTG + {offset:#05x}: write to a reserved address (RM0433 57.14)");
            self.violations.record(self.now, text);
            return;
        };
        if self.is_reachable(register, width) {
            self.write_register(register, value);
        }
    }

    fn write_register(&mut self, register: Register, value: u32) {
        let held = &mut self.registers;
        match register {
            Register::Gotgctl => self.write_gotgctl(value),
            Register::Gotgint => held.gotgint &= !value,
            Register::Gahbcfg => held.gahbcfg = value & 0x1BF,
            Register::Gusbcfg => self.write_gusbcfg(value),
            Register::Grstctl => self.write_grstctl(value),
            Register::Gintsts => self.clear_flags(value),
            Register::Gintmsk => held.gintmsk = value,
            Register::Grxfsiz => held.rx_depth = value & 0xFFFF,
            Register::Dieptxf(n) => held.tx[n] = value,
            Register::Gccfg => held.gccfg = value,
            Register::Dcfg => self.write_dcfg(value),
            Register::Dctl => self.write_dctl(value),
            Register::Diepmsk => held.diepmsk = value,
            Register::Doepmsk => held.doepmsk = value,
            Register::Daintmsk => held.daintmsk = value,
            Register::Diepempmsk => held.diepempmsk = value & 0xFFFF,
            Register::Diepctl(n) => self.write_diepctl(n, value),
            Register::Diepint(n) => self.inputs[n].registers.flags &= !value,
            Register::Dieptsiz(_) | Register::Doeptsiz(_) => self.write_size(register, value),
            Register::Doepctl(n) => self.write_doepctl(n, value),
            Register::Doepint(n) => self.outputs[n].flags &= !value,
            Register::Pcgcctl => held.pcgcctl = value & 0x3,
            Register::Fifo(n) => self.push_data(n, value),
            Register::Grxstsr
            | Register::Grxstsp
            | Register::Gnptxsts
            | Register::Cid
            | Register::Undocumented(_)
            | Register::Dsts
            | Register::Daint
            | Register::Dtxfsts(_) => {
                self.report(register, "write to a read-only register", "57.14");
            }
        }
    }

    fn write_size(&mut self, register: Register, value: u32) {
        let endpoint = match register {
            Register::Dieptsiz(n) => &mut self.inputs[n].registers,
            Register::Doeptsiz(n) => &mut self.outputs[n],
            _ => return,
        };
        let changes = endpoint.has(epctl::EPENA) && endpoint.size != value;
        endpoint.size = value;
        if changes {
            self.report(register, "changed while the endpoint is enabled", "57.14");
        }
    }

    fn write_gotgctl(&mut self, value: u32) {
        let before = self.session_valid();
        self.registers.gotgctl = value & 0x0010_1EFE;
        self.session_changed(before);
    }

    fn write_gusbcfg(&mut self, value: u32) {
        if value & bit::FHMOD != 0 {
            self.report(Register::Gusbcfg, "host mode is not modelled", "57.14");
        }
        self.registers.gusbcfg = value;
    }

    fn write_grstctl(&mut self, value: u32) {
        if value & grstctl::CSRST != 0 {
            self.reset();
            self.soft_reset_until = self.now + SOFT_RESET_NS;
            return;
        }
        let flushes = value & (grstctl::RXFFLSH | grstctl::TXFFLSH);
        if flushes != 0 && self.now < self.flush_until {
            let what = "flush before the previous flush has ended";
            self.report(Register::Grstctl, what, "57.14.5");
        }
        self.registers.grstctl = value & (0x1F << 6) | flushes;
        if value & grstctl::RXFFLSH != 0 {
            self.rx.clear();
        }
        if value & grstctl::TXFFLSH != 0 {
            self.flush_tx(grstctl::txfnum(value));
        }
        if flushes != 0 {
            self.flush_until = self.now + FLUSH_NS;
        }
    }

    fn flush_tx(&mut self, which: u32) {
        let all = which == grstctl::ALL_FIFOS;
        for n in 0..self.inputs.len() {
            if !all && self.inputs[n].fifo() != which as usize {
                continue;
            }
            let endpoint = &self.inputs[n].registers;
            let sends = endpoint.has(epctl::EPENA) && !endpoint.has(epctl::NAKSTS);
            if sends && self.bus.frames_from.is_some() && endpoint.has(epctl::USBAEP) {
                let what = format!("flush of FIFO {which} while IN endpoint {n} sends from it");
                self.report(Register::Grstctl, &what, "57.14.5, TXFFLSH");
            }
            self.inputs[n].flush();
        }
        if all {
            self.check_layout();
        }
    }

    fn clear_flags(&mut self, value: u32) {
        self.registers.gintsts &= !(value & gintsts::CLEARABLE);
        if value & gintsts::SOF != 0 {
            self.sof_cleared = self.now;
        }
        if value & gintsts::EOPF != 0 {
            self.eopf_cleared = self.now;
        }
    }

    fn write_dcfg(&mut self, value: u32) {
        self.registers.dcfg = value;
        if !self.bus.addressing {
            self.bus.address = value >> 4 & 0x7F;
        }
    }

    fn write_dctl(&mut self, value: u32) {
        let before = self.registers.dctl;
        let mut now = value & (dctl::RWUSIG | dctl::SDIS | dctl::POPRGDNE | 7 << 4);
        for (set, clear, state) in
            [(dctl::SGINAK, dctl::CGINAK, dctl::GINSTS), (dctl::SGONAK, dctl::CGONAK, dctl::GONSTS)]
        {
            if value & set != 0 && value & clear != 0 {
                let what = "a global NAK set and cleared at once";
                self.report(Register::Dctl, what, "57.14");
            }
            // The global IN NAK takes effect now. The global OUT NAK takes effect when software
            // reads its status word from the receive FIFO.
            let sets = value & set != 0 && state == dctl::GINSTS;
            if (before & state != 0 || sets) && value & clear == 0 {
                now |= state;
            }
        }
        if value & dctl::SGONAK != 0 {
            let frame = self.frame();
            self.rx.push(PacketStatus::GlobalOutNak, 0, false, frame, &[]);
        }
        self.registers.dctl = now;
        if before & dctl::SDIS != 0 && now & dctl::SDIS == 0 {
            self.check_connection();
        }
    }

    /// Checks the settings that software must have made before it connects the device to the host.
    fn check_connection(&mut self) {
        let (gccfg, dcfg) = (self.registers.gccfg, self.registers.dcfg);
        let (gusbcfg, pcgcctl) = (self.registers.gusbcfg, self.registers.pcgcctl);
        let kernel = self.supply.kernel_hz;
        let faults = [
            (gccfg & bit::PWRDWN == 0, "connected with the transceiver off (OTG_GCCFG.PWRDWN)"),
            (dcfg & 3 != 3, "connected with OTG_DCFG.DSPD not full speed"),
            (
                gusbcfg & bit::FDMOD == 0,
                "connected without OTG_GUSBCFG.FDMOD on a board without ID",
            ),
            (pcgcctl & bit::STPPCLK != 0, "connected with the PHY's clock stopped"),
        ];
        for (_, what) in faults.into_iter().filter(|(is_wrong, _)| *is_wrong) {
            self.report(Register::Dctl, what, "57.15.3");
        }
        if let Some(why) = self.supply.unwired {
            self.report(Register::Dctl, &format!("connected, but {why}"), "57.4");
        }
        if let Some(hz) = kernel.filter(|hz| !KERNEL_HZ.contains(hz)) {
            let what = format!("connected with a kernel clock of {hz} Hz, not 48 MHz +- 0.25 %");
            self.report(Register::Dctl, &what, "57.4; USB 2.0, 7.1.11");
        }
    }

    fn write_diepctl(&mut self, n: usize, value: u32) {
        let register = Register::Diepctl(n);
        let before = self.inputs[n].registers.control;
        self.check_pairs(register, value);
        if value & epctl::EPDIS != 0 && before & epctl::EPENA == 0 {
            let what = "EPDIS of an endpoint that is not enabled";
            self.report(register, what, "57.14");
        } else if value & epctl::EPDIS != 0 && before & epctl::NAKSTS == 0 {
            let what = "EPDIS before the endpoint's NAK is effective";
            self.report(register, what, PROGRAMMING);
        }
        let arms = value & epctl::EPENA != 0 && before & epctl::EPENA == 0;
        self.inputs[n].write_control(value);
        if arms {
            self.check_enabled(n);
        }
    }

    /// Checks the settings of IN endpoint `n`, which software has just enabled.
    fn check_enabled(&mut self, n: usize) {
        let register = Register::Diepctl(n);
        let endpoint = &self.inputs[n].registers;
        let (packets, bytes) = (endpoint.packet_count(), endpoint.transfer_size());
        let room = packets * u32::try_from(endpoint.max_packet()).unwrap_or_default();
        let is_active = endpoint.has(epctl::USBAEP);
        let turnaround = self.registers.gusbcfg >> 10 & 0xF;
        if packets == 0 {
            self.report(register, "enabled with PKTCNT 0", PROGRAMMING);
        } else if bytes > room {
            let what = format!("enabled for {bytes} bytes in {packets} packets");
            self.report(register, &what, PROGRAMMING);
        }
        if !is_active {
            let what = "enabled while it is not active (USBAEP)";
            self.report(register, what, PROGRAMMING);
        }
        if turnaround < 6 {
            let what = format!("TRDT is {turnaround}, less than 6");
            self.report(Register::Gusbcfg, &what, "57.14, OTG_GUSBCFG");
        }
        self.check_layout();
    }

    /// Checks that the FIFOs of all active endpoints lie in the FIFO memory and do not overlap.
    fn check_layout(&mut self) {
        let rx = Extent { start: 0, depth: self.registers.rx_depth };
        let mut used = vec![("the receive FIFO".to_owned(), rx)];
        for endpoint in self.inputs.iter().filter(|e| e.registers.has(epctl::USBAEP)) {
            let name = format!("transmit FIFO {}", endpoint.fifo());
            let value = self.registers.tx.get(endpoint.fifo()).copied().unwrap_or_default();
            if used.iter().all(|(known, _)| *known != name) {
                used.push((name, Extent::from_dieptxf(value)));
            }
        }
        if let Some(what) = layout_error(&used, self.instance.fifo_words) {
            self.report(Register::Grxfsiz, &what, "57.14, OTG_DIEPTXFx");
        }
    }

    fn write_doepctl(&mut self, n: usize, value: u32) {
        let register = Register::Doepctl(n);
        let before = self.outputs[n].control;
        self.check_pairs(register, value);
        if value & epctl::EPDIS != 0 {
            if n == 0 {
                self.report(register, "OUT endpoint 0 cannot be disabled", "57.14");
                return;
            }
            if before & epctl::EPENA == 0 {
                let what = "EPDIS of an endpoint that is not enabled";
                self.report(register, what, "57.14");
            } else if self.registers.dctl & dctl::GONSTS == 0 {
                let what = "EPDIS of an OUT endpoint without the global OUT NAK";
                self.report(register, what, PROGRAMMING);
            }
        }
        let arms = value & epctl::EPENA != 0 && before & epctl::EPENA == 0;
        self.outputs[n].write_control(value);
        let endpoint = &self.outputs[n];
        if arms && n != 0 && endpoint.packet_count() == 0 {
            self.report(register, "enabled with PKTCNT 0", PROGRAMMING);
        } else if arms && !endpoint.has(epctl::USBAEP) {
            let what = "enabled while it is not active (USBAEP)";
            self.report(register, what, PROGRAMMING);
        }
    }

    /// Checks that software does not set mutually exclusive bits in one write.
    fn check_pairs(&mut self, register: Register, value: u32) {
        for (pair, what) in [
            (epctl::CNAK | epctl::SNAK, "CNAK and SNAK at once"),
            (epctl::SD0PID | epctl::SD1PID, "SD0PID and SD1PID at once"),
        ] {
            if value & pair == pair {
                self.report(register, what, "57.14");
            }
        }
    }

    fn push_data(&mut self, n: usize, value: u32) {
        let register = Register::Fifo(n);
        if self.now < self.flush_until {
            self.report(register, "written during a flush", "57.14.5");
        }
        if self.inputs[n].words() >= self.tx_depth(n) {
            let what = "written while it is full (OTG_DTXFSTSx)";
            self.report(register, what, PROGRAMMING);
            return;
        }
        if !self.inputs[n].write_fifo(value) {
            let what = "written with no transfer enabled that needs the word";
            self.report(register, what, PROGRAMMING);
        }
    }
}
