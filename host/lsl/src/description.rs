//! The metadata of the streams: device, channels and positions of electrodes.

use std::sync::Arc;

use bridge_core::Device;
use neuro_ros::{NeuroDataInfo, NeuroFrame};
use recordings::Position;

use crate::liblsl::{CallError, FLOAT, Functions, Info, STRING, StreamHead};

/// Radius of the sphere on which electrodes lie, mm, for a head with a circumference of 60 cm.
const HEAD_MM: f64 = 95.0;
const MANUFACTURER: &str = "Corticode";

/// A stream of the bridge with a constant sampling rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamKind {
    /// Codes, as on `/encoded`.
    Codes,
    /// Signals decoded from codes or packed blocks.
    Reconstructed,
    /// Filtered steps.
    Filtered,
    /// ADC samples.
    Raw,
}

impl StreamKind {
    /// Returns the last part of the stream's name and of its source id.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            StreamKind::Codes => "codes",
            StreamKind::Reconstructed => "reconstructed",
            StreamKind::Filtered => "filtered",
            StreamKind::Raw => "raw",
        }
    }

    /// Returns the LSL content type of the stream and of its channels.
    const fn content(self) -> &'static str {
        match self {
            StreamKind::Codes => "Codes",
            _ => "EEG",
        }
    }
}

/// The device from which the streams come.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Acquisition {
    board: String,
    serial: String,
    firmware: String,
    model: String,
    /// Delay of the filters, seconds; subtracted from the stamps of all streams but raw samples.
    filter_delay_s: f64,
}

impl Acquisition {
    /// Copies the properties of the device that the metadata contain.
    pub fn new(device: &Device) -> Acquisition {
        Acquisition {
            board: device.board.clone(),
            serial: device.uid.clone(),
            firmware: device.firmware.clone(),
            model: format!("{:016x}", u64::from_be_bytes(device.model_id)),
            filter_delay_s: f64::from(device.group_delay_us) * 1e-6,
        }
    }
}

/// Properties of a stream that stay the same from frame to frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shape {
    pub(crate) kind: StreamKind,
    pub(crate) rate_hz: u16,
    eeg: NeuroDataInfo,
    exg: NeuroDataInfo,
}

impl Shape {
    pub(crate) fn new(kind: StreamKind, frame: &NeuroFrame) -> Arc<Shape> {
        Arc::new(Shape {
            kind,
            rate_hz: frame.sr,
            eeg: frame.eeg.info.clone(),
            exg: frame.exg.info.clone(),
        })
    }

    /// Returns whether the frame has this shape.
    pub(crate) fn is_of(&self, frame: &NeuroFrame) -> bool {
        let (eeg, exg) = (&frame.eeg.info, &frame.exg.info);
        (self.rate_hz, &self.eeg, &self.exg) == (frame.sr, eeg, exg)
    }

    /// Returns the number of channels: electrodes, then spare channels.
    pub(crate) fn channels(&self) -> usize {
        self.eeg.labels.len() + self.exg.labels.len()
    }

    /// Returns the description of the stream. The stream's name and source id start with `name`.
    pub(crate) fn info(
        &self,
        functions: &'static Functions,
        name: &str,
        device: &Acquisition,
    ) -> Result<Info, CallError> {
        let kind = self.kind;
        let head = StreamHead {
            name: &format!("{name}-{}", kind.name()),
            content: kind.content(),
            channels: i32::try_from(self.channels()).unwrap_or(i32::MAX),
            rate_hz: self.rate_hz.into(),
            format: FLOAT,
            source_id: &source_id(name, device, kind.name()),
        };
        let info = Info::new(functions, &head)?;
        let desc = info.desc();
        desc.append_text("manufacturer", MANUFACTURER);
        let channels = desc.append("channels");
        let blocks = [(&self.eeg, kind.content()), (&self.exg, "MISC")];
        for (block, content) in blocks {
            for label in &block.labels {
                let channel = channels.append("channel");
                channel.append_text("label", label);
                channel.append_text("unit", unit(&block.unit));
                channel.append_text("type", content);
                let position = Position::from_label(label).filter(|_| content == "EEG");
                if let Some(position) = position {
                    let location = channel.append("location");
                    let axes = [("X", position.x), ("Y", position.y), ("Z", position.z)];
                    for (axis, of_radius) in axes {
                        location.append_text(axis, &format!("{:.2}", of_radius * HEAD_MM));
                    }
                }
            }
        }
        let lag_s = match kind {
            StreamKind::Raw => 0.0,
            _ => device.filter_delay_s,
        };
        describe_origin(&info, device, lag_s);
        let processing = desc.append("processing");
        processing.append_text("transducer", &self.eeg.transducter);
        processing.append_text("filters", &self.eeg.prefiltering);
        processing.append_text("model", &device.model);
        Ok(info)
    }
}

/// Returns the description of the stream of events, which also marks where fillers begin and end.
pub(crate) fn events_info(
    functions: &'static Functions,
    name: &str,
    device: &Acquisition,
) -> Result<Info, CallError> {
    let head = StreamHead {
        name: &format!("{name}-events"),
        content: "Markers",
        channels: 1,
        rate_hz: 0.0,
        format: STRING,
        source_id: &source_id(name, device, "events"),
    };
    let info = Info::new(functions, &head)?;
    let desc = info.desc();
    desc.append_text("manufacturer", MANUFACTURER);
    let channel = desc.append("channels").append("channel");
    channel.append_text("label", "event");
    channel.append_text("type", "Markers");
    describe_origin(&info, device, 0.0);
    Ok(info)
}

/// Returns the source id, which stays the same when the bridge or the device restarts.
fn source_id(name: &str, device: &Acquisition, stream: &str) -> String {
    format!("{name}:{}:{stream}", device.serial)
}

/// Appends the device's properties and the delay of its stamps, under the names in the XDF metadata
/// specifications. `lag_s` is the delay that was subtracted from the stamps, seconds.
fn describe_origin(info: &Info, device: &Acquisition, lag_s: f64) {
    let acquisition = info.desc().append("acquisition");
    acquisition.append_text("manufacturer", MANUFACTURER);
    acquisition.append_text("model", &device.board);
    acquisition.append_text("serial_number", &device.serial);
    acquisition.append_text("firmware", &device.firmware);
    acquisition.append_text("compensated_lag", &format!("{lag_s:.6}"));
    let synchronization = info.desc().append("synchronization");
    synchronization.append_text("offset_mean", "0");
    // Fillers replace lost samples, so the number of samples matches the time.
    synchronization.append_text("can_drop_samples", "false");
}

/// Returns the unit as the XDF metadata specification spells it.
fn unit(unit: &str) -> &str {
    match unit {
        "uV" => "microvolts",
        other => other,
    }
}
