//! Summary of the counts of streamed data, which the program prints when it ends.

use std::fmt;

use link::{Counters, StageTiming};

use crate::decoder::thread::DecoderCounts;
use crate::diagnostics::worst_of_deadline;
use crate::session::Session;
use crate::streams::features::FeatureStream;
use crate::streams::packed::PackedStream;

/// Counts of received, lost and filled data so far. Its display form is one line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Number of codes that the device has made, by their indices: those received plus those lost.
    pub made: u64,
    /// Number of codes that arrived; frames with an old sequence number do not count.
    pub received: u64,
    /// Number of codes that did not arrive.
    pub lost: u64,
    /// Number of codes that are missing because restarts interrupted the stream.
    pub between_runs: u64,
    /// Number of bursts; a burst is a sequence of consecutive lost codes.
    pub bursts: u64,
    /// Number of codes in the longest burst.
    pub longest_burst: u32,
    /// Number of fillers published in place of lost codes.
    pub fillers: u64,
    /// Numbers of packed blocks; all 0 if no packed blocks were streamed.
    pub packed: PackedSummary,
    /// Numbers of predictions; all 0 without a classifier.
    pub predictions: PredictionSummary,
    /// Number of frames on the wire, of any kind, that did not arrive.
    pub frames_lost: u64,
    /// Counts of the frame decoder: bytes, frames, and errors of each kind.
    pub wire: Counters,
    /// Number of times that the port was opened.
    pub connections: u64,
    /// Number of detected resets of the device.
    pub resets: u64,
    /// Number of codes, packed blocks and features that arrived and were not used: the device had
    /// not introduced itself or was refused, or the code's model or format is not the one that the
    /// device reported.
    pub unused: u64,
    /// Drift: rate of the host's clock divided by the rate of the device's clock, minus 1, in parts
    /// per million.
    pub drift_ppm: f64,
    /// The device's processing stage with the largest ratio of worst time to deadline so far;
    /// `None` if the device reports no stages.
    pub worst_stage: Option<StageTiming>,
    /// Counts of the decoder thread, which is not part of the core. A core sets all of them to 0.
    pub decoder: DecoderCounts,
}

/// Numbers of packed blocks so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PackedSummary {
    /// Number of blocks that the device has made: those received plus those lost.
    pub made: u64,
    /// Number of blocks that arrived; frames with an old sequence number do not count.
    pub received: u64,
    /// Number of blocks that did not arrive.
    pub lost: u64,
    /// Number of placeholders that were decoded in place of missing blocks.
    pub fillers: u64,
    /// Number of blocks that are missing because restarts interrupted the stream.
    pub between_runs: u64,
    /// Number of bits in the blocks that arrived, without the overhead of the frames around them.
    pub bits: u64,
}

/// Numbers of predictions so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PredictionSummary {
    /// Number of predictions, including repeated ones.
    pub published: u64,
    /// Number of predictions that repeat the previous prediction, because the features were lost or
    /// not usable.
    pub repeated: u64,
    /// Number of hops whose features are missing.
    pub lost: u64,
}

impl PackedSummary {
    fn new(stream: &PackedStream) -> PackedSummary {
        let hops = stream.timeline.counts();
        PackedSummary {
            made: hops.ledger.made(),
            received: hops.ledger.received,
            lost: hops.ledger.lost,
            fillers: hops.fillers,
            between_runs: hops.between_runs,
            bits: stream.counts.bits,
        }
    }
}

impl Summary {
    pub(crate) fn new(session: &Session, wire: &Counters) -> Summary {
        let codes = session.codes.as_ref();
        let foreign = codes.map_or(0, |codes| codes.counts.foreign);
        let counts = codes.map(|codes| codes.timeline.counts().clone());
        let counts = counts.unwrap_or_default();
        let packed = session.packed.as_ref();
        let predictions = session.features.as_ref().map(FeatureStream::summary);
        Summary {
            packed: packed.map(PackedSummary::new).unwrap_or_default(),
            predictions: predictions.unwrap_or_default(),
            made: counts.ledger.made(),
            received: counts.ledger.received,
            lost: counts.ledger.lost,
            between_runs: counts.between_runs,
            bursts: counts.ledger.bursts,
            longest_burst: counts.ledger.longest_burst,
            fillers: counts.fillers,
            frames_lost: session.frames.lost,
            wire: *wire,
            connections: session.counts.connections,
            resets: session.counts.resets,
            unused: session.counts.hops_unused + foreign,
            drift_ppm: session.clock.drift_ppm(),
            worst_stage: session.worst_stage,
            decoder: DecoderCounts::default(),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Summary { made, received, lost, bursts, longest_burst, fillers, between_runs, .. } =
            self;
        let Summary { frames_lost, wire, connections, resets, unused, drift_ppm, .. } = self;
        write!(
            formatter,
            "codes: made {made} received {received} lost {lost} (bursts {bursts}, longest \
             {longest_burst}) fillers {fillers} missing between runs \
             {between_runs}; unused {unused}; frames: lost {frames_lost} crc \
             {} cobs {} oversize {} version {} unknown {} malformed {} resyncs {}; connections \
             {connections} resets {resets}; clock {drift_ppm:+.1} ppm",
            wire.crc,
            wire.cobs,
            wire.oversize,
            wire.version,
            wire.unknown,
            wire.malformed,
            wire.resyncs
        )?;
        if self.packed.made > 0 {
            let PackedSummary { made, received, lost, fillers, between_runs, bits } = self.packed;
            write!(
                formatter,
                "; packed blocks: made {made} received {received} lost {lost} fillers {fillers} bits {bits} \
                 missing between runs {between_runs}"
            )?;
        }
        let PredictionSummary { published, repeated, lost } = self.predictions;
        if published > 0 {
            write!(
                formatter,
                "; predictions: {published} repeated {repeated} features lost {lost}"
            )?;
        }
        write!(formatter, "; {}", self.decoder)?;
        if let Some(stage) = &self.worst_stage {
            let worst = worst_of_deadline(stage);
            write!(formatter, "; stage {}: {worst}", stage.stage)?;
        }
        Ok(())
    }
}
