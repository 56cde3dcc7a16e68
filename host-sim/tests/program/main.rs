//! Tests that run the program `host-sim`.

mod defects;
mod duration;
mod edf_file;
mod events;
mod output_file;
mod program;
mod repeated_values;
