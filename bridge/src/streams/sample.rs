//! From samples to frames of `/neurodata` or `/neurodata_filtered`, losses filled.

use link::Flags;
use neuro_ros::NeuroFrame;

use crate::settings::{FillerPolicy, Settings, StampPoint};
use crate::streams::stamps::{MonotoneStamps, Reception};
use crate::streams::tri::TriWords;

/// Longest gap that is filled, seconds of samples: 1920 frames at 16 per second, fewer than wait for
/// a slow subscriber. A longer outage is a new recording.
const MAX_FILL_SECONDS: u64 = 120;

/// From samples (or steps) to frames, losses filled; shape and numbering of one session.
///
/// Every frame begins at a multiple of its length, so the samples on the topic are those of time.
#[derive(Debug)]
pub(crate) struct SampleStream {
    filler: FillerPolicy,
    stamp: StampPoint,
    delay_us: u32,
    frame: NeuroFrame,
    nsamples: usize,
    electrodes: usize,
    /// The newest sample of this stream; zeros before the first.
    newest: Vec<f32>,
    /// Where and when the newest sample that came was taken.
    timeline: Option<SampleTimeline>,
    /// Samples in the frame.
    filled: usize,
    holds_filler: bool,
    first_us: i128,
    /// Index of the next sample.
    next: u64,
    counts: SampleCounts,
    stamps: MonotoneStamps,
}

/// What happened to samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SampleCounts {
    pub(crate) received: u64,
    pub(crate) lost: u64,
    /// Samples that are in no frame: what was in an unfinished one when its stream ended; lost ones
    /// beyond [`MAX_FILL_SECONDS`] of one gap; without fillers, all of a frame that would hold a lost
    /// one.
    pub(crate) unpublished: u64,
    /// Messages whose content does not fit the device.
    pub(crate) malformed: u64,
    /// Lost samples that `/diagnostics` has told of.
    pub(crate) reported: u64,
}

/// Samples that came.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Samples<'a> {
    /// Index since Start of the first one.
    pub(crate) first: u64,
    pub(crate) flags: Flags,
    /// Device time of the last one; none if it cannot be right.
    pub(crate) last_us: Option<u64>,
    /// Sample by sample, electrodes and then spare channels, uV.
    pub(crate) microvolts: &'a [f32],
}

/// Where in time each sample lies.
#[derive(Clone, Copy, Debug)]
struct SampleTimeline {
    index: u64,
    us: u64,
    rate_hz: u16,
}

impl SampleTimeline {
    /// Device time of a sample, microseconds, rounded towards that of the known one.
    fn device_us_at(self, index: u64) -> i128 {
        let samples = i128::from(index) - i128::from(self.index);
        i128::from(self.us) + samples * 1_000_000 / i128::from(self.rate_hz.max(1))
    }
}

impl SampleStream {
    /// For frames like `frame`, whose samples show what happened `delay_us` before.
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
            next: 0,
            counts: SampleCounts::default(),
            stamps: MonotoneStamps::default(),
        }
    }

    /// Another device of the same shape, or the same one with other mains: numbers, counts and
    /// stamps go on.
    pub(crate) fn replace_device(&mut self, frame: NeuroFrame, delay_us: u32) {
        let numbers = (self.frame.header.seq, self.frame.neuroheader.seq);
        self.frame = frame;
        (self.frame.header.seq, self.frame.neuroheader.seq) = numbers;
        self.delay_us = delay_us;
        self.restart();
    }

    /// The device begins its stream anew: samples count from 0. What was in an unfinished frame
    /// stays away.
    pub(crate) fn restart(&mut self) {
        self.count_unpublished(self.filled as u64);
        self.next = 0;
        self.filled = 0;
        self.timeline = None;
        self.newest.fill(0.0);
    }

    /// Samples that will be in no frame; a device that jumps by 2^63 samples has more than can be
    /// counted.
    fn count_unpublished(&mut self, samples: u64) {
        self.counts.unpublished = self.counts.unpublished.saturating_add(samples);
    }

    /// Channels of a sample.
    pub(crate) fn width(&self) -> usize {
        self.newest.len()
    }

    pub(crate) fn counts(&self) -> &SampleCounts {
        &self.counts
    }

    /// Stamps that had to be moved forwards.
    pub(crate) fn moved_stamps(&self) -> u64 {
        self.stamps.moved()
    }

    /// Lost samples since this was asked last.
    pub(crate) fn lost_since_report(&mut self) -> u64 {
        let reported = std::mem::replace(&mut self.counts.reported, self.counts.lost);
        self.counts.lost - reported
    }

    /// A message came whose content does not fit the device: its samples will be missing.
    pub(crate) fn reject(&mut self, why: &str) {
        if self.counts.malformed == 0 {
            tracing::error!(
                "the device sends samples that do not fit its capabilities ({why}); they are left \
                 out and counted; bring firmware and bridge to the same release"
            );
        }
        self.counts.malformed += 1;
    }

    /// Samples came, whole ones: `trigger_sample` says which ADC sample belongs to an index.
    pub(crate) fn receive(
        &mut self,
        samples: Samples<'_>,
        trigger_sample: impl Fn(u64) -> u64,
        reception: Reception<'_>,
        publish: &mut dyn FnMut(&NeuroFrame),
    ) {
        let width = self.width();
        let count = samples.microvolts.len() / width.max(1);
        let Some(last) = samples
            .first
            .checked_add(count as u64)
            .filter(|_| count > 0)
        else {
            return self.reject("no samples, or an index that cannot be");
        };
        let last = last - 1;
        if samples.first < self.next {
            tracing::warn!(sample = samples.first, "the device began its samples anew");
            self.restart();
        }
        let rate_hz = self.frame.sr;
        let extrapolated = |known: SampleTimeline| {
            let us = known.device_us_at(last).max(0);
            u64::try_from(us).unwrap_or(u64::MAX)
        };
        let Some(us) = samples.last_us.or_else(|| self.timeline.map(extrapolated)) else {
            return self.reject("a time that cannot be");
        };
        let timeline = SampleTimeline {
            index: last,
            us,
            rate_hz,
        };
        let mut batch = Batch {
            timeline,
            trigger_sample: &trigger_sample,
            reception,
            publish,
        };
        self.fill_gap(samples.first - self.next, &mut batch);
        for sample in samples.microvolts.chunks_exact(width) {
            self.newest.copy_from_slice(sample);
            self.append(samples.flags, &mut batch);
        }
        self.counts.received += count as u64;
        self.timeline = Some(timeline);
    }

    /// Made-up samples in place of the `lost` ones before those that came.
    fn fill_gap(&mut self, lost: u64, batch: &mut Batch<'_>) {
        if lost == 0 {
            return;
        }
        tracing::debug!(lost, before = self.next + lost, "samples lost");
        self.counts.lost = self.counts.lost.saturating_add(lost);
        if self.filler == FillerPolicy::Zeros {
            self.newest.fill(0.0);
        }
        let nsamples = self.nsamples as u64;
        let to_boundary = (nsamples - self.filled as u64) % nsamples;
        let mut left = lost;
        for _ in 0..to_boundary.min(left) {
            self.append(Flags::FILLER, batch);
            left -= 1;
        }
        // Nothing is published of a gap that is not filled, but for what is left of its last frame.
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

    /// The newest sample is the next one of the frame.
    fn append(&mut self, flags: Flags, batch: &mut Batch<'_>) {
        let us = batch.timeline.device_us_at(self.next);
        if self.filled == 0 {
            self.first_us = us;
            self.holds_filler = false;
        }
        self.holds_filler |= flags.contains(Flags::FILLER);
        let (eeg, exg) = self.newest.split_at(self.electrodes);
        let frame = &mut self.frame;
        let row = |width: usize| self.filled * width..(self.filled + 1) * width;
        frame.eeg.data[row(eeg.len())].copy_from_slice(eeg);
        frame.exg.data[row(exg.len())].copy_from_slice(exg);
        let frames = self.next / self.nsamples as u64;
        #[expect(clippy::cast_possible_truncation, reason = "wraps, as windows do")]
        let words = TriWords {
            flags: flags.bits(),
            window: frames as u32,
            device_time_us: u64::try_from(us).unwrap_or(0),
            lost: self.counts.lost,
            trigger: batch
                .reception
                .trigger
                .level_at((batch.trigger_sample)(self.next)),
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
        let length_us = self.nsamples.saturating_sub(1) as i128 * 1_000_000;
        let on_scalp_us = self.first_us - i128::from(self.delay_us);
        let time = match self.stamp {
            StampPoint::First => clock.wall_ns(on_scalp_us),
            StampPoint::Last => {
                let rate_hz = i128::from(self.frame.sr.max(1));
                clock.wall_ns(on_scalp_us + length_us / rate_hz)
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

/// What samples meet on their way into a frame.
struct Batch<'a> {
    timeline: SampleTimeline,
    trigger_sample: &'a dyn Fn(u64) -> u64,
    reception: Reception<'a>,
    publish: &'a mut dyn FnMut(&NeuroFrame),
}
