//! What the bridge knows about the device, from frame to frame.

use std::sync::Arc;

use link::{Encoder, Quality, StageTiming, Stats, Timing};

use crate::decoder::model::Model;
use crate::device::Device;
use crate::diagnostics::converters::ChainReport;
use crate::settings::Settings;
use crate::streams::code::CodeStream;
use crate::streams::ledger::Ledger;
use crate::streams::side::SideStreams;
use crate::time::clock::Clock;
use crate::time::round_trip::RoundTrips;
use crate::wire::commands::Commands;
use crate::wire::identity::Identity;
/// What the bridge knows about the device, from frame to frame.
#[derive(Debug)]
pub(crate) struct Session {
    pub(super) settings: Settings,
    pub(super) model: Option<Arc<Model>>,
    pub(super) encoder: Encoder,
    pub(crate) commands: Commands,
    pub(crate) identity: Option<Identity>,
    /// The device said `Hello` since the port was opened; until then its numbers mean nothing.
    pub(crate) introduced: bool,
    pub(crate) codes: Option<CodeStream>,
    pub(crate) side: SideStreams,
    /// What was announced first; a device whose codes mean anything else is refused for the rest
    /// of the session.
    pub(super) announced: Option<Arc<Device>>,
    pub(crate) clock: Clock,
    pub(crate) round_trips: RoundTrips,
    pub(crate) frames: Ledger,
    pub(super) old_frames_in_a_row: u32,
    pub(crate) counts: SessionCounts,
    /// What keeps codes or their reconstruction from being published, in words.
    pub(crate) objection: Option<String>,
    pub(crate) stats: Option<Stats>,
    /// The newest report about the electrodes that `/diagnostics` has not told of.
    pub(crate) quality: Option<Quality>,
    /// The newest report about the deadlines that `/diagnostics` has not told of.
    pub(crate) timing: Option<Timing>,
    /// The stage that came closest to its deadline in any report, or missed it by most.
    pub(crate) worst_stage: Option<StageTiming>,
    /// The newest report about the converters.
    pub(crate) converters: Option<ChainReport>,
    pub(super) logged: LoggedOnce,
}

/// What the log has been told of, once.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoggedOnce {
    pub(super) newer_messages: bool,
    pub(super) wire_version: bool,
    /// Of streams that this device refuses.
    pub(super) refused_streams: bool,
}

/// What is counted beside codes and frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SessionCounts {
    /// MessageTime that a port was opened.
    pub(crate) connections: u64,
    /// Resets of the device that were noticed.
    pub(crate) resets: u64,
    /// Codes that came before the device had introduced itself, or from one that was refused.
    pub(crate) codes_unused: u64,
    /// Lost codes that `/diagnostics` has told of.
    pub(crate) lost_reported: u64,
    /// Frames that could not be used that `/diagnostics` has told of.
    pub(crate) damaged_reported: u32,
}

impl Session {
    pub(crate) fn new(settings: Settings, model: Option<Arc<Model>>) -> Session {
        Session {
            settings,
            model,
            encoder: Encoder::default(),
            commands: Commands::new(settings.mains_hz, settings.streams),
            identity: None,
            introduced: false,
            codes: None,
            side: SideStreams::new(settings),
            announced: None,
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
            logged: LoggedOnce::default(),
        }
    }
}
