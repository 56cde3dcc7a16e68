//! Tests of the whole product, with one module for each promise to its users.
#![forbid(unsafe_code)]

mod architecture;
mod bad_electrodes;
mod calibrated_model;
mod catkin;
mod closed_loop;
mod debian_package;
mod decoding_page;
mod encoder;
mod encoder_numpy;
mod filters;
mod float_numpy;
mod impedance;
mod inputs;
mod licences;
mod manual;
mod messages;
mod node_chain;
mod offline_files;
mod other_models;
mod own_master;
mod packed_chain;
mod packed_loss;
mod packed_python;
mod predictions;
mod qemu_chain;
mod quantise;
mod raw_forms;
mod readme;
mod realtime;
mod ros_chain;
mod samples_chain;
mod service;
mod synthetic_eeg;
mod udev_rule;
mod uploaded_model;
