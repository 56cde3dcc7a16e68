//! The messages of the topic `/rosout`.

use crate::header::Header;
use crate::wire::impl_wire;

/// `rosgraph_msgs/Log`: one line of a node's log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Log {
    /// Number and time of the line; `frame_id` is empty.
    pub header: Header,
    /// Severity: one of [`Log::INFO`], [`Log::WARN`] and [`Log::ERROR`], or 1 for debug messages and
    /// 16 for fatal ones.
    pub level: u8,
    /// Full name of the node.
    pub name: String,
    /// Text of the line.
    pub msg: String,
    /// Source file, if known.
    pub file: String,
    /// Function or module, if known.
    pub function: String,
    /// Line in the source file; 0 if unknown.
    pub line: u32,
    /// Topics that the node publishes; can be empty.
    pub topics: Vec<String>,
}

impl Log {
    /// Level of normal messages.
    pub const INFO: u8 = 2;
    /// Level of warnings.
    pub const WARN: u8 = 4;
    /// Level of errors.
    pub const ERROR: u8 = 8;
}

impl_wire!(Log {
    header: Header,
    level: u8,
    name: String,
    msg: String,
    file: String,
    function: String,
    line: u32,
    topics: Vec<String>,
});
