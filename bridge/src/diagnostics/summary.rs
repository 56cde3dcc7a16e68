//! What was received, lost and filled, in one line.

use std::fmt;

use link::{Counters, StageTiming};

use crate::diagnostics::timing::worst_of_deadline;
use crate::session::state::Session;

/// What was received, lost and filled until now; prints as one line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Codes that the device made, as far as their numbers tell: received + lost.
    pub made: u64,
    /// Codes that arrived.
    pub received: u64,
    /// Codes that did not.
    pub lost: u64,
    /// Runs of lost codes.
    pub bursts: u64,
    /// Longest run of lost codes.
    pub longest_burst: u32,
    /// Fillers published in place of lost codes.
    pub fillers: u64,
    /// Frames of any kind that did not arrive.
    pub frames_lost: u64,
    /// What the frame decoder has counted.
    pub wire: Counters,
    /// MessageTime that a port was opened.
    pub connections: u64,
    /// Resets of the device that were noticed.
    pub resets: u64,
    /// Codes that could not be used: from before an introduction, from a refused device, or of
    /// another model or format than the device named.
    pub unused: u64,
    /// Host's clock against the device's, parts per million.
    pub drift_ppm: f64,
    /// The device's stage that came closest to its deadline, or missed it by most; none of a device
    /// that measures none.
    pub worst_stage: Option<StageTiming>,
}

impl Summary {
    pub(crate) fn new(session: &Session, wire: &Counters) -> Summary {
        let counts = session.codes.as_ref().map(|codes| codes.counts().clone());
        let counts = counts.unwrap_or_default();
        Summary {
            made: counts.ledger.made(),
            received: counts.ledger.received(),
            lost: counts.ledger.lost(),
            bursts: counts.ledger.bursts(),
            longest_burst: counts.ledger.longest_burst(),
            fillers: counts.fillers,
            frames_lost: session.frames.lost(),
            wire: *wire,
            connections: session.counts.connections,
            resets: session.counts.resets,
            unused: session.counts.codes_unused + counts.foreign,
            drift_ppm: session.clock.drift_ppm(),
            worst_stage: session.worst_stage,
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Summary {
            made,
            received,
            lost,
            bursts,
            longest_burst,
            fillers,
            ..
        } = self;
        let Summary {
            frames_lost,
            wire,
            connections,
            resets,
            unused,
            drift_ppm,
            ..
        } = self;
        write!(
            formatter,
            "codes: made {made} received {received} lost {lost} (bursts {bursts}, longest \
             {longest_burst}) fillers {fillers} unused {unused}; frames: lost {frames_lost} crc \
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
        if let Some(stage) = &self.worst_stage {
            write!(
                formatter,
                "; stage {}: {}",
                stage.stage,
                worst_of_deadline(stage)
            )?;
        }
        Ok(())
    }
}
