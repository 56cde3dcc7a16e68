//! The side streams of a device, which are optional: samples, filtered steps, events and audits.

use std::sync::Arc;

use link::{Audit, COUNT_BYTES, CompressedRaw, Event, Filtered, Raw, Streams, VALUE_BYTES};
use neuro_ros::NeuroFrame;

use crate::core::Effects;
use crate::decoder::audit::AuditedWindow;
use crate::decoder::model::Model;
use crate::device::Device;
use crate::settings::{EventStamps, RawForm, Settings};
use crate::streams::event::{EventBus, EventStream};
use crate::streams::sample::{CompressedSamples, SampleStream, Samples};
use crate::streams::stamps::{DecodedStream, Reception};

/// Checks the messages of the side streams and converts them to frames, events and audits.
#[derive(Debug)]
pub(crate) struct SideStreams {
    settings: Settings,
    device: Option<Arc<Device>>,
    pub(crate) raw: Option<SampleStream>,
    pub(crate) compressed: CompressedSamples,
    pub(crate) filtered: Option<SampleStream>,
    pub(crate) events: EventStream,
    pub(crate) bus: EventBus,
    /// Number of messages that were ignored: not requested, from before the device's introduction
    /// or from a refused device, or audits of a model that the bridge does not have.
    pub(crate) unused: u64,
    /// Number of audits that were not evaluated, because their model, format or size differ from
    /// the device's.
    pub(crate) audits_unusable: u64,
    /// Buffer for the samples of the message that is being handled, uV; reused to avoid
    /// allocations.
    microvolts: Vec<f32>,
}

impl SideStreams {
    pub(crate) fn new(settings: Settings) -> SideStreams {
        SideStreams {
            settings,
            device: None,
            raw: None,
            compressed: CompressedSamples::default(),
            filtered: None,
            events: EventStream::default(),
            bus: EventBus::new(settings.streams.contains(Streams::EVENTS)),
            unused: 0,
            audits_unusable: 0,
            microvolts: Vec::new(),
        }
    }

    /// Sets the device from which the following messages come.
    pub(crate) fn set_device(&mut self, device: &Arc<Device>) {
        let asked = self.settings.streams;
        self.compressed.forget();
        // Raw samples do not pass the filters, so their stamps need no correction for the delay.
        let streams = [
            (&mut self.raw, RawForm::any_in(asked), device.raw_frame(), 0),
            (
                &mut self.filtered,
                asked.contains(Streams::FILTERED),
                device.filtered_frame(),
                device.group_delay_us,
            ),
        ];
        for (stream, is_wanted, frame, delay_us) in streams {
            match stream {
                Some(stream) => stream.replace_device(frame, delay_us),
                None if is_wanted => {
                    *stream = Some(SampleStream::new(frame, delay_us, self.settings));
                }
                None => {}
            }
        }
        self.device = Some(Arc::clone(device));
    }

    /// Sets by how much the stamps of events are later than the events. Call this after
    /// [`Self::set_device`]. `decoded` is the stream decoded for `/neurodata_reconstructed`.
    pub(crate) fn set_event_shift(&mut self, decoded: DecodedStream) {
        let Some(device) = &self.device else { return };
        let settings = &self.settings;
        let shift_us = match settings.event_stamps {
            EventStamps::Recorder => {
                device.recorder_shift_us(settings.announced, decoded, settings)
            }
            EventStamps::Scalp => 0,
        };
        self.bus.set_shift(shift_us);
    }

    /// Ends the recording of all side streams, which the user has stopped. The pause is not filled.
    pub(crate) fn end_recording(&mut self) {
        for stream in [&mut self.raw, &mut self.filtered].into_iter().flatten() {
            stream.end_recording();
        }
        self.compressed.forget();
        self.events.restart();
    }

    /// Restarts all side streams. Call this when the device counts samples and steps from 0 again.
    pub(crate) fn restart(&mut self) {
        for stream in [&mut self.raw, &mut self.filtered].into_iter().flatten() {
            stream.restart();
        }
        self.compressed.forget();
        self.events.restart();
    }

    /// Publishes the ADC samples of a message, scaled to uV.
    pub(crate) fn receive_raw(&mut self, raw: &Raw, at: Reception<'_>, effects: &mut dyn Effects) {
        let Some((stream, device)) = self.raw.as_mut().zip(self.device.as_ref()) else {
            self.unused += 1;
            return;
        };
        let bytes = usize::from(raw.channels) * COUNT_BYTES;
        if usize::from(raw.channels) != stream.width() || !raw.counts.len().is_multiple_of(bytes) {
            return stream.reject("raw samples have another number of channels, or are cut off");
        }
        #[expect(clippy::cast_possible_truncation, reason = "within 187500 uV")]
        let microvolt = |count| (f64::from(count) * device.uv_per_count) as f32;
        self.microvolts.clear();
        self.microvolts.extend(raw.counts().map(microvolt));
        let samples =
            Samples { first: raw.first_sample, flags: raw.flags, microvolts: &self.microvolts };
        let publish = &mut |frame: &NeuroFrame| effects.publish_raw(frame);
        stream.receive(samples, |sample| sample, at, publish);
    }

    /// Decodes a message of compressed ADC samples and publishes them in microvolts. Samples that
    /// cannot be decoded count as lost when the next message is published.
    pub(crate) fn receive_compressed(
        &mut self,
        message: &CompressedRaw,
        at: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let mut compressed = std::mem::take(&mut self.compressed);
        match compressed.decode(message) {
            Ok(Some(raw)) => self.receive_raw(&raw, at, effects),
            Ok(None) => {}
            Err(why) => {
                if let Some(stream) = &mut self.raw {
                    stream.reject(&why.to_string());
                }
            }
        }
        self.compressed = compressed;
    }

    /// Publishes the filtered steps of a message, scaled to uV.
    pub(crate) fn receive_filtered(
        &mut self,
        filtered: &Filtered,
        at: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let Some((stream, device)) = self.filtered.as_mut().zip(self.device.as_ref()) else {
            self.unused += 1;
            return;
        };
        let bytes = usize::from(filtered.electrodes) * VALUE_BYTES;
        let fits = usize::from(filtered.electrodes) == stream.width()
            && filtered.values.len().is_multiple_of(bytes);
        if !fits {
            return stream
                .reject("filtered steps have another number of electrodes, or are cut off");
        }
        let value_uv = device.uv_per_count * 2_f64.powi(-i32::from(filtered.fraction_bits));
        let range_uv = device.full_scale_uv;
        #[expect(clippy::cast_possible_truncation, reason = "clamped to 187500 uV")]
        let microvolt =
            // Limit the value to the announced range, because a recorder stores values outside that
            // range as infinite.
            |value| (f64::from(value) * value_uv).clamp(-range_uv, range_uv) as f32;
        self.microvolts.clear();
        self.microvolts.extend(filtered.values().map(microvolt));
        let samples = Samples {
            first: filtered.first_step,
            flags: filtered.flags,
            microvolts: &self.microvolts,
        };
        let of_step = |step| device.sample_of_step(step);
        let publish = &mut |frame: &NeuroFrame| effects.publish_filtered(frame);
        stream.receive(samples, of_step, at, publish);
    }

    /// Publishes an event, which is at the row `row` of the announced stream, and returns the
    /// trigger's new level; `None` if the event is not published, because it was not requested, has
    /// an old number or has an unknown kind.
    pub(crate) fn receive_event(
        &mut self,
        event: Event,
        at: Reception<'_>,
        row: Option<u64>,
        effects: &mut dyn Effects,
    ) -> Option<u16> {
        if !self.settings.streams.contains(Streams::EVENTS) {
            self.unused += 1;
            return None;
        }
        self.events.receive(event, at, row, &mut self.bus, effects)
    }

    /// Passes an audit to the decoder thread, which evaluates it. `model` is the device's model;
    /// `None` if this bridge does not have it.
    pub(crate) fn receive_audit(
        &mut self,
        audit: &Audit,
        model: Option<&Model>,
        effects: &mut dyn Effects,
    ) {
        let is_asked = self.settings.streams.contains(Streams::AUDIT);
        // Log nothing if the model is missing, because `/diagnostics` already reports it.
        let (true, Some(device), Some(model)) = (is_asked, &self.device, model) else {
            self.unused += 1;
            return;
        };
        let fits = audit.model_id == device.model_id
            && audit.values.format() == device.code_format
            && audit.planes.len() == model.window_cells();
        if !fits {
            if self.audits_unusable == 0 {
                tracing::error!(
                    planes = audit.planes.len(),
                    "the device's audits differ from its codes in model, format or size; they are \
                     counted and not compared"
                );
            }
            self.audits_unusable += 1;
            return;
        }
        effects.audit(AuditedWindow::new(Arc::clone(device), audit));
    }
}
