//! Computes codes and the other requested streams from samples and steps, for the session to send.

use link::{Event, EventKind, Exclusion, ExclusionPolicy, Streams};
use model::SUBSTITUTION;
use pipeline::{
    Code, FeatureExtractor, FeatureFilters, Features, PackedCode, PackedEncoder, Quality, Rate,
    SignalQuality, Step, Substitution,
};

use crate::acquired_sample::{AcquiredSample, Marks, WindowMarks};
use crate::audited_window::AuditedWindow;
use crate::board::Run;
use crate::chunk::{CompressedChunk, Compressor, FilteredChunk, RawChunk};
use crate::encoders::Encoders;
use crate::impedance::{HAS_IMPEDANCE, Impedance, ImpedanceMeasurement};
use crate::model_slot::UploadedWeights;

/// Produces codes, and the other streams that the host requested, from acquired samples.
///
/// If a step is missing because a queue was full, the producer encodes the previous step again, at
/// the time of the missing step. The index of a window or block therefore still determines its
/// time. Codes and blocks that contain a repeated step are marked with an overrun.
///
/// An [`Output`] borrows its content from the producer. An encoder runs only if the host has
/// requested its stream.
///
/// `E` is the memory of the encoders, or a reference to it: a board keeps the memory in a `static`.
#[derive(Debug)]
pub struct Producer<E> {
    run: Run,
    encoders: E,
    /// Quantiser rate of the packed blocks, which the host can change.
    rate: Rate,
    /// Computes band powers with the filters that the host has set.
    features: FeatureExtractor,
    quality: SignalQuality,
    /// Measures impedances while the host requests it; empty without the feature `impedance`.
    impedance: [ImpedanceMeasurement; HAS_IMPEDANCE as usize],
    /// Finds and fills bad electrodes; empty for a model without a table.
    substitution: [Substitution; SUBSTITUTION.is_some() as usize],
    /// The host's policy for the exclusion of electrodes.
    policy: ExclusionPolicy,
    /// Newest change of the excluded electrodes; `None` before the first step of a run.
    exclusion: Option<ExclusionChange>,
    /// Number of electrode values clipped to int8 in the encoded steps since boot; wraps.
    clipped: u32,
    windows: WindowMarks,
    /// Faults of the samples after the newest step.
    since_step: Marks,
    /// The newest step; repeated in place of missing steps.
    last: Step,
    raw: RawChunk,
    compressor: Compressor,
    filtered: FilteredChunk,
    audited: AuditedWindow,
    /// A captured event that is later than the newest sample; held until a sample follows it.
    ahead: Option<CapturedEvent>,
}

/// A result for the host, with the number of its run and the time for its frame. It borrows its
/// content from the producer: the receiver sends it, or copies it into a queue, before it returns.
#[derive(Clone, Copy, Debug)]
pub struct Output<'p> {
    /// [`Run::number`] of the run that produced this output.
    pub run: u32,
    /// Device time for the frame's header, microseconds.
    pub at_us: u64,
    /// Content, which the session turns into a message.
    pub payload: Payload<'p>,
}

impl Output<'_> {
    /// Returns true at the end of each second of a run: send `Stats` and `Timing` now.
    ///
    /// The producer counts seconds in samples and emits one [`Payload::Quality`] at the end of each
    /// second. `Stats`, `Timing` and `Quality` of a second therefore have the same device time, and
    /// the same samples always put them between the same codes. A timer on the device's clock would
    /// put them between varying codes.
    pub const fn ends_second(&self) -> bool {
        matches!(self.payload, Payload::Quality(_))
    }
}

/// Content of an [`Output`].
#[derive(Clone, Copy, Debug)]
pub enum Payload<'p> {
    /// A code, with its window's faults. [`Output::at_us`] is the time of the window's last step.
    Code(&'p Code, Marks),
    /// A packed block, with its faults. [`Output::at_us`] is the time of the block's last step.
    PackedCode(&'p PackedCode, Marks),
    /// Band powers of a hop, with its faults. [`Output::at_us`] is the time of the hop's last step.
    Features(&'p Features, Marks),
    /// An edge at the trigger input. [`Output::at_us`] is the time of the edge.
    Event(Event),
    /// The excluded electrodes, at each change and once a second. [`Output::at_us`] is the time of
    /// the step with the change or of the second's last sample.
    Exclusion(Exclusion),
    /// Signal quality of each electrode over the last second. [`Output::at_us`] is the time of the
    /// second's last sample.
    Quality(&'p Quality),
    /// Impedance of each electrode. [`Output::at_us`] is the time of the measurement's last sample.
    Impedance(&'p Impedance),
    /// Unfiltered samples. [`Output::at_us`] is the time of the last sample.
    Raw(&'p RawChunk),
    /// Unfiltered samples, compressed. [`Output::at_us`] is the time of the last sample.
    CompressedRaw(&'p CompressedChunk),
    /// Filtered steps. [`Output::at_us`] is the time of the last step.
    Filtered(&'p FilteredChunk),
    /// The planes of a window, one for each step, with its code if the device has the network.
    /// [`Output::at_us`] is the time of the window's last step.
    Audit(&'p AuditedWindow),
}

impl Payload<'_> {
    /// Returns whether this is the result of a hop: a code, a packed block or features.
    #[inline]
    pub const fn is_of_hop(&self) -> bool {
        matches!(self, Self::Code(..) | Self::PackedCode(..) | Self::Features(..))
    }
}

/// An edge at the trigger input, with its time from the capture hardware or the interrupt handler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapturedEvent {
    /// Input and direction of the edge.
    pub kind: EventKind,
    /// Sequence number of the event since boot; wraps.
    pub number: u32,
    /// Device time of the edge, microseconds.
    pub at_us: u64,
}

/// The excluded electrodes, and the index of the first step in which they are excluded.
#[derive(Clone, Copy, Debug)]
struct ExclusionChange {
    first_step: u64,
    excluded: u64,
}

impl<E: Encoders> Producer<E> {
    /// Creates a producer that waits for its first run. `encoders` must not have encoded a step
    /// yet; an example is [`BothEncoders::EMPTY`](crate::BothEncoders::EMPTY).
    pub const fn new(encoders: E) -> Self {
        Self {
            run: Run::NONE,
            encoders,
            rate: PackedEncoder::DEFAULT_RATE,
            features: FeatureExtractor::NEW,
            quality: SignalQuality::new(Run::NONE.mains),
            impedance: [const { ImpedanceMeasurement::NEW }; HAS_IMPEDANCE as usize],
            substitution: [const { Substitution::NEW }; SUBSTITUTION.is_some() as usize],
            policy: ExclusionPolicy::AUTOMATIC,
            exclusion: None,
            clipped: 0,
            windows: WindowMarks::NONE,
            since_step: Marks::NONE,
            last: Step::SILENCE,
            raw: RawChunk::EMPTY,
            compressor: Compressor::new(),
            filtered: FilteredChunk::EMPTY,
            audited: AuditedWindow::EMPTY,
            ahead: None,
        }
    }

    /// Sets the quantiser rate of the packed code from the next block on.
    pub const fn set_rate(&mut self, rate: Rate) {
        self.rate = rate;
    }

    /// Computes features with these filters from the next step on.
    pub fn set_filters(&mut self, filters: FeatureFilters) {
        self.features.set_filters(filters);
    }

    /// Sets the policy for the exclusion of electrodes, from the next window of [`Substitution`]
    /// on, which begins within half a second.
    pub const fn set_exclusion(&mut self, policy: ExclusionPolicy) {
        self.policy = policy;
    }

    /// Returns the number of electrode values clipped to int8 since boot in the steps that the
    /// encoders received: an excluded electrode counts only if its prediction is clipped. Wraps.
    pub const fn clipped(&self) -> u32 {
        self.clipped
    }

    /// Processes a sample, and passes each output that it completes to `emit`.
    pub fn process(&mut self, acquired: &AcquiredSample, emit: &mut impl FnMut(Output<'_>)) {
        self.process_with(None, acquired, emit);
    }

    /// Like [`Self::process`], but encodes packed blocks with the model `uploaded`, if there is
    /// one, and codes with its network, if it has one. All samples of a run need the same model.
    pub fn process_with(
        &mut self,
        uploaded: Option<&UploadedWeights<'_>>,
        acquired: &AcquiredSample,
        emit: &mut impl FnMut(Output<'_>),
    ) {
        if let Some(run) = acquired.new_run {
            self.start_run(run, acquired.drdy_us);
        }
        self.windows.mark(acquired.lost);
        self.repeat_missing_steps(uploaded, acquired, emit);
        let marks = acquired.marks.union(acquired.lost);
        self.windows.mark(marks);
        self.since_step = self.since_step.union(marks);
        for substitution in &mut self.substitution {
            substitution.observe_sample(&acquired.sample);
        }
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
            self.encode(uploaded, step, acquired.drdy_us, emit);
        }
        if let Some(quality) = (self.quality).observe(&acquired.sample, acquired.step.as_ref()) {
            self.emit(acquired.drdy_us, Payload::Quality(&quality), emit);
            self.emit_exclusion(acquired.drdy_us, emit);
        }
        let mut measurements = self.impedance.iter_mut();
        if let Some(impedance) = measurements.find_map(|one| one.observe(acquired)) {
            self.emit(acquired.drdy_us, Payload::Impedance(&impedance), emit);
        }
    }

    /// Encodes the newest step again for each step that is missing before the step of `acquired`.
    /// Marks all repeated steps with the faults of the lost samples, which can belong to any of
    /// these steps.
    fn repeat_missing_steps(
        &mut self,
        uploaded: Option<&UploadedWeights<'_>>,
        acquired: &AcquiredSample,
        emit: &mut impl FnMut(Output<'_>),
    ) {
        while self.windows.steps() < acquired.step_index {
            let (sample, at_us) = acquired.place_of_step(self.windows.steps());
            let substitute = Step { sample, offset_us: 0, ..self.last };
            self.windows.mark(Marks { overrun: true, ..acquired.lost });
            self.encode(uploaded, &substitute, at_us, emit);
        }
    }

    /// Passes all events up to the time of `acquired` to `emit`, with the sample index of
    /// `acquired`. Later events wait for a later call.
    ///
    /// `next` returns the captured events one by one, oldest first. Call this method before
    /// [`Self::process`] of the same sample, so that the host receives an edge before the results
    /// of the sample. For the first sample of a run, call it after [`Self::process`], which starts
    /// the run.
    pub fn place_events(
        &mut self,
        acquired: &AcquiredSample,
        mut next: impl FnMut() -> Option<CapturedEvent>,
        emit: &mut impl FnMut(Output<'_>),
    ) {
        while let Some(captured) = self.ahead.take().or_else(&mut next) {
            if captured.at_us > acquired.drdy_us {
                self.ahead = Some(captured);
                return;
            }
            if self.wants(Streams::EVENTS) {
                let event =
                    Event { kind: captured.kind, number: captured.number, sample: acquired.index };
                self.emit(captured.at_us, Payload::Event(event), emit);
            }
        }
    }

    fn start_run(&mut self, run: Run, start_us: u64) {
        self.run = run;
        self.encoders.restart();
        self.features.restart();
        self.quality.restart(run.mains);
        for substitution in &mut self.substitution {
            substitution.restart(run.mains);
        }
        self.exclusion = None;
        self.windows = WindowMarks::NONE;
        self.since_step = Marks::NONE;
        // This step replaces steps that are missing at the start of the run: it has no signal and
        // is marked as settling.
        self.last = Step::SILENCE;
        self.last.settling = true;
        self.raw.clear();
        self.compressor.restart();
        self.filtered.clear();
        // Keep the event that waits for a later sample only if it happened at or after the start of
        // this run.
        self.ahead = self.ahead.take_if(|event| event.at_us >= start_us);
    }

    const fn wants(&self, stream: Streams) -> bool {
        self.run.streams.contains(stream)
    }

    /// Encodes a step and emits the results that are due. Not inlined, because two places call it,
    /// and a firmware image should contain the encoders only once.
    #[inline(never)]
    fn encode(
        &mut self,
        uploaded: Option<&UploadedWeights<'_>>,
        step: &Step,
        drdy_us: u64,
        emit: &mut impl FnMut(Output<'_>),
    ) {
        let mut step = *step;
        self.fill(&mut step, drdy_us, emit);
        self.clipped = self.clipped.wrapping_add(step.clipped.into());
        let step = &step;
        if self.wants(Streams::PACKED) {
            let marks = self.windows.newest_hop();
            let packed = uploaded.map(|uploaded| &uploaded.packed);
            if let Some(code) = self.encoders.encode_block(step, self.rate, packed) {
                let at_us = drdy_us + u64::from(code.offset_us);
                self.emit(at_us, Payload::PackedCode(&code, marks), emit);
            }
        }
        if self.wants(Streams::FEATURES) {
            let marks = self.windows.newest_hop();
            if let Some(features) = self.features.add_step(step) {
                let at_us = drdy_us + u64::from(features.offset_us);
                self.emit(at_us, Payload::Features(&features, marks), emit);
            }
        }
        let marks = self.windows.end_step();
        let (codes, audits) = (self.wants(Streams::CODES), self.wants(Streams::AUDIT));
        if audits {
            self.audited.push_plane(&step.plane);
        }
        if !codes && !audits {
            return;
        }
        let network = uploaded.and_then(|uploaded| uploaded.network.as_ref());
        let code = self.encoders.encode_window(step, network);
        if codes && let Some(code) = &code {
            let at_us = drdy_us + u64::from(code.offset_us);
            self.emit(at_us, Payload::Code(code, marks), emit);
        }
        if audits
            && let Some(window) = self.windows.complete_window()
            && AuditedWindow::is_due(window)
        {
            let at_us = drdy_us + u64::from(step.offset_us);
            (self.audited).complete(window, code.as_ref().map(|code| &code.values));
            self.emit(at_us, Payload::Audit(&self.audited), emit);
        }
    }

    /// Fills the bad electrodes of a step. Reports the excluded electrodes at the first step of a
    /// run, and at each change, before the first code that contains the change.
    fn fill(&mut self, step: &mut Step, drdy_us: u64, emit: &mut impl FnMut(Output<'_>)) {
        let (Some(table), [substitution]) = (&SUBSTITUTION, &mut self.substitution[..]) else {
            return;
        };
        let ExclusionPolicy { always, never, automatic } = self.policy;
        let policy = pipeline::ExclusionPolicy { always, never, automatic };
        substitution.fill_step(step, policy, table);
        let excluded = step.excluded;
        self.windows.mark(Marks { substituted: excluded != 0, ..Marks::NONE });
        if self.exclusion.is_none_or(|newest| newest.excluded != excluded) {
            let first_step = self.windows.steps();
            self.exclusion = Some(ExclusionChange { first_step, excluded });
            self.emit_exclusion(drdy_us, emit);
        }
    }

    /// Emits the newest change of the excluded electrodes.
    fn emit_exclusion(&self, at_us: u64, emit: &mut impl FnMut(Output<'_>)) {
        let Some(ExclusionChange { first_step, excluded }) = self.exclusion else {
            return;
        };
        let exclusion = Exclusion { first_step, excluded, policy: self.policy };
        self.emit(at_us, Payload::Exclusion(exclusion), emit);
    }

    fn collect_raw(
        &mut self,
        acquired: &AcquiredSample,
        marks: Marks,
        emit: &mut impl FnMut(Output<'_>),
    ) {
        if self.raw.ends_before(acquired.index) {
            self.emit_samples(emit);
        }
        self.raw.append_sample(acquired, marks);
        if self.raw.is_full() {
            self.emit_samples(emit);
        }
    }

    fn emit_samples(&mut self, emit: &mut impl FnMut(Output<'_>)) {
        let at_us = self.raw.last_us();
        if self.wants(Streams::RAW) {
            self.emit(at_us, Payload::Raw(&self.raw), emit);
        }
        if self.wants(Streams::COMPRESSED_RAW) {
            self.compressor.compress(&self.raw);
            self.emit(at_us, Payload::CompressedRaw(self.compressor.chunk()), emit);
        }
        self.raw.clear();
    }

    fn collect_filtered(
        &mut self,
        (index, step): (u64, &Step),
        marks: Marks,
        drdy_us: u64,
        emit: &mut impl FnMut(Output<'_>),
    ) {
        if self.filtered.ends_before(index) {
            self.emit_filtered(emit);
        }
        let at_us = drdy_us + u64::from(step.offset_us);
        self.filtered.append_step(step, index, marks, at_us);
        if self.filtered.is_full() {
            self.emit_filtered(emit);
        }
    }

    fn emit_filtered(&mut self, emit: &mut impl FnMut(Output<'_>)) {
        let payload = Payload::Filtered(&self.filtered);
        self.emit(self.filtered.last_us(), payload, emit);
        self.filtered.clear();
    }

    fn emit(&self, at_us: u64, payload: Payload<'_>, emit: &mut impl FnMut(Output<'_>)) {
        emit(Output { run: self.run.number, at_us, payload });
    }
}
