//! Interrupt flags, most of which are derived from the state of the core.

use super::Core;
use crate::usb::register::{dctl, gintsts};

/// Duration of a frame at full speed, in ns.
const FRAME_NS: u64 = 1_000_000;
/// Time from the start of a frame to the end of the periodic frame, in ns: 80 % of the frame (`PFIVL` =
/// 0b00).
const EOPF_NS: u64 = 800_000;

impl Core {
    /// Returns the number of the current frame: 11 bits at full speed.
    pub(super) fn frame(&self) -> u32 {
        let passed = self
            .bus
            .frames_from
            .map_or(0, |from| self.now.saturating_sub(from) / FRAME_NS);
        u32::try_from((self.bus.first_frame + passed) & 0x7FF).unwrap_or_default()
    }

    /// Returns whether, since the time `cleared` in ns, any frame has reached the point `offset` ns after
    /// its start.
    fn frame_instant_since(&self, cleared: u64, offset: u64) -> bool {
        self.bus.frames_from.is_some_and(|from| {
            let count = |at: u64| {
                at.checked_sub(from + offset)
                    .map_or(0, |d| d / FRAME_NS + 1)
            };
            count(self.now) > count(cleared)
        })
    }

    /// Returns the next time at which one of the frame flags `wanted` is set, in ns.
    pub(super) fn next_frame_event(&self, wanted: u32) -> Option<u64> {
        let from = self.bus.frames_from?;
        let next = |offset: u64| {
            let first = from + offset;
            let passed = self.now.checked_sub(first).map_or(0, |d| d / FRAME_NS + 1);
            first + passed * FRAME_NS
        };
        let sof = (wanted & gintsts::SOF != 0).then(|| next(0));
        let eopf = (wanted & gintsts::EOPF != 0).then(|| next(EOPF_NS));
        sof.into_iter().chain(eopf).min()
    }

    /// Returns the value of `OTG_GINTSTS`: the latched flags and those derived from the current state.
    pub(super) fn gintsts(&self) -> u32 {
        let mut flags = self.registers.gintsts;
        let mut set = |bit: u32, on: bool| {
            if on {
                flags |= bit;
            }
        };
        set(gintsts::OTGINT, self.registers.gotgint != 0);
        set(gintsts::SOF, self.frame_instant_since(self.sof_cleared, 0));
        set(
            gintsts::EOPF,
            self.frame_instant_since(self.eopf_cleared, EOPF_NS),
        );
        set(gintsts::RXFLVL, !self.rx.is_empty());
        set(gintsts::NPTXFE, self.tx_fifo_has_room(0));
        set(gintsts::GINAKEFF, self.registers.dctl & dctl::GINSTS != 0);
        set(gintsts::GONAKEFF, self.registers.dctl & dctl::GONSTS != 0);
        let endpoints = self.daint() & self.registers.daintmsk;
        set(gintsts::IEPINT, endpoints & 0xFFFF != 0);
        set(gintsts::OEPINT, endpoints >> 16 != 0);
        flags
    }

    /// Returns the value of `OTG_DAINT`: endpoints with an unmasked flag, IN in bits 15:0, OUT in bits 31:16.
    pub(super) fn daint(&self) -> u32 {
        let held = &self.registers;
        let inputs = (0..self.inputs.len()).filter(|&n| {
            self.inputs[n].registers.flags & held.diepmsk != 0
                || held.diepempmsk & 1 << n != 0 && self.tx_fifo_has_room(n)
        });
        let outputs = (0..self.outputs.len())
            .filter(|&n| self.outputs[n].registers.flags & held.doepmsk != 0);
        inputs.fold(0, |all, n| all | 1 << n) | outputs.fold(0, |all, n| all | 1 << (16 + n))
    }
}
