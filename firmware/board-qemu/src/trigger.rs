//! Trigger input of the emulated board: the second half of the dual timer generates edges at times
//! from a file.

use core::cell::RefCell;

use critical_section::Mutex;
use link::EventKind;

use crate::{
    registers::{DUAL_TIMER_SECOND, dual_timer},
    semihosting::HostFile,
    time_driver::{TICKS_PER_US, ticks_since_boot},
};

/// Name of the file of edges, which alternately rise and fall, beginning with a rise. For each edge
/// the file holds the microseconds since the converter's first DRDY edge: 64 bits, little endian.
pub(crate) const EDGES: &core::ffi::CStr = c"trigger.u64";

/// State of the trigger input; `TRIGGER` is empty after the end of the file of edges.
struct Trigger {
    file: HostFile,
    /// Time of the converter's first DRDY edge, ticks.
    origin: u64,
    /// Kind of the next edge, and its time in ticks.
    next: (EventKind, u64),
}

static TRIGGER: Mutex<RefCell<Option<Trigger>>> = Mutex::new(RefCell::new(None));

/// Starts to generate the edges in `file`; `origin` is the time of the first DRDY edge, in ticks.
pub(crate) fn start(file: HostFile, origin: u64) {
    critical_section::with(|section| {
        let trigger = Trigger { file, origin, next: (EventKind::TriggerFall, 0) };
        let mut place = TRIGGER.borrow_ref_mut(section);
        *place = trigger.armed();
    });
}

/// Returns the edge that is due, and its device time in microseconds. The time comes from the file,
/// so an interrupt that runs late does not change it. Called when the second half of the dual timer
/// expires.
pub(crate) fn take_edge() -> Option<(EventKind, u64)> {
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
    /// Reads the next edge of the file and sets the timer to expire at its time. Returns `None` at
    /// the end of the file.
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
        let wait = due.saturating_sub(ticks_since_boot()).max(1);
        DUAL_TIMER_SECOND.write(dual_timer::CONTROL, 0);
        DUAL_TIMER_SECOND.write(dual_timer::LOAD, u32::try_from(wait).unwrap_or(u32::MAX));
        DUAL_TIMER_SECOND.write(dual_timer::CONTROL, dual_timer::RUN_ONCE);
        Some(self)
    }
}
