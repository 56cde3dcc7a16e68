//! The trigger input: edges at set times, by the second half of the dual timer.

use core::cell::RefCell;

use critical_section::Mutex;
use link::EventKind;

use crate::{
    host_file::HostFile,
    registers::{DUAL_TIMER_SECOND, dual_timer},
    time_driver::{TICKS_PER_US, all_ticks},
};

/// The file: the input's edges, rising and falling in turn, each in microseconds behind the converter's
/// first DRDY; 64 bits, little endian.
pub(crate) const EDGES: &core::ffi::CStr = c"trigger.u64";

/// What the input does.
struct Trigger {
    file: HostFile,
    /// Ticks of the converter's first DRDY.
    origin: u64,
    /// What comes next, and its ticks.
    next: (EventKind, u64),
}

static TRIGGER: Mutex<RefCell<Option<Trigger>>> = Mutex::new(RefCell::new(None));

/// Lets the edges come; `origin` is when DRDY comes first, ticks.
pub(crate) fn begin(file: HostFile, origin: u64) {
    critical_section::with(|section| {
        let trigger = Trigger {
            file,
            origin,
            next: (EventKind::TriggerFall, 0),
        };
        let mut place = TRIGGER.borrow_ref_mut(section);
        *place = trigger.armed();
    });
}

/// The dual timer has rung: what has happened, and its device time in microseconds, as a timer's capture
/// would have it.
pub(crate) fn edge() -> Option<(EventKind, u64)> {
    DUAL_TIMER_SECOND.write(dual_timer::CLEAR, 1);
    critical_section::with(|section| {
        let mut place = TRIGGER.borrow_ref_mut(section);
        let trigger = place.take()?;
        let (kind, due) = trigger.next;
        *place = trigger.armed();
        Some((kind, due / u64::from(TICKS_PER_US)))
    })
}

impl Trigger {
    /// Lets the timer ring at the file's next edge, if there is one.
    fn armed(mut self) -> Option<Self> {
        let mut at_us = [0; 8];
        if !self.file.read(&mut at_us) {
            return None;
        }
        let due = self.origin + u64::from_le_bytes(at_us) * u64::from(TICKS_PER_US);
        let kind = match self.next.0 {
            EventKind::TriggerRise => EventKind::TriggerFall,
            EventKind::TriggerFall | EventKind::Newer(_) => EventKind::TriggerRise,
        };
        self.next = (kind, due);
        let wait = due.saturating_sub(all_ticks()).max(1);
        DUAL_TIMER_SECOND.write(dual_timer::CONTROL, 0);
        DUAL_TIMER_SECOND.write(dual_timer::LOAD, u32::try_from(wait).unwrap_or(u32::MAX));
        DUAL_TIMER_SECOND.write(dual_timer::CONTROL, dual_timer::RING_ONCE);
        Some(self)
    }
}
