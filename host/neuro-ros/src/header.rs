//! The headers at the start of frames and events.

use serde::Serialize;

use crate::stamp::Stamp;
use crate::wire::impl_wire;

/// `std_msgs/Header`: sequence number, time and coordinate frame of a message.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Header {
    /// Sequence number of the message. In roscpp and rospy the publisher sets this number; in this
    /// crate the caller sets it to the value of [`NeuroHeader::seq`].
    pub seq: u32,
    /// Time of the frame's first sample, or start of the event. An unset stamp is left out of JSON.
    #[serde(skip_serializing_if = "Stamp::is_unset")]
    pub stamp: Stamp,
    /// Coordinate frame of the data, as free text; can be empty.
    pub frame_id: String,
}

impl_wire!(Header {
    seq: u32,
    stamp: Stamp,
    frame_id: String
});

/// `rosneuro_msgs/NeuroHeader`: the sequence number of a frame or event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NeuroHeader {
    /// Sequence number: starts at 1, increases by one per message, wraps at 2^32.
    pub seq: u32,
}

impl_wire!(NeuroHeader { seq: u32 });
