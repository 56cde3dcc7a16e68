//! The messages as ROS 2 defines them, converted from those of `neuro-ros`.
//!
//! CDR encodes no field names, so the fields have the order of the definitions in
//! `ros/ros2/ros2neuro_msgs/` and in ROS 2's own packages. Units and ranges are as in `neuro-ros`.

use serde::{Deserialize, Serialize};

/// A message of `neuro-ros` that has a ROS 2 type.
pub trait Ros2Message: 'static {
    /// The type that is serialised.
    type Message: Serialize + for<'a> From<&'a Self> + Clone + Send + Sync + 'static;
    /// Package of the type's definition.
    const PACKAGE: &'static str;
    /// Name of the type in its package.
    const NAME: &'static str;
}

macro_rules! impl_ros2_message {
    ($($package:literal: $($name:ident)*;)*) => {$($(
        impl Ros2Message for neuro_ros::$name {
            type Message = $name;
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = stringify!($name);
        }
    )*)*};
}
impl_ros2_message! {
    "ros2neuro_msgs": NeuroFrame NeuroEvent NeuroOutput;
    "diagnostic_msgs": DiagnosticArray;
    "rcl_interfaces": Log;
}

/// `builtin_interfaces/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds since 1970-01-01 UTC.
    pub sec: i32,
    /// Nanoseconds within the second.
    pub nanosec: u32,
}

impl From<neuro_ros::Stamp> for Time {
    /// ROS 2 can represent times until 2038; a later time becomes the last one that it can
    /// represent.
    fn from(stamp: neuro_ros::Stamp) -> Time {
        match i32::try_from(stamp.secs) {
            Ok(sec) => Time { sec, nanosec: stamp.nsecs },
            Err(_) => Time { sec: i32::MAX, nanosec: 999_999_999 },
        }
    }
}

/// `std_msgs/Header`, which has no sequence number in ROS 2.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of the frame's first sample, or start of the event.
    pub stamp: Time,
    /// Coordinate frame of the data, as free text.
    pub frame_id: String,
}

impl From<&neuro_ros::Header> for Header {
    fn from(header: &neuro_ros::Header) -> Header {
        Header { stamp: header.stamp.into(), frame_id: header.frame_id.clone() }
    }
}

/// Defines messages, and their conversion from the type of the same name in `neuro-ros`, whose
/// fields have the same names.
macro_rules! messages {
    ($($(#[$comment:meta])* $name:ident { $($field:ident: $type:ty = $convert:expr,)* })*) => {$(
        $(#[$comment])*
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[allow(missing_docs, reason = "the type of the same name in neuro-ros has them")]
        pub struct $name {
            $(pub $field: $type,)*
        }

        impl From<&neuro_ros::$name> for $name {
            fn from(message: &neuro_ros::$name) -> $name {
                $name {
                    $($field: {
                        let convert: fn(&neuro_ros::$name) -> $type = $convert;
                        convert(message)
                    },)*
                }
            }
        }
    )*};
}

messages! {
    /// `ros2neuro_msgs/NeuroHeader`.
    NeuroHeader {
        seq: u32 = |header| header.seq,
    }
    /// `ros2neuro_msgs/NeuroDataInfo`.
    NeuroDataInfo {
        nsamples: u16 = |info| info.nsamples,
        nchannels: u16 = |info| info.nchannels,
        stride: u16 = |info| info.stride,
        unit: String = |info| info.unit.clone(),
        transducter: String = |info| info.transducter.clone(),
        prefiltering: String = |info| info.prefiltering.clone(),
        isint: u8 = |info| info.isint,
        minmax: Vec<f64> = |info| info.minmax.clone(),
        labels: Vec<String> = |info| info.labels.clone(),
    }
    /// `ros2neuro_msgs/NeuroDataFloat`.
    NeuroDataFloat {
        info: NeuroDataInfo = |block| (&block.info).into(),
        data: Vec<f32> = |block| block.data.clone(),
    }
    /// `ros2neuro_msgs/NeuroDataInt32`.
    NeuroDataInt32 {
        info: NeuroDataInfo = |block| (&block.info).into(),
        data: Vec<i32> = |block| block.data.clone(),
    }
    /// `ros2neuro_msgs/NeuroFrame`.
    NeuroFrame {
        header: Header = |frame| (&frame.header).into(),
        neuroheader: NeuroHeader = |frame| (&frame.neuroheader).into(),
        sr: u16 = |frame| frame.sr,
        eeg: NeuroDataFloat = |frame| (&frame.eeg).into(),
        exg: NeuroDataFloat = |frame| (&frame.exg).into(),
        tri: NeuroDataInt32 = |frame| (&frame.tri).into(),
    }
    /// `ros2neuro_msgs/NeuroEvent`.
    NeuroEvent {
        header: Header = |event| (&event.header).into(),
        neuroheader: NeuroHeader = |event| (&event.neuroheader).into(),
        version: String = |event| event.version.clone(),
        event: i32 = |event| event.event,
        duration: f32 = |event| event.duration,
        family: i32 = |event| event.family,
        description: String = |event| event.description.clone(),
    }
    /// `ros2neuro_msgs/NeuroDecoder`.
    NeuroDecoder {
        r#type: String = |decoder| decoder.r#type.clone(),
        path: String = |decoder| decoder.path.clone(),
        classes: Vec<i32> = |decoder| decoder.classes.clone(),
    }
    /// `ros2neuro_msgs/NeuroOutput`.
    NeuroOutput {
        header: Header = |output| (&output.header).into(),
        neuroheader: NeuroHeader = |output| (&output.neuroheader).into(),
        softpredict: NeuroDataFloat = |output| (&output.softpredict).into(),
        hardpredict: NeuroDataInt32 = |output| (&output.hardpredict).into(),
        decoder: NeuroDecoder = |output| (&output.decoder).into(),
    }
    /// `diagnostic_msgs/KeyValue`.
    KeyValue {
        key: String = |value| value.key.clone(),
        value: String = |value| value.value.clone(),
    }
    /// `diagnostic_msgs/DiagnosticStatus`.
    DiagnosticStatus {
        level: u8 = |status| status.level as u8,
        name: String = |status| status.name.clone(),
        message: String = |status| status.message.clone(),
        hardware_id: String = |status| status.hardware_id.clone(),
        values: Vec<KeyValue> = |status| status.values.iter().map(KeyValue::from).collect(),
    }
    /// `diagnostic_msgs/DiagnosticArray`.
    DiagnosticArray {
        header: Header = |report| (&report.header).into(),
        status: Vec<DiagnosticStatus> = |report| {
            report.status.iter().map(DiagnosticStatus::from).collect()
        },
    }
    /// `rcl_interfaces/Log`. Its levels are ten times those of ROS 1: 10 for debug messages, then
    /// 20, 30, 40 and 50.
    Log {
        stamp: Time = |line| line.header.stamp.into(),
        level: u8 = |line| match line.level {
            neuro_ros::Log::INFO => 20,
            neuro_ros::Log::WARN => 30,
            neuro_ros::Log::ERROR => 40,
            level if level > neuro_ros::Log::ERROR => 50,
            _ => 10,
        },
        name: String = |line| line.name.clone(),
        msg: String = |line| line.msg.clone(),
        file: String = |line| line.file.clone(),
        function: String = |line| line.function.clone(),
        line: u32 = |line| line.line,
    }
}

/// Response of the service `ros2neuro_msgs/GetAcquisitionInfo`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetAcquisitionInfo {
    /// Whether the other fields are valid.
    pub result: bool,
    /// Model name of the device.
    pub device_model: String,
    /// Identifier of the individual device.
    pub device_id: String,
    /// A frame with the shape of all later frames.
    pub frame: NeuroFrame,
}

impl From<&neuro_ros::AcquisitionInfo> for GetAcquisitionInfo {
    fn from(info: &neuro_ros::AcquisitionInfo) -> GetAcquisitionInfo {
        GetAcquisitionInfo {
            result: true,
            device_model: info.device_model().to_owned(),
            device_id: info.device_id().to_owned(),
            frame: info.frame().into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use neuro_ros::Stamp;

    use super::*;

    #[test]
    fn times_after_2038_become_the_last_one() {
        let time = |secs| Time::from(Stamp { secs, nsecs: 5 });
        let last = i32::MAX as u32;
        assert_eq!((time(last).sec, time(last).nanosec), (i32::MAX, 5));
        let (sec, nanosec) = (i32::MAX, 999_999_999);
        assert_eq!(time(last + 1), Time { sec, nanosec });
    }

    #[test]
    fn levels_of_the_log_are_those_of_ros_2() {
        let level = |level| {
            let line = neuro_ros::Log { level, ..neuro_ros::Log::default() };
            Log::from(&line).level
        };
        assert_eq!([1, 2, 4, 8, 16].map(level), [10, 20, 30, 40, 50]);
    }
}
