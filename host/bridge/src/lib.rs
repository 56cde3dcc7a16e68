//! Publishes the codes and signals of a Corticode board as ROS-Neuro messages.
//!
//! ```text
//! port ──bytes──► bridge_core::Core ──effects──► outlets ─┬─► ROS topics
//!  ▲                      │                               ├─► lines of JSON
//!  └────── commands ──────┘                               └─► the live page
//! ```
//!
//! [`run`] is the program `corticode-bridge`, which connects the core of `bridge-core` to a port
//! and to ROS; its subcommands record, replay and convert with the crate `capture`. A
//! [`Publication`] connects the core to ROS for a program that is a device itself and implements
//! [`Feed`].
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

use std::sync::{Mutex, MutexGuard, PoisonError};

mod app;
mod doctor;
mod error;
mod ports;
mod query;
mod realtime;
mod subject_models;
mod update;
mod wire;

pub use app::bridge::{FinalCounts, LivePage, Publication};
pub use app::classifying::{ClassifierOptions, Classifying, PredictionOptions};
pub use app::command_line::ignore_empty_variable;
pub use app::command_line::{ExclusionOptions, PersonOptions, Switch, ViewOptions, choice};
pub use app::config_file::ConfigError;
pub use app::log::start as start_log;
pub use app::parameters::{read as read_parameters, to_flags as parameters_to_flags};
pub use app::ros_node::Namespace;
pub use app::run;
pub use error::BridgeError;
pub use realtime::RealtimeOption;
pub use update::UpdateError;
pub use wire::connection::Event as FeedEvent;
pub use wire::connection::Feed;

/// Locks `mutex`, even if a thread panicked while holding it. The data in every mutex of this crate
/// is consistent after each statement, so the data can still be used.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
