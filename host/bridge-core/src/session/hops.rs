//! Handling of what a device makes once per hop: codes and packed blocks.

use link::{Code, PackedCode, Streams};

use crate::effects::Effects;
use crate::session::state::Session;
use crate::streams::stamps::Reception;
use crate::time::host_time::HostTime;

impl Session {
    /// Handles a code, whose last step was at device time `device_us`.
    pub(super) fn handle_code(
        &mut self,
        code: &Code,
        device_us: u64,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        let is_usable = self.expects_hops(read, effects);
        let Some(codes) = self.codes.as_mut().filter(|_| is_usable) else {
            self.counts.codes_unused += 1;
            return;
        };
        self.commands.stream_received(read.monotonic_us);
        if codes.is_restart(code) {
            self.side.restart_events();
        }
        let trusted = self.clock.observe(device_us, read);
        let reception = Reception {
            read,
            clock: &self.clock,
            trigger: &self.side.trigger,
        };
        codes.receive(code, trusted.then_some(device_us), reception, effects);
    }

    /// Handles a packed block, whose last step was at device time `device_us`.
    pub(super) fn handle_packed(
        &mut self,
        code: &PackedCode,
        device_us: u64,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        let is_usable = self.expects_hops(read, effects);
        let Some(packed) = self.packed.as_mut().filter(|_| is_usable) else {
            self.counts.codes_unused += 1;
            return;
        };
        self.commands.stream_received(read.monotonic_us);
        if packed.is_restart(code) {
            self.side.restart_events();
        }
        // The clock is fitted to codes. Packed blocks are used for the fit only until the first code arrives, or
        // where no codes stream.
        let has_codes = self.commands.streams().contains(Streams::CODES);
        let trusted = if has_codes && self.clock.is_known() {
            self.clock.is_possible(device_us, read)
        } else {
            self.clock.observe(device_us, read)
        };
        let reception = Reception {
            read,
            clock: &self.clock,
            trigger: &self.side.trigger,
        };
        packed.receive(code, trusted.then_some(device_us), reception, effects);
    }

    /// Returns whether codes and packed blocks of this device are published. Its stream may have started without
    /// an acknowledgement.
    fn expects_hops(&mut self, read: HostTime, effects: &mut dyn Effects) -> bool {
        let is_usable = self.introduced && self.commands.accepts_codes();
        if is_usable {
            self.announce_other_streams(read, effects);
        }
        is_usable
    }
}
