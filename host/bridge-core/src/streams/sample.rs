//! A stream of ADC samples or of filtered steps, published as NeuroFrames.

use link::{BlockForm, CompressedRaw, Flags, Raw};
use lossless::{Block, DecodeError, Decoder, Kind};
use neuro_ros::{NeuroFrame, TriWords};

use crate::settings::{FillerPolicy, Settings, StampPoint};
use crate::streams::hop_timeline::{Continuity, MissingStretch};
use crate::streams::ledger::SampleCounts;
use crate::streams::rows::NextRow;
use crate::streams::stamps::{MonotoneStamps, Reception};

/// Largest part of a gap that is filled, seconds. At 16 frames per second this takes 1,920 frames,
/// which fit into a subscriber's queue. After a longer gap a new recording is needed.
const MAX_FILL_SECONDS: u64 = 120;

/// Converts ADC samples to NeuroFrames of `/neurodata`, or filtered steps to NeuroFrames of
/// `/neurodata_corticode`, and fills gaps. In this file, "sample" means an ADC sample or a filtered
/// step.
///
/// Each sample has an index within the topic. The index continues when the device restarts, and the
/// time between two runs of the device is filled. The index of a frame's first sample is always a
/// multiple of the number of samples per frame, so the number of samples on the topic matches the
/// time that has passed. Sequence numbers and counts continue when the device restarts.
#[derive(Debug)]
pub(crate) struct SampleStream {
    filler: FillerPolicy,
    stamp: StampPoint,
    delay_us: u32,
    frame: NeuroFrame,
    nsamples: usize,
    electrodes: usize,
    /// Values of the newest sample or filler, uV; zeros before the first sample.
    newest: Vec<f32>,
    /// Index and device time of the newest received sample; fillers do not count.
    timeline: Option<SampleTimeline>,
    /// Number of samples in the unfinished frame.
    filled: usize,
    /// Whether the unfinished frame contains a filler.
    holds_filler: bool,
    /// Device time of the unfinished frame's first sample, microseconds.
    first_us: i128,
    /// Host time at which the unfinished frame's first sample was at the electrodes, microseconds,
    /// as fitted when that sample arrived; `None` without a fit. It replaces `first_us` if the
    /// device restarts before the frame is complete, because `first_us` is then meaningless.
    first_host_us: Option<f64>,
    /// Index, within the topic, of the next sample to publish.
    next: u64,
    /// Index, within the topic, of the present run's first sample; `None` from a restart of the
    /// device until its next message.
    run_start: Option<u64>,
    /// Device time of the present run's first sample, microseconds.
    run_us: i128,
    continuity: Continuity,
    /// Newest stretch of missing samples, until it is reported as an event.
    missing: Option<MissingStretch>,
    pub(crate) counts: SampleCounts,
    pub(crate) stamps: MonotoneStamps,
}

/// Consecutive samples that one message from the device contains.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Samples<'a> {
    /// Index of the message's first sample, counted by the device since `Start`.
    pub(crate) first: u64,
    pub(crate) flags: Flags,
    /// Values in uV, one sample after the other. Each sample has first the values of the
    /// electrodes, then the values of the spare channels.
    pub(crate) microvolts: &'a [f32],
}

/// Index and device time of one sample, from which the times of all other samples follow.
#[derive(Clone, Copy, Debug)]
struct SampleTimeline {
    index: u64,
    us: u64,
    rate_hz: u16,
}

impl SampleTimeline {
    /// Returns the device time of sample `index`, microseconds, rounded towards the known time.
    fn device_us_at(self, index: u64) -> i128 {
        let samples = i128::from(index) - i128::from(self.index);
        i128::from(self.us) + samples * 1_000_000 / i128::from(self.rate_hz.max(1))
    }
}

impl SampleStream {
    /// Creates a stream that publishes frames of the same shape as `frame`. The delay of the
    /// filters, `delay_us` microseconds, is subtracted from their stamps.
    pub(crate) fn new(frame: NeuroFrame, delay_us: u32, settings: Settings) -> SampleStream {
        let eeg = usize::from(frame.eeg.info.nchannels);
        let width = eeg + usize::from(frame.exg.info.nchannels);
        SampleStream {
            filler: settings.filler,
            stamp: settings.stamp,
            delay_us,
            nsamples: usize::from(frame.eeg.info.nsamples),
            electrodes: eeg,
            frame,
            newest: vec![0.0; width],
            timeline: None,
            filled: 0,
            holds_filler: false,
            first_us: 0,
            first_host_us: None,
            next: 0,
            run_start: Some(0),
            run_us: 0,
            continuity: Continuity::default(),
            missing: None,
            counts: SampleCounts::default(),
            stamps: MonotoneStamps::default(),
        }
    }

    /// Switches to another device with frames of the same shape, or to the same device with another
    /// mains frequency. Sequence numbers, counts and stamps continue.
    pub(crate) fn replace_device(&mut self, frame: NeuroFrame, delay_us: u32) {
        let numbers = (self.frame.header.seq, self.frame.neuroheader.seq);
        self.frame = frame;
        (self.frame.header.seq, self.frame.neuroheader.seq) = numbers;
        self.delay_us = delay_us;
        self.restart();
    }

    /// Starts another run. Call this when the device counts samples from 0 again. When the first
    /// sample of the new run arrives, the gap since the previous run is filled.
    pub(crate) fn restart(&mut self) {
        // If an event started the run but no sample arrived, the gap before the run has been
        // counted. Subtract the gap here, because the next run counts it again.
        let begun = self.run_start.take().unwrap_or(0);
        self.counts.between_runs -= begun.saturating_sub(self.next);
        self.timeline = None;
        self.continuity.end_run();
    }

    /// Ends the recording, because the user has stopped the stream. The samples of an unfinished
    /// frame are not published, and until the next start nothing is filled.
    pub(crate) fn end_recording(&mut self) {
        self.restart();
        self.count_unpublished(self.filled as u64);
        self.next = 0;
        self.filled = 0;
        self.run_start = Some(0);
        self.continuity = Continuity::default();
        self.newest.fill(0.0);
    }

    /// Adds `samples` to the number of samples that no published frame contains. Saturates, because
    /// a faulty device can skip 2^63 samples.
    fn count_unpublished(&mut self, samples: u64) {
        self.counts.unpublished = self.counts.unpublished.saturating_add(samples);
    }

    /// Returns the number of values in a sample: one for each electrode and spare channel.
    pub(crate) fn width(&self) -> usize {
        self.newest.len()
    }

    /// Removes and returns the stretch of missing samples that is not reported yet, if there is
    /// one.
    pub(crate) fn take_missing(&mut self) -> Option<MissingStretch> {
        self.missing.take()
    }

    /// Returns the number of samples that are missing since the last call of this method.
    pub(crate) fn missing_since_report(&mut self) -> u64 {
        let missing = self.counts.missing();
        missing.saturating_sub(std::mem::replace(&mut self.counts.reported, missing))
    }

    /// Counts a message that does not match the device, for the reason `why`. Its samples count as
    /// lost when the next valid message arrives.
    pub(crate) fn reject(&mut self, why: &str) {
        if self.counts.malformed == 0 {
            tracing::error!(
                "the device sends samples that do not match its capabilities ({why}); they are \
                 counted and not published; bring firmware and bridge to the same release"
            );
        }
        self.counts.malformed += 1;
    }

    /// Publishes the samples of a message, after fillers for the samples lost before them. The last
    /// sample was made at `reception.device_us`. `trigger_sample` converts the index of a sample in
    /// this stream to the index of an ADC sample, to find the trigger level.
    pub(crate) fn receive(
        &mut self,
        samples: Samples<'_>,
        trigger_sample: impl Fn(u64) -> u64,
        reception: Reception<'_>,
        publish: &mut dyn FnMut(&NeuroFrame),
    ) {
        let width = self.width();
        let count = (samples.microvolts.len() / width.max(1)) as u64;
        let Some(end) = samples.first.checked_add(count).filter(|_| count > 0) else {
            return self.reject("there are no samples, or their index is impossible");
        };
        let is_known = |start: u64| samples.first < self.next.saturating_sub(start);
        if self.run_start.is_some_and(is_known) {
            tracing::warn!(sample = samples.first, "the device restarted its samples");
            self.restart();
        }
        // If the message's device time is impossible, compute its last sample's time from the
        // index.
        let extrapolated = || {
            let last = self.run_start?.checked_add(end - 1)?;
            let us = self.timeline?.device_us_at(last).max(0);
            u64::try_from(us).ok()
        };
        let Some(us) = reception.device_us.or_else(extrapolated) else {
            return self.reject("their time is impossible");
        };
        let host_us = reception.clock.host_us(us.into());
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
        let host_us = host_us.unwrap_or(reception.read.monotonic_us as f64);
        if self.timeline.is_none() {
            let since_us = i128::from(end - 1) * 1_000_000 / i128::from(self.frame.sr.max(1));
            self.run_us = i128::from(us) - since_us;
        }
        #[expect(clippy::cast_precision_loss, reason = "below 2^53 (500,000 years)")]
        let first_us = host_us - (end - 1) as f64 * self.period_us();
        let start = self.begin_run(first_us);
        let Some(next) = start.checked_add(end) else {
            return self.reject("their index is impossible");
        };
        let timeline = SampleTimeline { index: next - 1, us, rate_hz: self.frame.sr };
        let mut batch = Batch {
            timeline,
            run_start: start,
            trigger_sample: &trigger_sample,
            reception,
            publish,
        };
        self.fill_gap(start + samples.first, &mut batch);
        for sample in samples.microvolts.chunks_exact(width) {
            self.newest.copy_from_slice(sample);
            self.append(samples.flags, &mut batch);
        }
        self.counts.received += count;
        self.timeline = Some(timeline);
        let run_us = reception.clock.host_us(self.run_us);
        self.continuity.record(host_us, run_us);
    }

    /// Returns the time from one sample to the next, microseconds.
    fn period_us(&self) -> f64 {
        1e6 / f64::from(self.frame.sr.max(1))
    }

    /// Returns the next row of the topic. `adc_rate_hz` is the rate of the ADC. `run_us` is the
    /// host time of the present run's ADC sample 0, microseconds, if an event of this run has
    /// revealed it. If no sample of the run has arrived yet, such an event starts the run.
    pub(crate) fn next_row(&mut self, adc_rate_hz: u16, run_us: Option<f64>) -> NextRow {
        if let Some(first_us) = run_us {
            self.begin_run(first_us);
        }
        let start = self.run_start.unwrap_or(self.next);
        #[expect(clippy::cast_precision_loss, reason = "below 2^53 (500,000 years)")]
        let since_start = self.next as f64 - start as f64;
        let since_start_us = since_start * self.period_us() - f64::from(self.delay_us);
        let rate = f64::from(adc_rate_hz);
        let frames = u64::from(self.frame.neuroheader.seq);
        NextRow {
            index: frames * self.nsamples as u64 + self.filled as u64,
            sample: since_start_us * 1e-6 * rate,
            samples_per_row: rate * 1e-6 * self.period_us(),
        }
    }

    /// Begins the device's next run, if it has not begun yet. Its first sample was made at the host
    /// time `first_us`, microseconds. Returns the index of this sample within the topic.
    fn begin_run(&mut self, first_us: f64) -> u64 {
        if let Some(start) = self.run_start {
            return start;
        }
        let period_us = self.period_us();
        let missing = self.continuity.missing_before(first_us, period_us);
        self.counts.between_runs += missing;
        let start = self.next.saturating_add(missing);
        self.run_start = Some(start);
        start
    }

    /// Appends fillers for all samples before `first`, the index of the message's first sample.
    fn fill_gap(&mut self, first: u64, batch: &mut Batch<'_>) {
        let missing = first - self.next;
        if missing == 0 {
            return;
        }
        tracing::debug!(missing, before = first, "samples missing");
        let lost = missing.min(first - batch.run_start);
        #[expect(clippy::cast_precision_loss, reason = "minutes are exact to the millisecond")]
        let seconds = missing as f32 / f32::from(self.frame.sr.max(1));
        self.missing = Some(MissingStretch {
            start_us: batch.timeline.device_us_at(self.next) - i128::from(self.delay_us),
            seconds,
            restarted: missing > lost,
        });
        self.counts.lost = self.counts.lost.saturating_add(lost);
        if self.filler == FillerPolicy::Zeros {
            self.newest.fill(0.0);
        }
        let nsamples = self.nsamples as u64;
        let to_boundary = (nsamples - self.filled as u64) % nsamples;
        let mut left = missing;
        for _ in 0..to_boundary.min(left) {
            self.append(Flags::FILLER, batch);
            left -= 1;
        }
        // If the gap is too long, skip as many whole frames as needed, which keeps frames aligned,
        // and fill the rest.
        let most = match self.filler {
            FillerPolicy::Off => 0,
            FillerPolicy::Last | FillerPolicy::Zeros => u64::from(self.frame.sr) * MAX_FILL_SECONDS,
        };
        if left > most {
            let skipped = (left - most) / nsamples * nsamples;
            self.next += skipped;
            left -= skipped;
            self.count_unpublished(skipped);
            if most > 0 && skipped > 0 {
                tracing::error!(
                    unfilled = skipped,
                    "the outage was too long to fill with samples; start a new recording"
                );
            }
        }
        for _ in 0..left {
            self.append(Flags::FILLER, batch);
        }
    }

    /// Appends the values in `newest` to the unfinished frame, and publishes it when it is full.
    fn append(&mut self, flags: Flags, batch: &mut Batch<'_>) {
        let us = batch.timeline.device_us_at(self.next);
        if self.filled == 0 {
            let clock = batch.reception.clock;
            self.first_us = us;
            self.first_host_us = clock.host_us(us - i128::from(self.delay_us));
            self.holds_filler = false;
        }
        self.holds_filler |= flags.contains(Flags::FILLER);
        let (eeg, exg) = self.newest.split_at(self.electrodes);
        let frame = &mut self.frame;
        let row = |width: usize| self.filled * width..(self.filled + 1) * width;
        frame.eeg.data[row(eeg.len())].copy_from_slice(eeg);
        frame.exg.data[row(exg.len())].copy_from_slice(exg);
        let frames = self.next / self.nsamples as u64;
        #[expect(clippy::cast_possible_truncation, reason = "wraps, like window indices")]
        let words = TriWords {
            flags: flags.bits(),
            window: frames as u32,
            device_time_us: u64::try_from(us).unwrap_or(0),
            lost: self.counts.missing(),
            trigger: batch
                .reception
                .trigger
                .level_at((batch.trigger_sample)(self.next.saturating_sub(batch.run_start))),
        };
        frame.tri.data[row(8)].copy_from_slice(&words.words());
        self.next += 1;
        self.filled += 1;
        if self.filled == self.nsamples {
            self.filled = 0;
            self.publish(batch);
        }
    }

    fn publish(&mut self, batch: &mut Batch<'_>) {
        if self.holds_filler && self.filler == FillerPolicy::Off {
            return self.count_unpublished(self.nsamples as u64);
        }
        let Reception { read, clock, .. } = batch.reception;
        let on_scalp_us = self.first_us - i128::from(self.delay_us);
        let is_of_run = self.next - self.nsamples as u64 >= batch.run_start;
        let time = match self.stamp {
            StampPoint::First if is_of_run => clock.wall_ns(on_scalp_us),
            StampPoint::First => self.first_host_us.map(|us| clock.wall_of_host_us(us)),
            StampPoint::Last => {
                let last_us = batch.timeline.device_us_at(self.next - 1);
                clock.wall_ns(last_us - i128::from(self.delay_us))
            }
            StampPoint::Arrival => Some(clock.wall_of_host_ns(read)),
        };
        let time = time.unwrap_or(read.wall_ns);
        let frame = &mut self.frame;
        frame.header.stamp = self.stamps.next(time, clock.wall_steps_back());
        frame.neuroheader.seq = frame.neuroheader.seq.wrapping_add(1);
        frame.header.seq = frame.neuroheader.seq;
        (batch.publish)(frame);
    }
}

/// What all samples of one message have in common while they are published.
struct Batch<'a> {
    timeline: SampleTimeline,
    /// Index, within the topic, of the first sample of the device's present run.
    run_start: u64,
    trigger_sample: &'a dyn Fn(u64) -> u64,
    reception: Reception<'a>,
    publish: &'a mut dyn FnMut(&NeuroFrame),
}

/// Largest number of channels that a message can state, and that the decoder has room for.
const CHANNELS: usize = u8::MAX as usize;

/// Decodes a message of compressed samples to a [`Raw`] message.
#[derive(Debug, Default)]
pub(crate) struct CompressedSamples {
    /// The decoder; `None` until the first message arrives.
    decoder: Option<Box<Decoder<CHANNELS>>>,
    /// Index of the first sample after the newest message.
    next: u64,
    /// Number of samples that arrived but could not be decoded, because a block that they continue
    /// from was lost. They also count as lost.
    pub(crate) undecodable: u64,
}

impl CompressedSamples {
    /// Forgets all decoded samples. Call this when the device counts samples from 0 again.
    pub(crate) fn forget(&mut self) {
        if let Some(decoder) = &mut self.decoder {
            decoder.forget();
        }
    }

    /// Decodes the samples of a message; `None` if the message continues from samples that were
    /// lost.
    ///
    /// # Errors
    ///
    /// [`Refusal`] if no correct device would send the message.
    pub(crate) fn decode<'d>(
        &'d mut self,
        message: &CompressedRaw,
    ) -> Result<Option<Raw<'d>>, Refusal> {
        let decoder = self.decoder.get_or_insert_with(|| Box::new(Decoder::NEW));
        if message.first_sample != self.next {
            decoder.forget();
        }
        let kind = match message.form {
            BlockForm::Verbatim => Kind::Verbatim,
            BlockForm::Key => Kind::Key,
            BlockForm::Continuing => Kind::Continuing,
            BlockForm::Newer(form) => {
                decoder.forget();
                return Err(Refusal::Form(form));
            }
        };
        let block = Block { kind, samples: message.samples.into(), bytes: message.bytes };
        let samples = u64::from(message.samples);
        self.next = message.first_sample.wrapping_add(samples);
        match decoder.decode(message.channels.into(), &block) {
            Ok(counts) => Ok(Some(Raw {
                first_sample: message.first_sample,
                channels: message.channels,
                flags: message.flags,
                counts: counts.as_flattened(),
            })),
            // A block was lost. After a restart, the indices may hide this, but the checksum
            // reveals that the block continues from samples that the decoder does not have.
            Err(DecodeError::NoKey | DecodeError::Sum) => {
                self.undecodable = self.undecodable.saturating_add(samples);
                Ok(None)
            }
            Err(error) => Err(Refusal::Block(error)),
        }
    }
}

/// Why a message of compressed samples was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Refusal {
    /// This bridge does not know the block's form, which has the given number.
    #[error("compressed samples have the unknown form {0}")]
    Form(u8),
    #[error("compressed samples cannot be decoded: {0}")]
    Block(DecodeError),
}
