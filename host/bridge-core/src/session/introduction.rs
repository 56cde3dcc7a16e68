//! Handling of `Hello` and `Capabilities`, with which a device introduces itself.

use std::sync::Arc;

use artifact::ModelId;
use link::{Capabilities, Header, Hello, Streams, Substitutes};
use neuro_ros::{AcquisitionInfo, ContractError, Shape};

use crate::core::{Announcement, Effects, EventPlace};
use crate::device::{Device, DeviceError, Identity};
use crate::session::Session;
use crate::settings::AnnouncedStream;
use crate::streams::code::CodeStream;
use crate::streams::event::BusEvent;
use crate::streams::features::FeatureStream;
use crate::streams::packed::PackedStream;
use crate::streams::stamps::{DecodedStream, Decoding};
use crate::time::HostTime;
use crate::wire::upload::Upload;

impl Session {
    pub(super) fn handle_hello(&mut self, hello: &Hello, header: Header) {
        self.introduced = true;
        let known = self.identity.as_ref();
        if known.is_some_and(|identity| identity.is_same_session(hello)) {
            return;
        }
        // A device introduces itself again, without a restart, after a model was uploaded to it.
        if let Some(known) = &mut self.identity
            && known.is_same_start(hello)
        {
            *known = Identity::new(hello);
            tracing::info!("the device uses model {}", ModelId(hello.model_id));
            return;
        }
        let known = self.identity.as_ref();
        let reset = known.is_some();
        let is_same_device = known.is_some_and(|known| known.is_same_device(hello));
        let identity = Identity::new(hello);
        self.frames.expect_next(header.seq);
        self.clock.restart();
        self.stats = None;
        self.quality = None;
        self.timing = None;
        self.converters = None;
        self.exclusion = None;
        self.substitutes = Substitutes::NONE;
        self.round_trips.restart(is_same_device);
        self.logged.refused_streams = false;
        if reset {
            tracing::warn!("the device was reset or replaced: {identity}");
            self.counts.resets += 1;
            // Codes after the restart cannot be interpreted until `Capabilities` arrive.
            self.commands.device_restarted();
            if self.round_trips.can_anchor() {
                self.commands.query_clock_before_start();
            }
            self.restart_streams();
        } else {
            tracing::info!("device: {identity}");
        }
        if !hello.fault.is_empty() {
            tracing::error!(fault = hello.fault, "the device reports a fault");
        }
        self.identity = Some(identity);
    }

    pub(super) fn handle_capabilities(
        &mut self,
        capabilities: &Capabilities,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        let Some(identity) = self.identity.as_ref().filter(|_| self.introduced) else {
            return;
        };
        let device = match Device::new(&identity.as_hello(), capabilities) {
            Ok(mut device) => {
                device.substitutes = self.substitutes;
                Arc::new(device)
            }
            Err(error) => {
                let why = format!("{error}; its codes are not published");
                return self.refuse(why, read, effects);
            }
        };
        if let Some(upload) = self.due_upload(&device) {
            let [own, sent] = [device.model_id, upload.id()].map(ModelId);
            tracing::info!("the device uses model {own}; it is sent model {sent}");
            self.commands.start_upload(upload);
            self.commands.device_introduced(true);
            return;
        }
        self.commands.end_upload();
        let model = self.model.as_ref();
        let objection = model.and_then(|model| model.objection(&device));
        let decodable = model.is_some() && objection.is_none();
        let decoding = self.decoding(decodable);
        let info = match self.acquisition_info(&device, decoding) {
            Ok(info) => info,
            Err(error) => {
                let why = format!("{error}; its codes are not published");
                return self.refuse(why, read, effects);
            }
        };
        if let Err(error) = self.check_announced(&device) {
            let why = format!("another device is connected: {error}");
            return self.refuse(why, read, effects);
        }
        self.announced = Some(Arc::clone(&device));
        self.commands.device_introduced(true);
        self.objection = objection;
        if self.exclusion.is_none() {
            self.publish_exclusion(0, Vec::new(), read.wall_ns, None, effects);
        }
        let (policy, unknown) = self.exclusions.policy(&device.labels);
        self.commands.set_exclusion(policy);
        let known = self.codes.as_ref().map(CodeStream::device);
        if known.is_some_and(|known| **known == *device) {
            return;
        }
        if !unknown.is_empty() {
            tracing::warn!(
                "the device has no electrode {}, so it can be neither excluded nor protected; its electrodes are {}",
                unknown.join(" "),
                device.labels.join(" ")
            );
        }
        if let Some(objection) = &self.objection {
            tracing::error!("{objection}");
        }
        let (asked, per_second) = (self.commands.streams(), device.codes_per_second());
        if asked.contains(Streams::CODES) && device.has_network() {
            tracing::info!("codes: {per_second} per second, {}", device.code_format);
        }
        if asked.contains(Streams::PACKED) {
            tracing::info!("packed blocks: {per_second} per second");
        }
        if asked.contains(Streams::FEATURES) {
            tracing::info!("predictions: {per_second} per second");
        }
        if let Some(unrecorded) = device.unrecorded() {
            tracing::warn!("electrodes that were not recorded: {unrecorded}");
        }
        self.side.set_device(&device);
        if decodable && !decoding.is_possible {
            tracing::warn!(
                "the model has no packed code, so packed blocks cannot be decoded; `trainer packed` adds one, \
                 or choose --streams codes"
            );
        }
        let shared = Arc::clone(&device);
        if let Some(packed) = &mut self.packed {
            packed.timeline.device = shared;
        } else {
            self.packed = Some(PackedStream::new(shared, decoding, self.settings));
        }
        let shared = Arc::clone(&device);
        if let Some(codes) = &mut self.codes {
            codes.replace_device(shared);
        } else {
            self.codes = Some(CodeStream::new(shared, decoding, self.settings));
        }
        self.set_classifying(&device);
        self.set_decoding(decoding, effects);
        self.is_described_asked = self.asks_for_described();
        effects.announce(&Announcement { info, device, decodable });
    }

    /// Creates the stream of features if there is a classifier and it fits this device.
    fn set_classifying(&mut self, device: &Arc<Device>) {
        let Some(classifier) = &self.classifier else {
            return;
        };
        let labels = device.labels.iter().map(String::as_str);
        if let Err(error) = classifier.check_device(labels, device.step_rate_hz, device.hop_steps) {
            tracing::error!("nothing is classified: {error}");
            self.features = None;
        } else if let Some(features) = &mut self.features {
            features.timeline.device = Arc::clone(device);
        } else {
            let (device, classifier) = (Arc::clone(device), Arc::clone(classifier));
            self.features = Some(FeatureStream::new(device, classifier, self.settings));
        }
    }

    /// Checks that `device` matches the announced device. The model ids may differ if one of them
    /// is the uploaded model's: a device can accept an upload that it has refused before, or refuse
    /// one that it has used before.
    fn check_announced(&self, device: &Device) -> Result<(), DeviceError> {
        let Some(announced) = &self.announced else {
            return Ok(());
        };
        let mut announced = (**announced).clone();
        let ids = [announced.model_id, device.model_id];
        let is_uploaded = |upload: &Upload| ids.contains(&upload.id());
        if self.upload.as_ref().is_some_and(is_uploaded) {
            announced.model_id = device.model_id;
        }
        announced.check_compatible(device)
    }

    /// Returns the packed model to upload before the device is used; `None` if the user chose none,
    /// or if the device already has the model, does not fit it or has refused it.
    fn due_upload(&self, device: &Device) -> Option<Upload> {
        let (upload, model) = (self.upload.as_ref()?, self.model.as_ref()?);
        let is_due =
            upload.id() != device.model_id && model.fits(device) && !self.commands.refuses_upload();
        is_due.then(|| upload.clone())
    }

    /// Announces the device again if an announced fact has changed: which stream is decoded, or
    /// whether the device is asked for the stream that `/acquisition/get_info` describes. Both
    /// change when the device begins or ceases to refuse streams. Call this when the device has
    /// started or refused to start, and for each code and packed block, because the acknowledgement
    /// of the start can be lost.
    pub(super) fn announce_other_streams(&mut self, read: HostTime, effects: &mut dyn Effects) {
        let Some(codes) = &self.codes else { return };
        let device = Arc::clone(codes.device());
        let decodable = self.model.is_some() && self.objection.is_none();
        let decoding = self.decoding(decodable);
        let is_described_asked = self.asks_for_described();
        if decoding == self.decoding && is_described_asked == self.is_described_asked {
            return;
        }
        self.set_decoding(decoding, effects);
        self.is_described_asked = is_described_asked;
        match self.acquisition_info(&device, decoding) {
            Ok(info) => effects.announce(&Announcement { info, device, decodable }),
            Err(error) => {
                let why = format!("{error}; its codes are not published");
                self.refuse(why, read, effects);
            }
        }
    }

    /// Returns whether the bridge asks the device for the stream that `/acquisition/get_info`
    /// describes, and the device does not refuse to stream.
    fn asks_for_described(&self) -> bool {
        let asked = self.commands.streams();
        self.settings.announced.is_in(asked) && self.commands.start_refusal().is_none()
    }

    /// Returns which of the requested streams to decode, and whether it can be decoded. `decodable`
    /// is true if the bridge has the device's model.
    fn decoding(&self, decodable: bool) -> Decoding {
        let stream = DecodedStream::of(self.commands.streams());
        let has_packed = || self.model.as_ref()?.packed();
        Decoding {
            stream,
            is_possible: decodable && (stream == DecodedStream::Codes || has_packed().is_some()),
        }
    }

    fn set_decoding(&mut self, decoding: Decoding, effects: &mut dyn Effects) {
        if self.decoding.stream != decoding.stream {
            // Publish the last frame of packed blocks, which still waits for the next block, before
            // any frame that is decoded from codes.
            effects.finish_blocks();
        }
        self.decoding = decoding;
        if let Some(codes) = &mut self.codes {
            codes.set_decoding(decoding);
        }
        if let Some(packed) = &mut self.packed {
            packed.set_decoding(decoding);
        }
        self.side.set_event_shift(decoding.stream);
    }

    /// Returns the answer to `/acquisition/get_info`; `None` if the stream that the user selected
    /// is not published, because the device lacks or refuses it, or the model cannot decode it.
    fn acquisition_info(
        &self,
        device: &Device,
        decoding: Decoding,
    ) -> Result<Option<AcquisitionInfo>, ContractError> {
        let Device { board, firmware, .. } = device;
        let model = format!("{board} {firmware}, model {}", ModelId(device.model_id));
        let encoded = device.encoded_frame();
        if device.has_network() {
            Shape::from_frame(&encoded)?;
        }
        if !self.asks_for_described() {
            return Ok(None);
        }
        let frame = match self.settings.announced {
            AnnouncedStream::Encoded if !device.has_network() => return Ok(None),
            AnnouncedStream::Encoded => encoded,
            AnnouncedStream::Reconstructed if !decoding.is_possible => return Ok(None),
            AnnouncedStream::Reconstructed => match decoding.stream {
                DecodedStream::Codes => device.reconstructed_frame(),
                DecodedStream::Packed => device.unpacked_frame(),
            },
            AnnouncedStream::Raw => device.raw_frame(),
            AnnouncedStream::Filtered => device.filtered_frame(),
        };
        AcquisitionInfo::new(&model, &device.uid, frame).map(Some)
    }

    /// Ignores the device's codes from now on, for the reason `why`. Publishes an event about the
    /// refusal if a device was announced before.
    fn refuse(&mut self, why: String, read: HostTime, effects: &mut dyn Effects) {
        tracing::error!("{why}");
        if self.announced.is_some() {
            let event = BusEvent::DeviceRefused(why.clone());
            let row = self.next_row(None).map(|next| next.index);
            let place = EventPlace { row, device_us: None };
            let wall_ns = self.frame_wall_ns(read, effects);
            self.side.bus.publish(&event, wall_ns, place, effects);
        }
        self.objection = Some(why);
        self.commands.device_introduced(false);
    }
}
