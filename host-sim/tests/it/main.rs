//! Tests of the virtual board as a library and as the program `host-sim`.
#![forbid(unsafe_code)]

mod defects;
mod duration;
mod edf_file;
mod events;
mod faults;
mod json_lines;
mod output_file;
mod program;
mod session;
