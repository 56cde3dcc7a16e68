//! Tests of the virtual board as a library and as the program `host-sim`.
#![forbid(unsafe_code)]

mod closed_pipe;
mod defects;
mod duration;
mod edf_file;
mod events;
mod faults;
mod gdf_file;
mod inspect;
mod json_lines;
mod output_file;
mod program;
mod scenarios;
mod session;
