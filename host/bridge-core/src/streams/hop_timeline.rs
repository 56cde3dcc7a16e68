//! Time and index of the items that a device makes, one per hop: codes, packed blocks or features.

use std::sync::Arc;

use link::Flags;
use neuro_ros::TriWords;

use crate::device::Device;
use crate::settings::Settings;
use crate::streams::ledger::{Arrival, HopCounts};
use crate::streams::rows::NextRow;
use crate::streams::stamps::{Decoding, FrameSteps, Reception, frame_time_ns};

/// Index, time and counts of the items of one stream: codes, packed blocks or features, one for
/// each hop. Finds the items that are missing within a run of the device and between two runs.
///
/// A restart of the device does not reset the counts.
#[derive(Debug)]
pub(crate) struct HopTimeline {
    /// Plural name of the stream's items for the log, such as "codes".
    items: &'static str,
    pub(crate) settings: Settings,
    pub(crate) device: Arc<Device>,
    /// Which stream is decoded for `/neurodata_reconstructed`, and whether it can be decoded.
    pub(crate) decoding: Decoding,
    /// Whether the device is known to have started the stream since its last restart: an item, a
    /// `Stats` message or an acknowledgement has shown it.
    running: bool,
    /// Device time of the newest item, received or missing, microseconds.
    last_device_us: Option<u64>,
    /// Device time of the first item of the present run, microseconds.
    run_us: i128,
    /// Index of the newest item, received or filled.
    last_index: u32,
    continuity: Continuity,
    /// Number of items missing between two runs that are counted but not filled yet: so far, only
    /// an event has shown that the newer run has begun.
    unfilled: u64,
    /// Newest stretch of missing items, until it is reported as an event.
    missing: Option<MissingStretch>,
    counts: HopCounts,
}

/// Index and time of an item that was received or is missing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HopPlace {
    pub(crate) index: u32,
    /// Device time of the last step of the item by the clock of the newest run, microseconds.
    /// Negative for an item from before that run.
    pub(crate) device_us: i128,
    /// Total number of missing items, counted up to and including this one.
    pub(crate) missing: u64,
    /// Whether the device made the item; false if it is missing between two runs.
    pub(crate) is_made: bool,
}

impl HopPlace {
    /// Returns the status words of this item's frame. The item's last ADC sample is `last_sample`.
    pub(crate) fn words(
        self,
        flags: Flags,
        last_sample: u64,
        reception: Reception<'_>,
    ) -> TriWords {
        TriWords {
            flags: flags.bits(),
            window: self.index,
            device_time_us: u64::try_from(self.device_us).unwrap_or(0),
            lost: self.missing,
            trigger: reception.trigger.level_at(last_sample),
        }
    }
}

/// Items that are missing directly before a received one.
#[derive(Clone, Copy, Debug)]
struct Gap {
    /// Number of items of this run that the device made but that never arrived.
    lost: u32,
    /// Number of items that the device would have made between the previous run and this one.
    between_runs: u64,
}

impl HopTimeline {
    /// Creates the timeline of a stream. `items` names its items in the plural, such as "codes".
    pub(crate) fn new(
        items: &'static str,
        device: Arc<Device>,
        decoding: Decoding,
        settings: Settings,
    ) -> HopTimeline {
        HopTimeline {
            items,
            settings,
            device,
            decoding,
            running: false,
            last_device_us: None,
            run_us: 0,
            last_index: 0,
            continuity: Continuity::default(),
            unfilled: 0,
            missing: None,
            counts: HopCounts::default(),
        }
    }

    /// Returns the time from one item to the next, microseconds.
    fn hop_us(&self) -> i64 {
        self.device.steps_us(u32::from(self.device.hop_steps))
    }

    /// Returns the time from the first step of a frame of the announced stream to the last step of
    /// the item that completes this frame, microseconds.
    fn lookback_us(&self) -> i64 {
        let (settings, decoded) = (&self.settings, self.decoding.stream);
        self.device.frame_lookback_us(settings.announced, decoded, settings)
    }

    /// Returns the time for a frame's stamp, nanoseconds since 1970. The frame has `length` steps
    /// and begins `lookback` steps before the last step of the item at `place`.
    pub(crate) fn frame_time_ns(
        &self,
        place: HopPlace,
        [lookback, length]: [u32; 2],
        reception: Reception<'_>,
    ) -> i64 {
        let steps = FrameSteps { lookback, length };
        let point = self.settings.stamp;
        frame_time_ns(&self.device, point, place.device_us, steps, reception)
    }

    /// Starts another run. Call this when the device counts from 0 again. When the first item of
    /// the new run arrives, the time since the last item of the previous run is filled.
    pub(crate) fn restart(&mut self) {
        self.counts.ledger.expect_next(0);
        self.running = false;
        self.last_device_us = None;
        self.counts.between_runs -= std::mem::take(&mut self.unfilled);
        self.continuity.end_run();
    }

    /// Ends the recording, because the user has stopped the stream. The pause is not filled.
    pub(crate) fn end_recording(&mut self) {
        self.restart();
        self.continuity = Continuity::default();
    }

    /// Records that the device sends the stream.
    pub(crate) fn mark_running(&mut self) {
        self.running = true;
    }

    /// Returns whether the device is known to have started the stream since its last restart.
    pub(crate) fn is_running(&self) -> bool {
        self.running
    }

    /// Removes and returns the stretch of missing items that is not reported yet, if there is one.
    /// A stretch starts at the stamp of its first filler.
    pub(crate) fn take_missing(&mut self) -> Option<MissingStretch> {
        self.missing.take()
    }

    pub(crate) fn counts(&self) -> &HopCounts {
        &self.counts
    }

    pub(crate) fn count_fillers(&mut self, fillers: usize) {
        self.counts.fillers += fillers as u64;
    }

    /// Returns whether `index`, of a newly received item, was counted before: the device has then
    /// restarted its stream without a command.
    pub(crate) fn is_restart(&self, index: u32) -> bool {
        self.counts.ledger.is_old(index)
    }

    /// Returns the places of the missing items directly before the received item `index`, oldest
    /// first and at most `max_fillers`, followed by the place of the received item. The device made
    /// the received item at `reception.device_us`; if `None`, the time follows from the index.
    pub(crate) fn receive(
        &mut self,
        index: u32,
        reception: Reception<'_>,
        max_fillers: u64,
    ) -> Option<(Vec<HopPlace>, HopPlace)> {
        let mut arrival = self.counts.ledger.record(index);
        if arrival == Arrival::Old {
            tracing::warn!(index, "the device restarted its stream of {}", self.items);
            self.restart();
            arrival = self.counts.ledger.record(index);
        }
        let Arrival::New { lost } = arrival else {
            return None;
        };
        let device_us = reception.device_us;
        let host_us = device_us.and_then(|us| reception.clock.host_us(us.into()));
        let device_us = device_us.unwrap_or_else(|| self.time_of_next(lost, 0));
        self.record_start(device_us, lost);
        let gap = Gap { lost, between_runs: self.missing_between_runs(host_us, lost, reception) };
        let fillers = self.fillers(index, gap, device_us, max_fillers);
        self.running = true;
        self.last_device_us = Some(device_us);
        self.last_index = index;
        let place = HopPlace {
            index,
            device_us: device_us.into(),
            missing: self.counts.missing(),
            is_made: true,
        };
        Some((fillers, place))
    }

    /// Returns the places of all missing items before index `next`, oldest first and at most
    /// `max_fillers`. The device's `Stats` message states `next`, the index of its next item.
    pub(crate) fn fill_before(
        &mut self,
        next: u32,
        reception: Reception<'_>,
        max_fillers: u64,
    ) -> Vec<HopPlace> {
        let lost = self.counts.ledger.count_lost_before(next);
        if lost == 0 {
            return Vec::new();
        }
        // Before the first item of a stream, only the time of the `Stats` message is known. The
        // device made its last item at most one hop earlier.
        let next_us = self.time_of_next(lost, reception.device_us.unwrap_or_default());
        self.record_start(next_us, lost);
        let host_us = reception.clock.host_us(next_us.into());
        let gap = Gap { lost, between_runs: self.missing_between_runs(host_us, lost, reception) };
        let fillers = self.fillers(next, gap, next_us, max_fillers);
        self.last_device_us = Some(next_us.saturating_add_signed(-self.hop_us()));
        fillers
    }

    /// Records the host time of the item at `place`, which is being published or filled.
    pub(crate) fn record(&mut self, place: HopPlace, reception: Reception<'_>) {
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
        let read_us = reception.read.monotonic_us as f64;
        let host_us = reception.clock.host_us(place.device_us);
        let run_us = reception.clock.host_us(self.run_us);
        self.continuity.record(host_us.unwrap_or(read_us), run_us);
    }

    /// Records when the present run began, if no item of the run is known yet. `device_us` is the
    /// device time of its first known item, before which `lost` items of this run were lost.
    fn record_start(&mut self, device_us: u64, lost: u32) {
        if self.last_device_us.is_none() {
            self.run_us = i128::from(device_us) - i128::from(lost) * i128::from(self.hop_us());
        }
    }

    /// Returns the number of items missing between two runs; 0 within a run. `host_us` is the host
    /// time of the newer run's received item, before which `lost` items of that run were lost.
    fn missing_between_runs(
        &mut self,
        host_us: Option<f64>,
        lost: u32,
        reception: Reception<'_>,
    ) -> u64 {
        let read_us = reception.read.monotonic_us;
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
        let [read_us, hop_us] = [read_us, self.hop_us()].map(|us| us as f64);
        self.begin_run(host_us.unwrap_or(read_us) - f64::from(lost) * hop_us);
        std::mem::take(&mut self.unfilled)
    }

    /// Counts the items that are missing before the present run, unless the run has already begun.
    /// The run's first item is at the host time `first_us`, microseconds.
    fn begin_run(&mut self, first_us: f64) {
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
        let hop_us = self.hop_us() as f64;
        let missing = self.continuity.missing_before(first_us, hop_us);
        self.counts.between_runs += missing;
        self.unfilled += missing;
    }

    /// Returns the next row of a topic with one frame of `rows` rows per item, after `published`
    /// frames. A run's first item ends with step `last`; its frame begins with step `first`.
    /// `run_us` is the host time of the present run's ADC sample 0, microseconds, if an event of
    /// this run has revealed it. If no item of the run has arrived yet, such an event starts the
    /// run.
    pub(crate) fn next_row(
        &mut self,
        [published, rows]: [u64; 2],
        [first, last]: [u32; 2],
        run_us: Option<f64>,
    ) -> NextRow {
        let hop = f64::from(self.device.hop_steps);
        let step_rate = f64::from(self.device.step_rate_hz);
        if let Some(run_us) = run_us {
            self.begin_run(run_us + f64::from(last) / step_rate * 1e6);
        }
        #[expect(clippy::cast_precision_loss, reason = "below 2^53 (10^7 years)")]
        let [unfilled, per_frame] = [self.unfilled, rows].map(|number| number as f64);
        let item = f64::from(self.counts.ledger.next_number()) - unfilled;
        let step = f64::from(first) + item * hop;
        let delay_s = f64::from(self.device.group_delay_us) * 1e-6;
        let adc_rate = f64::from(self.device.adc_rate_hz);
        NextRow {
            index: published * rows,
            sample: (step / step_rate - delay_s) * adc_rate,
            samples_per_row: hop / per_frame / step_rate * adc_rate,
        }
    }

    /// Returns the device time of the item that arrives after `lost` lost items, microseconds. If
    /// no item has a known time, returns the time one hop after `fallback_us`.
    fn time_of_next(&self, lost: u32, fallback_us: u64) -> u64 {
        let (known_us, hops) = match self.last_device_us {
            Some(last_us) => (last_us, i64::from(lost) + 1),
            None => (fallback_us, 1),
        };
        known_us.saturating_add_signed(hops * self.hop_us())
    }

    /// Returns the places of the items missing directly before item `index`, whose device time is
    /// `device_us`; at most `max_fillers` places.
    fn fillers(&mut self, index: u32, gap: Gap, device_us: u64, max_fillers: u64) -> Vec<HopPlace> {
        let missing = gap.between_runs + u64::from(gap.lost);
        if missing == 0 {
            return Vec::new();
        }
        let items = self.items;
        tracing::debug!(
            lost = gap.lost,
            between_runs = gap.between_runs,
            before = index,
            "{items} missing"
        );
        let hop_us = i128::from(self.hop_us());
        #[expect(clippy::cast_precision_loss, reason = "68 minutes are exact to the millisecond")]
        let seconds = (hop_us * i128::from(missing)) as f32 / 1e6;
        let first_us = i128::from(device_us) - hop_us * i128::from(missing);
        self.missing = Some(MissingStretch {
            start_us: first_us - i128::from(self.lookback_us()),
            seconds,
            restarted: gap.between_runs > 0,
        });
        let filled = missing.min(max_fillers);
        if filled < missing {
            self.skip_unfilled(missing - filled, gap);
        }
        let mut places = Vec::with_capacity(usize::try_from(filled).unwrap_or_default());
        for back in (1..=filled).rev() {
            // Lost items of this run have the indices directly before the received item. Items
            // between two runs never had an index; they continue the indices of the previous run.
            let lost = u32::try_from(back).ok().filter(|back| *back <= gap.lost);
            self.last_index = match lost {
                Some(back) => index.wrapping_sub(back),
                None => self.last_index.wrapping_add(1),
            };
            places.push(HopPlace {
                index: self.last_index,
                device_us: i128::from(device_us) - hop_us * i128::from(back),
                missing: self.counts.missing() - back + 1,
                is_made: lost.is_some(),
            });
        }
        places
    }

    /// Counts `unfilled` missing items that get no filler, because the gap is too long.
    fn skip_unfilled(&mut self, unfilled: u64, gap: Gap) {
        self.counts.unfilled += unfilled;
        // Advance the index by the unfilled items between the runs too, although the device never
        // numbered them: the indices of the next fillers then show the gap.
        let between_runs = unfilled.min(gap.between_runs);
        #[expect(clippy::cast_possible_truncation, reason = "indices wrap")]
        let between_runs = between_runs as u32;
        self.last_index = self.last_index.wrapping_add(between_runs);
        tracing::error!(unfilled, "the outage was too long to fill; start a new recording");
    }
}

/// Time after the start of a run during which newer fits improve the estimate of that start,
/// microseconds. Later fits follow the drift of the clock, and are less exact about the start.
const IMPROVES_US: f64 = 60e6;

/// Host time of a topic's newest item: a code, packed block, features, ADC sample or filtered step.
/// When the device restarts, its own clock starts at 0 again, but the host's clock goes on, so the
/// host time reveals how many items are missing between the two runs.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Continuity {
    /// Host time of the newest item, microseconds; `None` before a recording's first item.
    newest_us: Option<f64>,
    /// Whether the device has restarted since the newest code, packed block or sample.
    run_ended: bool,
    /// Two estimates of the host time of the present run's first item, microseconds: the first,
    /// with which the gap before the run was filled, and the newest. `None` in a recording's first
    /// run.
    run_us: Option<[f64; 2]>,
    /// Duration of the last gap less the time of the items counted for it, microseconds. It is
    /// added to the next gap, so the errors of many restarts never add up to more than half an
    /// item.
    left_over_us: f64,
    /// Values that `run_us` and `left_over_us` had before the present run; `None` from the run's
    /// first item on.
    before: Option<(Option<[f64; 2]>, f64)>,
}

impl Continuity {
    /// Records the host time of an item that is being published, and the host time of its run's
    /// first item by the same fit, microseconds. After a run's first frame, the fit is late by that
    /// frame's delay; later frames improve it.
    pub(crate) fn record(&mut self, host_us: f64, run_us: Option<f64>) {
        self.newest_us = Some(host_us);
        self.before = None;
        if let (Some([filled_us, newest_us]), Some(run_us)) = (&mut self.run_us, run_us)
            && host_us - *filled_us < IMPROVES_US
        {
            *newest_us = run_us;
        }
    }

    /// Records that the device has restarted: the next item belongs to another run. If the run that
    /// ended had no item, the gap before that run continues, so what was recorded when that run
    /// began is undone.
    pub(crate) fn end_run(&mut self) {
        self.run_ended = self.newest_us.is_some();
        if let Some(before) = self.before.take() {
            (self.run_us, self.left_over_us) = before;
        }
    }

    /// Returns the number of items missing between the newest item and the first item of the next
    /// run, which is at the host time `first_us`; 0 within a run. Items follow each other every
    /// `period_us` microseconds.
    pub(crate) fn missing_before(&mut self, first_us: f64, period_us: f64) -> u64 {
        let (Some(newest_us), true) = (self.newest_us, self.run_ended) else {
            return 0;
        };
        self.run_ended = false;
        self.before = Some((self.run_us, self.left_over_us));
        if let Some([filled_us, newest_us]) = self.run_us.replace([first_us; 2]) {
            self.left_over_us += newest_us - filled_us;
        }
        let gap_us = first_us - newest_us + self.left_over_us;
        let periods = (gap_us / period_us).round().max(1.0);
        // If the next run seems to begin before the previous one ended, one of the times is wrong.
        // Do not let this error shorten later gaps by more than one item.
        self.left_over_us = (gap_us - periods * period_us).max(-period_us);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at least 0, and saturates"
        )]
        let missing = (periods - 1.0) as u64;
        missing
    }
}

/// A stretch of consecutive missing data of a topic, which becomes one event on the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MissingStretch {
    /// Device time at which the first missing sample was at the electrodes, microseconds.
    pub(crate) start_us: i128,
    /// Duration of the missing data, seconds.
    pub(crate) seconds: f32,
    /// Whether the device restarted during the time of the missing data.
    pub(crate) restarted: bool,
}

#[cfg(test)]
mod tests {
    use super::Continuity;

    #[test]
    fn items_between_two_runs_are_counted_and_rounding_does_not_add_up() {
        let mut continuity = Continuity::default();
        continuity.end_run();
        assert_eq!(continuity.missing_before(5e6, 62_500.0), 0, "no run before");
        let (mut now_us, mut items) = (0.0, 0);
        continuity.record(now_us, None);
        for _ in 0..1000 {
            continuity.end_run();
            // The next run begins 2.4 periods later; the 1 counts its first item.
            now_us += 2.4 * 62_500.0;
            items += continuity.missing_before(now_us, 62_500.0) + 1;
            assert_eq!(continuity.missing_before(now_us, 62_500.0), 0, "asked twice");
            continuity.record(now_us, None);
        }
        assert_eq!(items, 2400);
    }

    #[test]
    fn the_delays_of_the_first_frames_of_many_runs_do_not_add_up() {
        let mut continuity = Continuity::default();
        continuity.record(0.0, None);
        let (mut now_us, mut items) = (0.0, 0);
        for _ in 0..1000 {
            continuity.end_run();
            // The first item is read 0.3 periods late. The fit reveals this only when the next item
            // arrives.
            now_us += 3.0 * 62_500.0;
            items += continuity.missing_before(now_us + 0.3 * 62_500.0, 62_500.0) + 1;
            continuity.record(now_us, Some(now_us));
        }
        assert_eq!(items, 3000);
    }

    #[test]
    fn the_rounding_of_a_gap_whose_run_has_no_item_is_taken_back() {
        let mut continuity = Continuity::default();
        continuity.record(0.0, None);
        for periods in [2.4, 4.4, 6.4] {
            continuity.end_run();
            continuity.missing_before(periods * 62_500.0, 62_500.0);
        }
        continuity.end_run();
        assert_eq!(continuity.missing_before(8.4 * 62_500.0, 62_500.0), 7);
    }

    #[test]
    fn a_run_that_starts_before_the_last_one_ended_has_no_gap() {
        let mut continuity = Continuity::default();
        continuity.record(10e6, None);
        continuity.end_run();
        assert_eq!(continuity.missing_before(4e6, 1000.0), 0);
        continuity.record(4e6, None);
        continuity.end_run();
        assert_eq!(continuity.missing_before(4e6 + 11_000.0, 1000.0), 9);
    }
}
