//! Names, MD5 sums and full definitions of the message types. The MD5 sums are those that
//! `rosmsg md5` prints for the original packages. Recorders store the definitions, so that
//! recordings can be read without the packages of this project.

use ros1::MessageType;

use crate::rosneuro_msgs::{NeuroEvent, NeuroFrame, NeuroOutput};
use crate::standard_msgs::{DiagnosticArray, Log, UInt8};
use crate::wire::Wire;

/// A message that can be published on a ROS topic.
pub trait RosMessage: Wire {
    /// Name, MD5 sum and definition that publishers and subscribers exchange.
    const TYPE: &'static MessageType;
}

/// Includes the text of a definition file, from the package `rosneuro_msgs` or from another
/// package.
macro_rules! text {
    ("rosneuro_msgs", $name:literal) => {
        include_str!(concat!("../../../ros/rosneuro_msgs/msg/", $name, ".msg"))
    };
    ($package:literal, $name:literal) => {
        include_str!(concat!("../foreign/", $package, "/", $name, ".msg"))
    };
}

/// Implements [`RosMessage`]. Arguments: the Rust type, the message's package and name, its MD5
/// sum, and package and name of each embedded type. The full definition has the format of `gendeps
/// --cat`: the message's definition, then for each embedded type a line of 80 equals signs, a line
/// with the type's name, and the text of its definition.
macro_rules! impl_ros_message {
    ($type:ty, $package:tt / $name:tt, $md5:literal $(, $part_package:tt / $part:tt)*) => {
        impl RosMessage for $type {
            const TYPE: &'static MessageType = &MessageType {
                name: concat!($package, "/", $name),
                md5: $md5,
                definition: concat!(
                    text!($package, $name),
                    $(
                        "\n====================",
                        "============================================================\nMSG: ",
                        $part_package,
                        "/",
                        $part,
                        "\n",
                        text!($part_package, $part),
                    )*
                ),
            };
        }
    };
}

impl_ros_message!(
    NeuroFrame,
    "rosneuro_msgs" / "NeuroFrame",
    "797997e5036eb017437ce855856d3bad",
    "std_msgs" / "Header",
    "rosneuro_msgs" / "NeuroHeader",
    "rosneuro_msgs" / "NeuroDataFloat",
    "rosneuro_msgs" / "NeuroDataInfo",
    "rosneuro_msgs" / "NeuroDataInt32"
);
impl_ros_message!(
    NeuroEvent,
    "rosneuro_msgs" / "NeuroEvent",
    "bf2c8b385ba6522f6af8df2da3585c4c",
    "std_msgs" / "Header",
    "rosneuro_msgs" / "NeuroHeader"
);
impl_ros_message!(
    NeuroOutput,
    "rosneuro_msgs" / "NeuroOutput",
    "0460a5803a75972e2c86e91d64e44fdc",
    "std_msgs" / "Header",
    "rosneuro_msgs" / "NeuroHeader",
    "rosneuro_msgs" / "NeuroDataFloat",
    "rosneuro_msgs" / "NeuroDataInfo",
    "rosneuro_msgs" / "NeuroDataInt32",
    "rosneuro_msgs" / "NeuroDecoder"
);
impl_ros_message!(
    DiagnosticArray,
    "diagnostic_msgs" / "DiagnosticArray",
    "60810da900de1dd6ddd437c3503511da",
    "std_msgs" / "Header",
    "diagnostic_msgs" / "DiagnosticStatus",
    "diagnostic_msgs" / "KeyValue"
);
impl_ros_message!(UInt8, "std_msgs" / "UInt8", "7c8164229e7d2c17eb95e9231617fdee");
impl_ros_message!(
    Log,
    "rosgraph_msgs" / "Log",
    "acffd30cd6b6de30f120938c17c593fb",
    "std_msgs" / "Header"
);
