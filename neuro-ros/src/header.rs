//! What frames and events begin with.

use serde::Serialize;

use crate::Stamp;
use crate::wire::fields;

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Header {
    /// Number of the message. roscpp's and rospy's publishers fill it in; ours is set by hand and
    /// equals [`NeuroHeader::seq`].
    pub seq: u32,
    /// Time of the first sample, or of the event.
    pub stamp: Stamp,
    /// Where it was measured; free text.
    pub frame_id: String,
}

fields!(Header {
    seq: u32,
    stamp: Stamp,
    frame_id: String
});

/// `rosneuro_msgs/NeuroHeader`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NeuroHeader {
    /// Number of the frame: starts at 1, goes up by one, wraps at 2^32.
    pub seq: u32,
}

fields!(NeuroHeader { seq: u32 });
