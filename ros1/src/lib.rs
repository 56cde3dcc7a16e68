//! A small, sturdy ROS 1 node and master.
#![forbid(unsafe_code)]
