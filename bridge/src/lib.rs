//! Frames from the board, republished as ROS-Neuro NeuroFrames.
#![forbid(unsafe_code)]
