//! Something that happened.

use serde::Serialize;

use crate::wire::fields;
use crate::{Header, NeuroHeader};

/// `rosneuro_msgs/NeuroEvent`: something that happened at `header.stamp`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroEvent {
    /// When.
    pub header: Header,
    /// The event's number.
    pub neuroheader: NeuroHeader,
    /// Version of the event codes.
    pub version: String,
    /// Code of the event, as in a GDF event table; `| 0x8000` ends it.
    pub event: i32,
    /// Seconds; 0 when not known.
    pub duration: f32,
    /// Family of the event codes.
    pub family: i32,
    /// In words.
    pub description: String,
}

fields!(NeuroEvent {
    header: Header,
    neuroheader: NeuroHeader,
    version: String,
    event: i32,
    duration: f32,
    family: i32,
    description: String,
});
