//! Names, MD5 sums and full definitions of the message types. Recorders store the definitions, so
//! that recordings can be read without the packages of this project.

use ros1::MessageType;

use crate::diagnostics::DiagnosticArray;
use crate::log::Log;
use crate::neuro_event::NeuroEvent;
use crate::neuro_frame::NeuroFrame;
use crate::uint8::UInt8;
use crate::wire::Wire;

/// A message that can be published on a ROS topic.
pub trait RosMessage: Wire {
    /// Name, MD5 sum and definition that publishers and subscribers exchange.
    const TYPE: &'static MessageType;
}

impl RosMessage for NeuroFrame {
    const TYPE: &'static MessageType = &NEURO_FRAME;
}

impl RosMessage for NeuroEvent {
    const TYPE: &'static MessageType = &NEURO_EVENT;
}

impl RosMessage for DiagnosticArray {
    const TYPE: &'static MessageType = &DIAGNOSTIC_ARRAY;
}

impl RosMessage for UInt8 {
    const TYPE: &'static MessageType = &UINT8;
}

impl RosMessage for Log {
    const TYPE: &'static MessageType = &LOG;
}

/// Formats an embedded type for a full definition as `gendeps --cat` does: a line of 80 equals
/// signs, a line with the type's name, and the text of the type's definition.
macro_rules! part {
    ($name:literal, $path:literal) => {
        concat!(
            "\n================================================================================\n",
            "MSG: ",
            $name,
            "\n",
            include_str!($path)
        )
    };
}

static NEURO_FRAME: MessageType = MessageType {
    name: "rosneuro_msgs/NeuroFrame",
    md5: "797997e5036eb017437ce855856d3bad",
    definition: concat!(
        include_str!("../../../ros/rosneuro_msgs/msg/NeuroFrame.msg"),
        part!("std_msgs/Header", "../foreign/std_msgs/Header.msg"),
        part!(
            "rosneuro_msgs/NeuroHeader",
            "../../../ros/rosneuro_msgs/msg/NeuroHeader.msg"
        ),
        part!(
            "rosneuro_msgs/NeuroDataFloat",
            "../../../ros/rosneuro_msgs/msg/NeuroDataFloat.msg"
        ),
        part!(
            "rosneuro_msgs/NeuroDataInfo",
            "../../../ros/rosneuro_msgs/msg/NeuroDataInfo.msg"
        ),
        part!(
            "rosneuro_msgs/NeuroDataInt32",
            "../../../ros/rosneuro_msgs/msg/NeuroDataInt32.msg"
        ),
    ),
};

static NEURO_EVENT: MessageType = MessageType {
    name: "rosneuro_msgs/NeuroEvent",
    md5: "bf2c8b385ba6522f6af8df2da3585c4c",
    definition: concat!(
        include_str!("../../../ros/rosneuro_msgs/msg/NeuroEvent.msg"),
        part!("std_msgs/Header", "../foreign/std_msgs/Header.msg"),
        part!(
            "rosneuro_msgs/NeuroHeader",
            "../../../ros/rosneuro_msgs/msg/NeuroHeader.msg"
        ),
    ),
};

static DIAGNOSTIC_ARRAY: MessageType = MessageType {
    name: "diagnostic_msgs/DiagnosticArray",
    md5: "60810da900de1dd6ddd437c3503511da",
    definition: concat!(
        include_str!("../foreign/diagnostic_msgs/DiagnosticArray.msg"),
        part!("std_msgs/Header", "../foreign/std_msgs/Header.msg"),
        part!(
            "diagnostic_msgs/DiagnosticStatus",
            "../foreign/diagnostic_msgs/DiagnosticStatus.msg"
        ),
        part!(
            "diagnostic_msgs/KeyValue",
            "../foreign/diagnostic_msgs/KeyValue.msg"
        ),
    ),
};

static UINT8: MessageType = MessageType {
    name: "std_msgs/UInt8",
    md5: "7c8164229e7d2c17eb95e9231617fdee",
    definition: include_str!("../foreign/std_msgs/UInt8.msg"),
};

static LOG: MessageType = MessageType {
    name: "rosgraph_msgs/Log",
    md5: "acffd30cd6b6de30f120938c17c593fb",
    definition: concat!(
        include_str!("../foreign/rosgraph_msgs/Log.msg"),
        part!("std_msgs/Header", "../foreign/std_msgs/Header.msg"),
    ),
};
