//! The acquisition as a device: takes its frames, and returns bytes of the wire format.

use std::collections::VecDeque;
use std::ops::Range;

use bridge_core::HostTime;
use link::Substitutes;
use neuro_ros::NeuroFrame;
use pipeline::{Mains, Sample};
use recordings::{AdcSpec, LiveAdc, Missing, MontageMap, montage_map::Origin};

use crate::amplifier_clock::AmplifierClock;
use crate::encoder_device::EncoderDevice;
use crate::layout::Layout;
use crate::pauses::{Finding, Pauses};
use crate::refusal::Refusal;
use crate::sequence::{Arrival, Sequence};

const _: () = assert!(model::CHANNELS <= recordings::virtual_adc::CHANNELS);

/// An acquisition whose frames a device inside this process encodes.
///
/// The device time is the number of samples divided by their nominal rate, as on a board, plus the
/// pauses of the acquisition. Bytes of the device count as read at the host time at which their
/// newest sample was made. This host time comes from the fit of the device time to the arrivals of
/// frames. So samples that wait for the rest of their frame or for the resampler do not disturb the
/// bridge's own fit.
pub struct Source {
    layout: Layout,
    map: MontageMap,
    mains: Mains,
    session_id: u32,
    sequence: Sequence,
    pauses: Pauses,
    clock: AmplifierClock,
    /// Frame that ended a standstill, the number of lost frames before it, and its arrival. It
    /// waits for the next frame, which shows whether the acquisition has paused.
    waiting: Option<(NeuroFrame, u32, HostTime)>,
    adc: LiveAdc,
    device: EncoderDevice,
    /// Number of samples of the acquisition since the device's start, including lost ones.
    inputs: u64,
    /// Number of samples that the virtual ADC has made since the device's start.
    outputs: u64,
    /// Indices of the lost samples in each gap that is not completely converted, oldest first.
    lost: VecDeque<Range<u64>>,
    /// Bytes for the host, each chunk with the time at which it counts as read.
    outgoing: VecDeque<(HostTime, Vec<u8>)>,
    counts: SourceCounts,
}

/// Numbers of frames and restarts since the program's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SourceCounts {
    /// Number of frames that were encoded.
    pub encoded: u64,
    /// Number of frames missing from the acquisition's numbering; refused frames count as missing.
    pub lost: u64,
    /// Number of restarts of the acquisition.
    pub restarts: u64,
    /// Number of pauses of the acquisition without a lost frame.
    pub pauses: u64,
    /// Sum of all pauses, microseconds.
    pub paused_us: u64,
}

impl Source {
    /// Creates a source for frames with the layout of `frame`, but does not encode `frame`. The
    /// notch filter removes `mains` until the host selects another frequency. `session_id`
    /// identifies this start of the device, and should differ each time that the program starts.
    ///
    /// # Errors
    ///
    /// [`Refusal`] if the frame cannot be encoded.
    pub fn new(frame: &NeuroFrame, mains: Mains, session_id: u32) -> Result<Source, Refusal> {
        let layout = Layout::from_frame(frame)?;
        layout.admit(frame)?;
        let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
        let map = MontageMap::new(&layout.labels, &electrodes, Missing::Interpolate)?;
        let mut sequence = Sequence::default();
        sequence.record(frame, layout.frame_us());
        Ok(Source {
            adc: adc(&layout, &map)?,
            device: EncoderDevice::new(session_id, substitutes(&map), mains),
            layout,
            map,
            mains,
            session_id,
            sequence,
            pauses: Pauses::default(),
            clock: AmplifierClock::default(),
            waiting: None,
            inputs: 0,
            outputs: 0,
            lost: VecDeque::new(),
            outgoing: VecDeque::new(),
            counts: SourceCounts::default(),
        })
    }

    /// Returns the layout that all frames must have.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the map from the acquisition's channels to the model's electrodes.
    pub fn map(&self) -> &MontageMap {
        &self.map
    }

    /// Returns the numbers of frames and restarts so far.
    pub fn counts(&self) -> SourceCounts {
        self.counts
    }

    /// Returns whether the acquisition does not number its frames, so that losses are not found.
    pub fn is_unnumbered(&self) -> bool {
        self.sequence.is_unnumbered()
    }

    /// Returns the longest time that a sample waits for the resampler, microseconds; 0 if the
    /// samples need no resampling.
    pub fn delay_us(&self) -> u64 {
        self.nominal_us(self.adc.delay() as u64)
    }

    /// Checks layout, values and number of a frame. Returns how it follows the previous frame.
    ///
    /// # Errors
    ///
    /// [`Refusal`] if the frame must not be encoded. The frame counts as lost when the next frame
    /// arrives.
    pub fn check(&mut self, frame: &NeuroFrame) -> Result<Arrival, Refusal> {
        self.layout.admit(frame)?;
        match self.sequence.record(frame, self.layout.frame_us()) {
            Arrival::Repeated => Err(Refusal::Repeated(frame.neuroheader.seq)),
            arrival => Ok(arrival),
        }
    }

    /// Replaces the device by a new one, because the acquisition has restarted. `read` is the
    /// arrival of the first frame after the restart. The new device introduces itself to the host,
    /// and the host then starts the streams. Samples that wait for the resampler are dropped.
    ///
    /// # Errors
    ///
    /// [`Refusal::Conversion`], which would be a defect of this program.
    pub fn restart(&mut self, read: HostTime) -> Result<(), Refusal> {
        if let Some((frame, lost, at)) = self.waiting.take() {
            self.convert(&frame, lost, at, true);
        }
        self.adc = adc(&self.layout, &self.map)?;
        self.session_id = self.session_id.wrapping_add(1);
        let substitutes = substitutes(&self.map);
        self.device = EncoderDevice::new(self.session_id, substitutes, self.mains);
        self.pauses = Pauses::default();
        self.clock = AmplifierClock::default();
        (self.inputs, self.outputs) = (0, 0);
        self.lost.clear();
        self.counts.restarts += 1;
        self.outgoing.push_back((read, self.device.take_bytes()));
        Ok(())
    }

    /// Encodes a frame that [`Source::check`] has accepted and that arrived at `read`. `lost`
    /// frames are missing before it. A frame that ends a standstill is encoded when the next one
    /// arrives.
    pub fn encode(&mut self, frame: &NeuroFrame, lost: u32, read: HostTime) {
        let span_us = self.layout.frame_us().saturating_mul(i64::from(lost) + 1);
        let Finding { is_pause, is_open } = self.pauses.record(read.monotonic_us, span_us);
        let waiting = self.waiting.take();
        let has_waited = waiting.is_some();
        if let Some((frame, lost, at)) = waiting {
            self.convert(&frame, lost, at, is_pause);
        }
        if is_open {
            self.waiting = Some((frame.clone(), lost, read));
            return;
        }
        self.convert(frame, lost, read, is_pause && !has_waited);
    }

    fn convert(&mut self, frame: &NeuroFrame, lost: u32, read: HostTime, after_pause: bool) {
        self.counts.encoded += 1;
        self.counts.lost += u64::from(lost);
        if lost > 0 {
            let samples = u64::from(lost) * u64::from(self.layout.samples);
            let first = self.inputs;
            self.inputs += samples;
            self.lost.push_back(first..self.inputs);
        }
        let start_us = self.nominal_us(self.inputs);
        self.inputs += u64::from(self.layout.samples);
        let end_us = self.nominal_us(self.inputs);
        if after_pause {
            self.counts.paused_us += self.clock.pause(start_us, end_us, read);
            self.counts.pauses += 1;
        }
        self.clock.observe(start_us, end_us, read);
        // Fill one frame at a time, because a long gap at a high rate would take a lot of memory.
        for _ in 0..lost {
            self.adc.hold(self.layout.samples.into());
            self.encode_samples();
        }
        self.adc.append(&frame.eeg.data);
        self.encode_samples();
    }

    /// Encodes the samples that the virtual ADC has made.
    fn encode_samples(&mut self) {
        while let Some(counts) = self.adc.next_sample() {
            let is_lost = self.is_lost();
            let at_us = self.device_us();
            self.outputs += 1;
            // The virtual ADC can have more channels than a sample. Leave out the excess channels.
            let sample = Sample { counts: std::array::from_fn(|channel| counts[channel]) };
            self.device.process(&sample, is_lost, at_us);
            self.collect(at_us);
        }
    }

    /// Passes bytes from the host to the device; the present host time is `now`.
    pub fn receive(&mut self, bytes: &[u8], now: HostTime) {
        // Between two frames the device time advances with the host's clock, but by one frame at
        // most: later times belong to the samples of the next frame.
        let since_us = self
            .clock
            .newest()
            .map_or(0, |arrival| now.monotonic_us.saturating_sub(arrival.monotonic_us));
        let since_us = since_us.clamp(0, self.layout.frame_us());
        let now_us = self.device_us().saturating_add_signed(since_us);
        self.device.receive(bytes, now_us);
        let bytes = self.device.take_bytes();
        self.outgoing.push_back((now, bytes));
    }

    /// Returns whether the host has started the device's streams.
    pub fn is_streaming(&self) -> bool {
        self.device.is_streaming()
    }

    /// Sends the device's counters, which a device must send every second, even without frames.
    pub fn send_stats(&mut self) {
        if self.is_streaming() {
            let now_us = self.device_us();
            self.device.send_stats(now_us);
            self.collect(now_us);
        }
    }

    /// Removes and returns bytes for the host, with the time at which they count as read.
    pub fn next_bytes(&mut self) -> Option<(HostTime, Vec<u8>)> {
        self.outgoing.pop_front()
    }

    /// Returns bytes to the front of the queue, because the host has not taken them yet.
    pub(crate) fn put_back(&mut self, read: HostTime, bytes: Vec<u8>) {
        self.outgoing.push_front((read, bytes));
    }

    /// Returns the nominal time of the acquisition's sample with this index, microseconds.
    fn nominal_us(&self, input: u64) -> u64 {
        input * 1_000_000 / u64::from(self.layout.rate_hz)
    }

    /// Returns the device time of the next sample of the virtual ADC, microseconds.
    fn device_us(&mut self) -> u64 {
        let at_us = self.outputs * 1_000_000 / u64::from(model::ADC_RATE_HZ);
        self.clock.device_us(at_us)
    }

    /// Returns the indices of the acquisition's samples around the next sample of the virtual ADC:
    /// the last one at or before its time, and the first one at or after it.
    fn input_around(&self) -> [u64; 2] {
        let position = self.outputs * u64::from(self.layout.rate_hz);
        let adc_rate = u64::from(model::ADC_RATE_HZ);
        [position / adc_rate, position.div_ceil(adc_rate)]
    }

    /// Returns whether one of the two input samples around the virtual ADC's next sample was lost.
    fn is_lost(&mut self) -> bool {
        let [before, after] = self.input_around();
        while self.lost.front().is_some_and(|lost| lost.end <= before) {
            self.lost.pop_front();
        }
        let lost = self.lost.front();
        lost.is_some_and(|lost| lost.contains(&before) || lost.contains(&after))
    }

    /// Queues the device's bytes for the host. They count as read at the device time `at_us`.
    fn collect(&mut self, at_us: u64) {
        let bytes = self.device.take_bytes();
        if let Some(read) = self.clock.host_time(at_us)
            && !bytes.is_empty()
        {
            self.outgoing.push_back((read, bytes));
        }
    }
}

fn adc(layout: &Layout, map: &MontageMap) -> Result<LiveAdc, Refusal> {
    let spec =
        AdcSpec { rate_hz: model::ADC_RATE_HZ.into(), lsb_uv: f64::from(model::LSB_NV) / 1_000.0 };
    Ok(LiveAdc::new(&layout.labels, layout.rate_hz.into(), map, spec)?)
}

/// Returns the set of the montage's electrodes that are interpolated, and the set of those whose
/// values are 0.
fn substitutes(map: &MontageMap) -> Substitutes {
    let bits = |wanted: fn(&Origin) -> bool| {
        let origins = (0..u64::BITS).zip(map.origins());
        let found = origins.filter(|(_, origin)| wanted(origin));
        found.fold(0, |bits, (electrode, _)| bits | 1 << electrode)
    };
    Substitutes {
        interpolated: bits(|origin| matches!(origin, Origin::Interpolated(_))),
        zero: bits(|origin| matches!(origin, Origin::Zero)),
    }
}
