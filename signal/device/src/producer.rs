//! Computes codes and the other requested streams from samples and steps.

use link::{Event, EventKind, Streams};
use pipeline::{Code, CodeValues, PackedCode, PackedEncoder, Quality, Rate, SignalQuality, Step};

use crate::acquired_sample::AcquiredSample;
use crate::audited_window::AuditedWindow;
use crate::compressed_chunk::Compressor;
use crate::encoders::Encoders;
use crate::filtered_chunk::FilteredChunk;
use crate::marks::{Marks, WindowMarks};
use crate::order::Run;
use crate::output::{Output, Payload};
use crate::raw_chunk::RawChunk;

/// Produces codes, and the other streams that the host requested, from acquired samples.
///
/// If a step is missing because a queue was full, the producer encodes the previous step again, with the time that the
/// missing one would have. The index of a window or block therefore still determines its time. Codes and blocks that
/// contain a repeated step are marked with an overrun.
///
/// An [`Output`] takes 2 KB whatever its payload. The functions that build an output are never
/// inlined, so that a task's stack frame does not hold several outputs at once.
///
/// An encoder runs only if the host has requested what it makes.
///
/// `E` is the memory of the encoders, or a reference to it. A board keeps the memory in a `static` and
/// passes a reference.
#[derive(Debug)]
pub struct Producer<E> {
    run: Run,
    encoders: E,
    /// Rate of the packed code.
    rate: Rate,
    quality: SignalQuality,
    windows: WindowMarks,
    /// Faults of the samples after the newest step.
    since_step: Marks,
    /// The newest step; repeated in place of missing steps.
    last: Step,
    raw: RawChunk,
    compressor: Compressor,
    filtered: FilteredChunk,
    audited: AuditedWindow,
    /// A captured event that is later than the newest sample; held until the sample that follows
    /// the event.
    ahead: Option<CapturedEvent>,
}

/// An edge at the trigger input, with its time from the capture hardware or from the interrupt
/// handler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapturedEvent {
    /// Input and direction of the edge.
    pub kind: EventKind,
    /// Number of the event since boot; wraps.
    pub number: u32,
    /// Device time of the edge, microseconds.
    pub at_us: u64,
}

impl<E: Encoders> Producer<E> {
    /// Creates a producer that waits for its first run; `encoders` must hold a memory before its first
    /// step, such as [`BothEncoders::EMPTY`](crate::BothEncoders::EMPTY).
    pub const fn new(encoders: E) -> Self {
        Self {
            run: Run::NONE,
            encoders,
            rate: <PackedEncoder>::DEFAULT_RATE,
            quality: SignalQuality::new(Run::NONE.mains),
            windows: WindowMarks::NONE,
            since_step: Marks::NONE,
            last: Step::SILENCE,
            raw: RawChunk::EMPTY,
            compressor: Compressor::NEW,
            filtered: FilteredChunk::EMPTY,
            audited: AuditedWindow::EMPTY,
            ahead: None,
        }
    }

    /// Sets the rate of the packed code from the next block on.
    pub const fn set_rate(&mut self, rate: Rate) {
        self.rate = rate;
    }

    /// Processes a sample and passes the results to `emit`.
    pub fn process(&mut self, acquired: &AcquiredSample, emit: &mut impl FnMut(Output)) {
        if let Some(run) = acquired.new_run {
            self.start_run(run, acquired.drdy_us);
        }
        self.windows.mark(acquired.lost);
        self.repeat_missing_steps(acquired, emit);
        let marks = acquired.marks.union(acquired.lost);
        self.windows.mark(marks);
        self.since_step = self.since_step.union(marks);
        if self.wants(Streams::RAW) || self.wants(Streams::COMPRESSED_RAW) {
            self.collect_raw(acquired, marks, emit);
        }
        if let Some(step) = &acquired.step {
            self.last = *step;
            let marks = core::mem::take(&mut self.since_step);
            if self.wants(Streams::FILTERED) {
                let index = acquired.step_index;
                self.collect_filtered((index, step), marks, acquired.drdy_us, emit);
            }
            self.encode(step, acquired.drdy_us, emit);
        }
        let quality = (self.quality).observe(&acquired.sample, acquired.step.as_ref());
        if let Some(quality) = quality {
            self.emit_quality(acquired.drdy_us, &quality, emit);
        }
    }

    /// Encodes the newest step again for each missing one before that of `acquired`. The faults of the lost samples
    /// may be in any of these steps.
    fn repeat_missing_steps(&mut self, acquired: &AcquiredSample, emit: &mut impl FnMut(Output)) {
        while self.windows.steps() < acquired.step_index {
            let (sample, at_us) = acquired.place_of_step(self.windows.steps());
            let substitute = Step {
                sample,
                offset_us: 0,
                ..self.last
            };
            self.windows.mark(Marks {
                overrun: true,
                ..acquired.lost
            });
            self.encode(&substitute, at_us, emit);
        }
    }

    /// Passes all events up to the time of `acquired` to `emit`, with the index of `acquired`.
    /// Later events wait for a later call.
    ///
    /// `next` returns the captured events one by one, oldest first. Call this method before
    /// [`Self::process`] of the same sample, so that the host receives an edge before the results
    /// of the sample. For the first sample of a run, call it after [`Self::process`], which starts
    /// the run.
    pub fn place_events(
        &mut self,
        acquired: &AcquiredSample,
        mut next: impl FnMut() -> Option<CapturedEvent>,
        emit: &mut impl FnMut(Output),
    ) {
        while let Some(captured) = self.ahead.take().or_else(&mut next) {
            if captured.at_us > acquired.drdy_us {
                self.ahead = Some(captured);
                return;
            }
            if self.wants(Streams::EVENTS) {
                let event = Event {
                    kind: captured.kind,
                    number: captured.number,
                    sample: acquired.index,
                };
                self.emit_event(captured.at_us, event, emit);
            }
        }
    }

    fn start_run(&mut self, run: Run, start_us: u64) {
        self.run = run;
        self.encoders.restart();
        self.quality.restart(run.mains);
        self.windows = WindowMarks::NONE;
        self.since_step = Marks::NONE;
        // Stands for steps that are missing at the start of the run: no signal, and not reliable.
        self.last = Step::SILENCE;
        self.last.settling = true;
        self.raw.clear();
        self.compressor.restart();
        self.filtered.clear();
        // Keep the held event only if it happened after the start of this run.
        self.ahead = self.ahead.take_if(|event| event.at_us >= start_us);
    }

    const fn wants(&self, stream: Streams) -> bool {
        self.run.streams.contains(stream)
    }

    /// Not inlined, so that an image contains the encoders once, although this is called in two places.
    #[inline(never)]
    fn encode(&mut self, step: &Step, drdy_us: u64, emit: &mut impl FnMut(Output)) {
        if self.wants(Streams::PACKED) {
            self.encode_block(step, drdy_us, emit);
        }
        let marks = self.windows.end_step();
        let audits = self.wants(Streams::AUDIT);
        if audits {
            self.audited.push_plane(&step.plane);
        }
        let mut values = None;
        if (audits || self.wants(Streams::CODES))
            && let Some(code) = self.encoders.encode_window(step)
        {
            values = Some(code.values);
            if self.wants(Streams::CODES) {
                let at_us = drdy_us + u64::from(code.offset_us);
                self.emit_code(at_us, &code, marks, emit);
            }
        }
        if audits
            && let Some(window) = self.windows.complete_window()
            && AuditedWindow::is_due(window)
        {
            let at_us = drdy_us + u64::from(step.offset_us);
            self.emit_audit((at_us, window), values.as_ref(), emit);
        }
    }

    fn encode_block(&mut self, step: &Step, drdy_us: u64, emit: &mut impl FnMut(Output)) {
        let marks = self.windows.newest_hop();
        if let Some(code) = self.encoders.encode_block(step, self.rate) {
            let at_us = drdy_us + u64::from(code.offset_us);
            self.emit_block(at_us, &code, marks, emit);
        }
    }

    fn collect_raw(
        &mut self,
        acquired: &AcquiredSample,
        marks: Marks,
        emit: &mut impl FnMut(Output),
    ) {
        if !self.raw.is_empty() && !self.raw.continues_with(acquired.index) {
            self.emit_samples(emit);
        }
        let AcquiredSample {
            sample,
            index,
            drdy_us,
            ..
        } = acquired;
        self.raw.append(sample, *index, marks, *drdy_us);
        if self.raw.is_full() {
            self.emit_samples(emit);
        }
    }

    fn emit_samples(&mut self, emit: &mut impl FnMut(Output)) {
        if self.wants(Streams::RAW) {
            self.emit_raw(emit);
        }
        if self.wants(Streams::COMPRESSED_RAW) {
            self.emit_compressed(emit);
        }
        self.raw.clear();
    }

    #[inline(never)]
    fn emit_raw(&self, emit: &mut impl FnMut(Output)) {
        self.emit(self.raw.last_us(), Payload::Raw(self.raw.clone()), emit);
    }

    #[inline(never)]
    fn emit_compressed(&mut self, emit: &mut impl FnMut(Output)) {
        let payload = Payload::CompressedRaw(self.compressor.compress(&self.raw));
        self.emit(self.raw.last_us(), payload, emit);
    }

    fn collect_filtered(
        &mut self,
        (index, step): (u64, &Step),
        marks: Marks,
        drdy_us: u64,
        emit: &mut impl FnMut(Output),
    ) {
        if !self.filtered.is_empty() && !self.filtered.continues_with(index) {
            self.emit_filtered(emit);
        }
        let at_us = drdy_us + u64::from(step.offset_us);
        self.filtered.append(step, index, marks, at_us);
        if self.filtered.is_full() {
            self.emit_filtered(emit);
        }
    }

    #[inline(never)]
    fn emit_filtered(&mut self, emit: &mut impl FnMut(Output)) {
        let payload = Payload::Filtered(self.filtered.clone());
        self.emit(self.filtered.last_us(), payload, emit);
        self.filtered.clear();
    }

    #[inline(never)]
    fn emit_audit(
        &mut self,
        (at_us, window): (u64, u32),
        values: Option<&CodeValues>,
        emit: &mut impl FnMut(Output),
    ) {
        let audited = self.audited.complete(window, values).clone();
        self.emit(at_us, Payload::Audit(audited), emit);
    }

    #[inline(never)]
    fn emit_code(&self, at_us: u64, code: &Code, marks: Marks, emit: &mut impl FnMut(Output)) {
        self.emit(at_us, Payload::Code(*code, marks), emit);
    }

    #[inline(never)]
    fn emit_block(
        &self,
        at_us: u64,
        code: &PackedCode,
        marks: Marks,
        emit: &mut impl FnMut(Output),
    ) {
        self.emit(at_us, Payload::PackedCode(*code, marks), emit);
    }

    #[inline(never)]
    fn emit_event(&self, at_us: u64, event: Event, emit: &mut impl FnMut(Output)) {
        self.emit(at_us, Payload::Event(event), emit);
    }

    #[inline(never)]
    fn emit_quality(&self, at_us: u64, quality: &Quality, emit: &mut impl FnMut(Output)) {
        self.emit(at_us, Payload::Quality(*quality), emit);
    }

    fn emit(&self, at_us: u64, payload: Payload, emit: &mut impl FnMut(Output)) {
        emit(Output {
            run: self.run.number,
            at_us,
            payload,
        });
    }
}

#[cfg(test)]
mod tests;
