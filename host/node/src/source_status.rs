//! The acquisition's status in `/diagnostics`.

use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::source::SourceCounts;

/// Time without a frame after which the acquisition's status is an error, seconds.
const SILENCE_S: f64 = 2.0;

/// Facts about the acquisition from which its status for `/diagnostics` is made.
#[derive(Clone, Debug, Default)]
pub(crate) struct SourceFacts {
    /// Full name of the topic with the acquisition's frames.
    pub(crate) topic: String,
    /// Whether the frames come from a stream of the Lab Streaming Layer. If so, `topic` is the name
    /// of the stream.
    pub(crate) is_stream: bool,
    /// Layout of the frames; `None` before the first frame that can be encoded.
    pub(crate) layout: Option<String>,
    /// Number of nodes that publish the topic, or of streams that match it.
    pub(crate) publishers: usize,
    /// Publishers that cannot be reached: URI, reason and remedy of each.
    pub(crate) unreachable: Vec<String>,
    pub(crate) counts: SourceCounts,
    /// Number of refused frames.
    pub(crate) refused: u64,
    /// Why the newest refused frame was refused.
    pub(crate) refusal: Option<String>,
    /// Number of frames dropped because this program did not read them in time.
    pub(crate) dropped: u64,
    /// Time since the newest frame, seconds; `None` before the first.
    pub(crate) silent_s: Option<f64>,
    /// Whether the acquisition sends frames without numbers.
    pub(crate) is_unnumbered: bool,
    /// Longest time that a sample waits for the resampler, seconds.
    pub(crate) delay_s: f64,
}

/// Returns the status. `before` are the facts of the previous report, one second earlier: losses
/// and refusals are a warning only in the first report after they happen.
pub(crate) fn status(facts: &SourceFacts, before: &SourceFacts) -> DiagnosticStatus {
    let lost = facts.counts.lost - before.counts.lost;
    let refused = facts.refused - before.refused;
    let topic = &facts.topic;
    let (level, message) = if facts.publishers > 1 {
        let count = facts.publishers;
        let message = if facts.is_stream {
            let choices = facts.refusal.clone();
            choices.unwrap_or_else(|| format!("{count} streams match {topic}"))
        } else {
            format!("{count} nodes publish {topic}, and their frames are mixed; stop all but one")
        };
        (DiagnosticLevel::Error, message)
    } else if refused > 0 {
        let why = facts.refusal.as_deref().unwrap_or_default();
        (DiagnosticLevel::Error, format!("{refused} frames refused: {why}"))
    } else if let ([fault, ..], 0) = (&*facts.unreachable, facts.publishers) {
        let message = format!("the publisher of {topic} cannot be reached: {fault}");
        (DiagnosticLevel::Error, message)
    } else if facts.publishers == 0 {
        let message = if facts.is_stream {
            format!("no stream matches {topic}")
        } else {
            format!("no node publishes {topic}")
        };
        (DiagnosticLevel::Error, message)
    } else if facts.silent_s.is_none_or(|seconds| seconds > SILENCE_S) {
        let message = match facts.refusal.as_ref().filter(|_| facts.is_stream) {
            Some(why) => format!("no frames come on {topic}: {why}"),
            None => format!("no frames come on {topic}"),
        };
        (DiagnosticLevel::Error, message)
    } else if lost > 0 {
        let message = format!("{lost} frames lost since the last report");
        (DiagnosticLevel::Warn, message)
    } else if facts.counts.restarts > before.counts.restarts {
        let message = "the acquisition started again".to_owned();
        (DiagnosticLevel::Warn, message)
    } else if facts.counts.pauses > before.counts.pauses {
        let message = "the acquisition paused and lost no frame: nothing is filled";
        (DiagnosticLevel::Warn, message.to_owned())
    } else if facts.is_unnumbered {
        let message =
            "all frames have the number 0, so lost ones are not found; count neuroheader.seq up";
        (DiagnosticLevel::Warn, message.to_owned())
    } else {
        (DiagnosticLevel::Ok, "all frames arrive".to_owned())
    };
    let silent = facts.silent_s.map(|seconds| format!("{seconds:.1}"));
    let mut values = vec![
        KeyValue::new("topic", topic),
        KeyValue::new("layout", facts.layout.as_ref().map_or(&"unknown", |text| text)),
        KeyValue::new("publishers", &facts.publishers),
        KeyValue::new("publishers not reached", &facts.unreachable.len()),
        KeyValue::new("frames encoded", &facts.counts.encoded),
        KeyValue::new("frames lost", &facts.counts.lost),
        KeyValue::new("frames refused", &facts.refused),
        KeyValue::new("frames dropped", &facts.dropped),
        KeyValue::new("restarts", &facts.counts.restarts),
        KeyValue::new("pauses", &facts.counts.pauses),
        KeyValue::new("resampler delay ms", &format!("{:.1}", 1e3 * facts.delay_s)),
    ];
    if let Some(silent) = silent {
        values.push(KeyValue::new("newest frame s ago", &silent));
    }
    DiagnosticStatus::new("source", (level, message), values)
}

#[cfg(test)]
mod tests {
    use neuro_ros::DiagnosticLevel;

    use super::{SourceCounts, SourceFacts, status};

    #[test]
    fn a_loss_is_a_warning_once_and_worse_states_come_first() {
        let calm = SourceFacts {
            topic: "/neurodata".to_owned(),
            publishers: 1,
            silent_s: Some(0.1),
            ..SourceFacts::default()
        };
        let level = |facts: &SourceFacts, before| status(facts, before).level;
        assert_eq!(level(&calm, &calm), DiagnosticLevel::Ok);
        let lossy = SourceFacts {
            counts: SourceCounts { lost: 3, ..SourceCounts::default() },
            ..calm.clone()
        };
        let report = status(&lossy, &calm);
        assert_eq!(report.level, DiagnosticLevel::Warn);
        assert_eq!(report.message, "3 frames lost since the last report");
        assert_eq!(level(&lossy, &lossy), DiagnosticLevel::Ok);
        let silent = SourceFacts { silent_s: Some(5.0), ..lossy.clone() };
        assert_eq!(level(&silent, &calm), DiagnosticLevel::Error);
        let unreachable = SourceFacts {
            publishers: 0,
            unreachable: vec!["http://lab:1/: lab does not resolve".to_owned()],
            ..calm.clone()
        };
        let message = status(&unreachable, &calm).message;
        assert!(message.ends_with("cannot be reached: http://lab:1/: lab does not resolve"));
        let two = SourceFacts { publishers: 2, ..calm.clone() };
        assert!(status(&two, &calm).message.starts_with("2 nodes publish"));
        // For several LSL streams, the message is the refusal, which says what to type.
        let streams = SourceFacts {
            is_stream: true,
            refusal: Some("2 streams match; choose one: ...".to_owned()),
            ..two
        };
        let message = status(&streams, &calm).message;
        assert_eq!(message, "2 streams match; choose one: ...");
    }
}
