//! Lines of JSON as output instead of frames, with the topics and fields that the bridge publishes.

use std::io;

use artifact::reconstruction::{code_range, dequantise};
use link::{
    Capabilities, Code, Decoder, Event, EventKind, Exclusion, PackedCode, Substitutes, ToHost,
};
use neuro_ros::{JsonLine, NeuroDataInfo, NeuroEvent, NeuroFrame, TriWords};
use serde::Serialize;

/// Turns the frames of a device into lines of JSON: codes, packed blocks, trigger edges, excluded
/// electrodes and signal quality. Other messages have no line.
///
/// Lines of codes and edges have the fields of the bridge's messages, except `header.stamp`: the
/// device has no time of day, so every line has the device time instead. Lines of packed blocks and
/// quality have the fields of the messages on the wire.
#[derive(Default)]
pub(crate) struct JsonLines {
    decoder: Decoder,
    substitutes: Substitutes,
    /// Labels of the electrodes.
    labels: Vec<String>,
    codes: Option<CodeFrames>,
    events: u32,
    /// Level of the trigger input according to the edges so far, 0 or 1.
    trigger: u16,
}

/// Builds the messages of codes: holds the newest message, and the scales and zero points that
/// dequantise codes.
struct CodeFrames {
    frame: NeuroFrame,
    scale: Vec<f32>,
    zero_point: Vec<i8>,
}

/// Fields of a packed block, and its bytes, which follow the fields on the wire.
#[derive(Serialize)]
struct PackedBlock<'a> {
    #[serde(flatten)]
    fields: PackedCode<'a>,
    bytes: &'a [u8],
}

/// Fields of an `Exclusion`, with labels in place of bits, because many JSON parsers store integers
/// in only 53 bits.
#[derive(Serialize)]
struct ExcludedElectrodes<'a> {
    first_step: u64,
    excluded: Vec<&'a str>,
    always: Vec<&'a str>,
    never: Vec<&'a str>,
    automatic: bool,
}

impl JsonLines {
    /// Returns the line of a whole frame; `None` if its message has no line.
    ///
    /// # Errors
    /// The frame is damaged, or it holds a code although the device has not sent `Capabilities`
    /// yet.
    pub(crate) fn line(&mut self, mut frame: &[u8]) -> io::Result<Option<Vec<u8>>> {
        let mut decoder = std::mem::take(&mut self.decoder);
        let outcome = decoder.next::<ToHost<'_>>(&mut frame).transpose();
        let frame = outcome.map_err(io::Error::other)?;
        let line = frame
            .map_or(Ok(None), |frame| self.message(frame.message, frame.header.device_time_us));
        self.decoder = decoder;
        line
    }

    fn message(&mut self, message: ToHost<'_>, device_time_us: u64) -> io::Result<Option<Vec<u8>>> {
        let time = device_time_us;
        match message {
            ToHost::Substitutes(substitutes) => self.substitutes = substitutes,
            ToHost::Capabilities(about) => {
                self.labels = about.labels.split(' ').map(str::to_owned).collect();
                self.codes = CodeFrames::new(&about, self.substitutes);
            }
            ToHost::Code(code) => {
                let codes = self.codes.as_mut();
                let codes = codes.ok_or_else(|| io::Error::other("a code before Capabilities"))?;
                return line("/encoded", time, codes.next(&code, time, self.trigger));
            }
            ToHost::Event(event) => return line("/events/bus", time, &self.edge(event)),
            ToHost::PackedCode(fields) => {
                let bytes = fields.bytes;
                return line("/packed", time, &PackedBlock { fields, bytes });
            }
            ToHost::Exclusion(report) => return line("/exclusion", time, &self.exclusion(&report)),
            ToHost::Quality(quality) => return line("/quality", time, &quality),
            _ => {}
        }
        Ok(None)
    }

    fn exclusion(&self, report: &Exclusion) -> ExcludedElectrodes<'_> {
        let labels = |mask: u64| {
            let labels = self.labels.iter().take(64).enumerate();
            let labels = labels.filter(|(electrode, _)| mask >> electrode & 1 == 1);
            labels.map(|(_, label)| label.as_str()).collect()
        };
        ExcludedElectrodes {
            first_step: report.first_step,
            excluded: labels(report.excluded),
            always: labels(report.policy.always),
            never: labels(report.policy.never),
            automatic: report.policy.automatic,
        }
    }

    fn edge(&mut self, event: Event) -> NeuroEvent {
        let is_rising = event.kind == EventKind::TriggerRise;
        self.trigger = is_rising.into();
        self.events += 1;
        let mut message = NeuroEvent::on_bus();
        (message.header.seq, message.neuroheader.seq) = (self.events, self.events);
        let (code, description) = NeuroEvent::trigger_edge(is_rising);
        message.event = code;
        description.clone_into(&mut message.description);
        message
    }
}

impl CodeFrames {
    /// Creates the message for codes, still without values; `None` if the codes have a format that
    /// is newer than this program.
    fn new(about: &Capabilities<'_>, substitutes: Substitutes) -> Option<Self> {
        let (scale, zero_point) = (about.code_scale.to_vec(), about.code_zero_point.to_vec());
        let range = code_range(about.code_format.range()?, &scale, &zero_point);
        let unrecorded = substitutes.named(about.labels.split(' ')).to_string();
        let transducter = [NeuroFrame::NETWORK, &unrecorded];
        let transducter = transducter.into_iter().filter(|part| !part.is_empty());
        let eeg = NeuroDataInfo {
            transducter: transducter.collect::<Vec<_>>().join("; "),
            prefiltering: about.filters.to_owned(),
            minmax: range.map(f64::from).to_vec(),
            ..NeuroDataInfo::default()
        };
        let codes_per_second = about.step_rate_hz / u16::from(about.hop_steps);
        Some(Self {
            frame: NeuroFrame::encoded(codes_per_second, scale.len(), eeg),
            scale,
            zero_point,
        })
    }

    fn next(&mut self, code: &Code<'_>, device_time_us: u64, trigger: u16) -> &NeuroFrame {
        let frame = &mut self.frame;
        frame.neuroheader.seq = frame.neuroheader.seq.wrapping_add(1);
        frame.header.seq = frame.neuroheader.seq;
        let scales = self.scale.iter().zip(&self.zero_point);
        let values = frame.eeg.data.iter_mut().zip(code.values.levels().zip(scales));
        for (value, (level, (scale, zero_point))) in values {
            *value = dequantise(level, *scale, *zero_point);
        }
        let words = TriWords {
            flags: code.flags.bits(),
            window: code.window,
            device_time_us,
            lost: 0,
            trigger,
        };
        frame.tri.data.copy_from_slice(&words.words());
        frame
    }
}

fn line(topic: &str, time_us: u64, message: &impl Serialize) -> io::Result<Option<Vec<u8>>> {
    let line = JsonLine { topic, device_time_us: Some(time_us), message };
    line.to_bytes().map(Some)
}

#[cfg(test)]
mod tests {
    use link::ExclusionPolicy;
    use serde_json::json;

    use super::*;

    #[test]
    fn excluded_electrodes_have_labels_in_place_of_bits() {
        let labels = (0..64).map(|electrode| format!("E{electrode}"));
        let mut lines = JsonLines { labels: labels.collect(), ..JsonLines::default() };
        let report = ToHost::Exclusion(Exclusion {
            first_step: 640,
            excluded: 1 << 63 | 1 << 2,
            policy: ExclusionPolicy { always: 1 << 2, never: 0, automatic: true },
        });
        let line = lines.message(report, 5_000_000).expect("writable");
        let line = serde_json::from_slice::<serde_json::Value>(&line.expect("a line"));
        let expected = json!({
            "topic": "/exclusion",
            "device_time_us": 5_000_000,
            "message": {
                "first_step": 640,
                "excluded": ["E2", "E63"],
                "always": ["E2"],
                "never": [],
                "automatic": true,
            },
        });
        assert_eq!(line.expect("JSON"), expected);
    }
}
