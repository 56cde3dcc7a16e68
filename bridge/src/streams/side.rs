//! What a device streams beside its codes.

use std::sync::Arc;

use link::{Audit, COUNT_BYTES, Event, Filtered, Raw, Streams, VALUE_BYTES};

use crate::decoder::audit::AuditedWindow;
use crate::decoder::model::Model;
use crate::device::Device;
use crate::effects::Effects;
use crate::settings::Settings;
use crate::streams::event::EventStream;
use crate::streams::sample::{SampleStream, Samples};
use crate::streams::stamps::Reception;
use crate::streams::trigger::Trigger;
use crate::time::clock::Clock;
use crate::time::host_time::HostTime;

/// What a device streams beside its codes: samples, filtered steps, events, audited windows.
#[derive(Debug)]
pub(crate) struct SideStreams {
    settings: Settings,
    device: Option<Arc<Device>>,
    pub(crate) raw: Option<SampleStream>,
    pub(crate) filtered: Option<SampleStream>,
    pub(crate) events: EventStream,
    pub(crate) trigger: Trigger,
    /// Messages that nobody asked for, or that came before the device introduced itself.
    pub(crate) unused: u64,
    /// Audits that cannot be compared: of another model, format or size.
    pub(crate) audits_unusable: u64,
    /// Samples of the message at hand, uV.
    microvolts: Vec<f32>,
}

/// When a message was made and read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MessageTime<'a> {
    /// The header's time; none if it cannot be right.
    pub(crate) device_us: Option<u64>,
    pub(crate) read: HostTime,
    pub(crate) clock: &'a Clock,
}

impl SideStreams {
    pub(crate) fn new(settings: Settings) -> SideStreams {
        SideStreams {
            settings,
            device: None,
            raw: None,
            filtered: None,
            events: EventStream::new(),
            trigger: Trigger::default(),
            unused: 0,
            audits_unusable: 0,
            microvolts: Vec::new(),
        }
    }

    /// From here on messages are this device's.
    pub(crate) fn set_device(&mut self, device: &Arc<Device>) {
        let wanted = |stream| self.settings.streams.contains(stream);
        // What the ADC measured was not delayed by any filter.
        let streams = [
            (&mut self.raw, Streams::RAW, device.raw_frame(), 0),
            (
                &mut self.filtered,
                Streams::FILTERED,
                device.filtered_frame(),
                device.group_delay_us,
            ),
        ];
        for (stream, bit, frame, delay_us) in streams {
            match stream {
                Some(stream) => stream.replace_device(frame, delay_us),
                None if wanted(bit) => {
                    *stream = Some(SampleStream::new(frame, delay_us, self.settings));
                }
                None => {}
            }
        }
        self.device = Some(Arc::clone(device));
    }

    /// The device begins its streams anew: samples and steps count from 0.
    pub(crate) fn restart(&mut self) {
        for stream in [&mut self.raw, &mut self.filtered].into_iter().flatten() {
            stream.restart();
        }
        self.restart_events();
    }

    /// The device has begun its streams anew and only its codes told so; samples and steps see it by
    /// themselves, and may have done before.
    pub(crate) fn restart_events(&mut self) {
        self.events.restart();
        self.trigger.restart();
    }

    /// ADC samples came.
    pub(crate) fn receive_raw(
        &mut self,
        raw: &Raw,
        times: MessageTime<'_>,
        effects: &mut dyn Effects,
    ) {
        let Some((stream, device)) = self.raw.as_mut().zip(self.device.as_ref()) else {
            self.unused += 1;
            return;
        };
        let bytes = usize::from(raw.channels) * COUNT_BYTES;
        if usize::from(raw.channels) != stream.width() || !raw.counts.len().is_multiple_of(bytes) {
            return stream.reject("raw samples of other channels, or cut");
        }
        #[expect(clippy::cast_possible_truncation, reason = "a range, 187500 uV")]
        let microvolt = |count| (f64::from(count) * device.uv_per_count) as f32;
        self.microvolts.clear();
        self.microvolts.extend(raw.counts().map(microvolt));
        let samples = Samples {
            first: raw.first_sample,
            flags: raw.flags,
            last_us: times.device_us,
            microvolts: &self.microvolts,
        };
        let reception = times.reception(&self.trigger);
        stream.receive(samples, |sample| sample, reception, &mut |frame| {
            effects.publish_raw(frame);
        });
    }

    /// Filtered steps came.
    pub(crate) fn receive_filtered(
        &mut self,
        filtered: &Filtered,
        times: MessageTime<'_>,
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
            return stream.reject("filtered steps of other electrodes, or cut");
        }
        let value_uv = device.uv_per_count * 2_f64.powi(-i32::from(filtered.fraction_bits));
        let range_uv = device.full_scale_uv;
        #[expect(clippy::cast_possible_truncation, reason = "a range, 187500 uV")]
        let microvolt =
            // What lies beyond the announced range reads back as infinite from a recording.
            |value| (f64::from(value) * value_uv).clamp(-range_uv, range_uv) as f32;
        self.microvolts.clear();
        self.microvolts.extend(filtered.values().map(microvolt));
        let samples = Samples {
            first: filtered.first_step,
            flags: filtered.flags,
            last_us: times.device_us,
            microvolts: &self.microvolts,
        };
        let reception = times.reception(&self.trigger);
        let of_step = |step| device.sample_of_step(step);
        stream.receive(samples, of_step, reception, &mut |frame| {
            effects.publish_filtered(frame);
        });
    }

    /// Something happened at the device.
    pub(crate) fn receive_event(
        &mut self,
        event: Event,
        times: MessageTime<'_>,
        effects: &mut dyn Effects,
    ) {
        let reception = times.reception(&self.trigger);
        if !self.settings.streams.contains(Streams::EVENTS) {
            self.unused += 1;
        } else if let Some(level) = self
            .events
            .receive(event, times.device_us, reception, effects)
        {
            self.trigger.record_edge(event.sample, level);
        }
    }

    /// A window came with its code; `model` is the device's, if this bridge has it.
    pub(crate) fn receive_audit(
        &mut self,
        audit: &Audit,
        model: Option<&Model>,
        effects: &mut dyn Effects,
    ) {
        let (true, Some(device)) = (self.settings.streams.contains(Streams::AUDIT), &self.device)
        else {
            self.unused += 1;
            return;
        };
        // Without its model nothing can be said; `/diagnostics` says that it is missing.
        let Some(model) = model else {
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
                    "the device's audits are of another model, format or size than its codes; \
                     they are counted and not compared"
                );
            }
            self.audits_unusable += 1;
            return;
        }
        effects.audit(AuditedWindow::new(Arc::clone(device), audit));
    }
}

impl<'a> MessageTime<'a> {
    fn reception(self, trigger: &'a Trigger) -> Reception<'a> {
        Reception {
            read: self.read,
            clock: self.clock,
            trigger,
        }
    }
}
