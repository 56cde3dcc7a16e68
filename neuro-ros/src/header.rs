//! The headers at the start of frames and events.

use serde::Serialize;

use crate::stamp::Stamp;
use crate::wire::impl_wire;

/// `std_msgs/Header`: number, time and place of a message.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Header {
    /// Number of the message. Publishers of roscpp and rospy fill it in; here the caller sets it, to
    /// the same value as [`NeuroHeader::seq`].
    pub seq: u32,
    /// Time of the first sample, or of the event.
    pub stamp: Stamp,
    /// Coordinate frame of the data, as free text; can be empty.
    pub frame_id: String,
}

impl_wire!(Header {
    seq: u32,
    stamp: Stamp,
    frame_id: String
});

/// `rosneuro_msgs/NeuroHeader`: the number of a frame or event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NeuroHeader {
    /// Starts at 1, increases by one, wraps at 2^32.
    pub seq: u32,
}

impl_wire!(NeuroHeader { seq: u32 });
