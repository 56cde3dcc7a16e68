//! What is made of samples and steps.

use core::borrow::BorrowMut;

use link::{Event, EventKind, Streams};
use pipeline::{Code, CodeValues, Encoder, EncoderMemory, Quality, SignalQuality, Step};

use crate::marks::WindowMarks;
use crate::{AuditedWindow, FilteredChunk, Made, Marks, RawChunk, Run, Taken, What};

/// Makes codes, and everything else that the host has asked for, of what the acquisition takes.
///
/// A step for which there was no room is filled in by the one before it, so that a window's index
/// stays that of its time; its codes are marked.
///
/// What is made takes two kilobytes on its way out, whatever it is: what gives it is never part of its
/// caller, so that a task's frame does not hold all of them at once.
///
/// `M` is the encoder's memory, or a reference to it: a board keeps it in a static.
#[derive(Debug)]
pub struct Producer<M = &'static mut EncoderMemory> {
    run: Run,
    encoder: Encoder<'static, M>,
    quality: SignalQuality,
    windows: WindowMarks,
    /// What went wrong since the last step that was filtered.
    since_step: Marks,
    /// The last step, in place of one that is missing.
    last: Step,
    raw: RawChunk,
    filtered: FilteredChunk,
    audited: AuditedWindow,
    /// An event that is later than the newest sample.
    ahead: Option<Captured>,
}

/// Something that happened at an input, as it was captured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Captured {
    /// What it was.
    pub kind: EventKind,
    /// Number of the event since boot, wraps.
    pub number: u32,
    /// Device time, microseconds.
    pub at_us: u64,
}

impl<M: BorrowMut<EncoderMemory>> Producer<M> {
    /// Before the first run; with the encoder's memory, which is empty.
    pub const fn new(memory: M) -> Self {
        Self {
            run: Run::NONE,
            encoder: Encoder::with_memory(memory),
            quality: SignalQuality::new(Run::NONE.mains),
            windows: WindowMarks::NONE,
            since_step: Marks::NONE,
            last: Step::SILENCE,
            raw: RawChunk::EMPTY,
            filtered: FilteredChunk::EMPTY,
            audited: AuditedWindow::EMPTY,
            ahead: None,
        }
    }

    /// Takes a sample, and gives what there is with it for the host.
    pub fn take(&mut self, taken: &Taken, hand_on: &mut impl FnMut(Made)) {
        if let Some(run) = taken.begun {
            self.begin(run, taken.drdy_us);
        }
        self.windows.mark(taken.marks);
        self.since_step = self.since_step.or(taken.marks);
        if self.wants(Streams::RAW) {
            self.take_raw(taken, hand_on);
        }
        if let Some((index, step)) = &taken.step {
            while self.windows.steps() < *index {
                let substitute = self.last;
                self.windows.mark(Marks {
                    overrun: true,
                    ..Marks::NONE
                });
                self.encode(&substitute, taken.drdy_us, hand_on);
            }
            self.last = *step;
            let marks = core::mem::take(&mut self.since_step);
            if self.wants(Streams::FILTERED) {
                self.take_filtered((*index, step), marks, taken.drdy_us, hand_on);
            }
            self.encode(step, taken.drdy_us, hand_on);
        }
        let step = taken.step.as_ref().map(|(_, step)| step);
        if let Some(quality) = self.quality.observe(&taken.sample, step) {
            self.give_quality(taken.drdy_us, &quality, hand_on);
        }
    }

    /// Places what has happened at an input before a sample; `next` gives what was captured, the oldest
    /// first. Comes before [`Self::take`] of the same sample, so that the host knows of an edge when it
    /// reads what was made of the sample; but after that of a run's first sample, which begins the run.
    pub fn place(
        &mut self,
        taken: &Taken,
        mut next: impl FnMut() -> Option<Captured>,
        hand_on: &mut impl FnMut(Made),
    ) {
        while let Some(captured) = self.ahead.take().or_else(&mut next) {
            if captured.at_us > taken.drdy_us {
                self.ahead = Some(captured);
                return;
            }
            if self.wants(Streams::EVENTS) {
                let event = Event {
                    kind: captured.kind,
                    number: captured.number,
                    sample: taken.index,
                };
                self.give_event(captured.at_us, event, hand_on);
            }
        }
    }

    fn begin(&mut self, run: Run, begin_us: u64) {
        self.run = run;
        self.encoder.restart();
        self.quality.restart(run.mains);
        self.windows = WindowMarks::NONE;
        self.since_step = Marks::NONE;
        self.raw.clear();
        self.filtered.clear();
        // What happened before the run is of no interest; what is ahead of its first sample as well is.
        self.ahead = self.ahead.take_if(|event| event.at_us >= begin_us);
    }

    const fn wants(&self, stream: Streams) -> bool {
        self.run.streams.contains(stream)
    }

    fn encode(&mut self, step: &Step, drdy_us: u64, hand_on: &mut impl FnMut(Made)) {
        let code = self.encoder.encode_step(step);
        let marks = self.windows.step();
        let audits = self.wants(Streams::AUDIT);
        if audits {
            self.audited.push(&step.plane);
        }
        let Some(code) = code else { return };
        let at_us = drdy_us + u64::from(code.offset_us);
        let (window, values) = (code.window, code.values);
        if self.wants(Streams::CODES) {
            self.give_code(at_us, &code, marks, hand_on);
        }
        if audits && AuditedWindow::is_due(window) {
            self.give_audit((at_us, window), &values, hand_on);
        }
    }

    fn take_raw(&mut self, taken: &Taken, hand_on: &mut impl FnMut(Made)) {
        if !self.raw.is_empty() && !self.raw.goes_on_with(taken.index) {
            self.give_raw(hand_on);
        }
        let Taken {
            sample,
            index,
            marks,
            drdy_us,
            ..
        } = taken;
        self.raw.push(sample, *index, *marks, *drdy_us);
        if self.raw.is_full() {
            self.give_raw(hand_on);
        }
    }

    #[inline(never)]
    fn give_raw(&mut self, hand_on: &mut impl FnMut(Made)) {
        self.give(self.raw.last_us(), What::Raw(self.raw.clone()), hand_on);
        self.raw.clear();
    }

    fn take_filtered(
        &mut self,
        (index, step): (u64, &Step),
        marks: Marks,
        drdy_us: u64,
        hand_on: &mut impl FnMut(Made),
    ) {
        if !self.filtered.is_empty() && !self.filtered.goes_on_with(index) {
            self.give_filtered(hand_on);
        }
        let at_us = drdy_us + u64::from(step.offset_us);
        self.filtered.push(step, index, marks, at_us);
        if self.filtered.is_full() {
            self.give_filtered(hand_on);
        }
    }

    #[inline(never)]
    fn give_filtered(&mut self, hand_on: &mut impl FnMut(Made)) {
        let what = What::Filtered(self.filtered.clone());
        self.give(self.filtered.last_us(), what, hand_on);
        self.filtered.clear();
    }

    #[inline(never)]
    fn give_audit(
        &mut self,
        (at_us, window): (u64, u32),
        values: &CodeValues,
        hand_on: &mut impl FnMut(Made),
    ) {
        let audited = self.audited.complete(window, values).clone();
        self.give(at_us, What::Audit(audited), hand_on);
    }

    #[inline(never)]
    fn give_code(&self, at_us: u64, code: &Code, marks: Marks, hand_on: &mut impl FnMut(Made)) {
        self.give(at_us, What::Code(*code, marks), hand_on);
    }

    #[inline(never)]
    fn give_event(&self, at_us: u64, event: Event, hand_on: &mut impl FnMut(Made)) {
        self.give(at_us, What::Event(event), hand_on);
    }

    #[inline(never)]
    fn give_quality(&self, at_us: u64, quality: &Quality, hand_on: &mut impl FnMut(Made)) {
        self.give(at_us, What::Quality(*quality), hand_on);
    }

    fn give(&self, at_us: u64, what: What, hand_on: &mut impl FnMut(Made)) {
        hand_on(Made {
            run: self.run.number,
            at_us,
            what,
        });
    }
}

#[cfg(test)]
mod tests;
