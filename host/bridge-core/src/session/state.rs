//! State that a session keeps about its device.

use std::sync::Arc;

use link::{Encoder, Quality, StageTiming, Stats, Substitutes, Timing};

use crate::decoder::model::Model;
use crate::device::Device;
use crate::diagnostics::converters::ChainReport;
use crate::diagnostics::link_log::LinkLog;
use crate::diagnostics::packed::PackedReport;
use crate::settings::Settings;
use crate::streams::code::CodeStream;
use crate::streams::decoding::{DecodedStream, Decoding};
use crate::streams::ledger::Ledger;
use crate::streams::packed::PackedStream;
use crate::streams::side::SideStreams;
use crate::time::clock::Clock;
use crate::time::round_trip::RoundTrips;
use crate::wire::commands::Commands;
use crate::wire::identity::Identity;

/// State that the bridge keeps about the device, also while the port is closed.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) settings: Settings,
    pub(super) model: Option<Arc<Model>>,
    /// Rate of the model's packed code, which nobody needs to have chosen.
    pub(crate) model_rate: Option<u8>,
    pub(super) encoder: Encoder,
    pub(crate) commands: Commands,
    pub(crate) identity: Option<Identity>,
    /// Whether `Hello` has arrived since the port was opened. Sequence numbers are ignored before
    /// `Hello`.
    pub(crate) introduced: bool,
    pub(crate) codes: Option<CodeStream>,
    pub(crate) packed: Option<PackedStream>,
    pub(crate) side: SideStreams,
    /// The device that was announced first. A device that is not compatible with it is refused for
    /// as long as the bridge runs.
    pub(super) announced: Option<Arc<Device>>,
    /// Stream that `/neurodata_reconstructed` is decoded from, as it was announced last.
    pub(crate) decoding: Decoding,
    /// Whether the device was asked for the stream that `/acquisition/get_info` describes, and did not refuse to stream,
    /// when it was announced last.
    pub(super) is_described_asked: bool,
    pub(crate) clock: Clock,
    pub(crate) round_trips: RoundTrips,
    pub(crate) frames: Ledger,
    pub(super) old_frames_in_a_row: u32,
    pub(crate) counts: SessionCounts,
    /// Reason why codes or their reconstruction are not published, worded for the user.
    pub(crate) objection: Option<String>,
    pub(crate) stats: Option<Stats>,
    /// Newest report about the electrodes; `None` after `/diagnostics` has published it.
    pub(crate) quality: Option<Quality>,
    /// Newest report about the deadlines; `None` after `/diagnostics` has published it.
    pub(crate) timing: Option<Timing>,
    /// The stage with the largest ratio of worst time to deadline, over all reports.
    pub(crate) worst_stage: Option<StageTiming>,
    pub(crate) converters: Option<ChainReport>,
    /// Electrodes whose signal was not recorded, from the device's newest introduction.
    pub(super) substitutes: Substitutes,
    pub(super) logged: LoggedOnce,
    pub(crate) link_log: LinkLog,
}

/// Flags of the warnings that were logged; each of these warnings is logged once.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoggedOnce {
    pub(super) newer_messages: bool,
    pub(super) wire_version: bool,
    /// Cleared when the device restarts or another device connects. The other flags are never
    /// cleared.
    pub(super) refused_streams: bool,
}

/// Counts of the session that are not part of a stream or a ledger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SessionCounts {
    /// Number of times that the port was opened.
    pub(crate) connections: u64,
    /// Number of detected resets of the device, including changes of the device.
    pub(crate) resets: u64,
    /// Number of codes and packed blocks that arrived before the device's introduction, or from a refused device.
    pub(crate) codes_unused: u64,
    /// Number of missing codes at the last report to `/diagnostics`.
    pub(crate) missing_reported: u64,
    /// State of the packed blocks at the last report to `/diagnostics`.
    pub(crate) packed_reported: PackedReport,
    /// Number of damaged frames at the last report to `/diagnostics`.
    pub(crate) damaged_reported: u32,
}

impl Session {
    pub(crate) fn new(settings: Settings, model: Option<Arc<Model>>) -> Session {
        let commands = Commands::new(settings.mains_hz, settings.streams, settings.packed_rate);
        let decoding = Decoding {
            stream: DecodedStream::of(commands.streams()),
            is_possible: false,
        };
        let packed = model.as_ref().and_then(|model| model.packed());
        Session {
            settings,
            model_rate: packed.map(|packed| packed.description.rate),
            model,
            encoder: Encoder::default(),
            commands,
            identity: None,
            introduced: false,
            codes: None,
            packed: None,
            side: SideStreams::new(settings),
            announced: None,
            decoding,
            is_described_asked: false,
            clock: Clock::default(),
            round_trips: RoundTrips::default(),
            frames: Ledger::default(),
            old_frames_in_a_row: 0,
            counts: SessionCounts::default(),
            objection: None,
            stats: None,
            quality: None,
            timing: None,
            worst_stage: None,
            converters: None,
            substitutes: Substitutes::NONE,
            logged: LoggedOnce::default(),
            link_log: LinkLog::default(),
        }
    }
}
