//! ROS-Neuro messages, the contract of its acquisition node, and sinks.
#![forbid(unsafe_code)]
