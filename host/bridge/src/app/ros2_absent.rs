//! Replaces `ros2_outlet` in builds without the feature `ros2`, such as those of `cargo demo` and
//! `cargo loop`: every attempt to use ROS 2 fails.

use std::sync::Arc;

use neuro_ros::ros1::NodeOptions;
use neuro_ros::{AcquisitionInfo, DiagnosticStatus, Log, Sink};
use thiserror::Error;
use tokio::sync::mpsc::{Receiver, UnboundedSender};
use tokio::sync::watch;

use crate::app::command_line::Ros2Options;
use crate::app::ros_node::{Namespace, NodeCommand};
use crate::error::BridgeError;

/// This build has no ROS 2.
#[derive(Debug, Error)]
#[error(
    "this corticode-bridge was built without ROS 2; `cargo build --release --package bridge` builds it with ROS 2"
)]
pub struct Ros2Error;

/// Returns whether the error is wrong usage, not a network failure; in this build always true.
pub(crate) const fn is_usage(Ros2Error: &Ros2Error) -> bool {
    true
}

/// Trait of the messages that ROS 2 can carry; in this build, every type implements it.
pub(crate) trait Ros2Message {}

impl<M> Ros2Message for M {}

/// The bridge's ROS 2 node, which cannot exist in this build.
pub(crate) enum Ros2Outlet {}

impl Ros2Outlet {
    pub(crate) fn start(
        _ros: &NodeOptions,
        _options: &Ros2Options,
        _namespace: &Namespace,
        _commands: UnboundedSender<NodeCommand>,
    ) -> Result<Arc<Ros2Outlet>, BridgeError> {
        Err(Ros2Error.into())
    }

    pub(crate) fn sink<M>(&self, _name: &str) -> Result<Box<dyn Sink<M>>, BridgeError> {
        match *self {}
    }

    pub(crate) fn announce(
        &self,
        _announced: watch::Receiver<Option<AcquisitionInfo>>,
    ) -> Result<(), BridgeError> {
        match *self {}
    }

    pub(crate) fn publish_log(&self, _lines: Receiver<Log>) -> Result<(), BridgeError> {
        match *self {}
    }

    pub(crate) fn waiting(&self) -> u64 {
        match *self {}
    }

    pub(crate) fn status(&self) -> DiagnosticStatus {
        match *self {}
    }
}

/// Domain of a ROS 2 node; in this build, its check always fails.
pub(crate) struct Domain {
    pub(crate) localhost_only: bool,
}

impl Domain {
    #[expect(clippy::unused_self, reason = "as in a build with ROS 2")]
    pub(crate) fn check(&self) -> Result<(), Ros2Error> {
        Err(Ros2Error)
    }
}

pub(crate) fn ros2_domain(
    _options: &Ros2Options,
    _variable: impl Fn(&str) -> Option<String>,
) -> Domain {
    Domain { localhost_only: false }
}
