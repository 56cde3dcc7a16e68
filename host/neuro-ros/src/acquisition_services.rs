//! The ROS services of an acquisition node: its announcement, and its commands start, stop and
//! quit.

use std::sync::Arc;

use ros1::{Node, NodeError, Service, ServiceType};

use crate::acquisition_info::AcquisitionInfo;

/// Name of the service from which the recorder and the visualizer request the announcement.
pub const GET_INFO_SERVICE: &str = "/acquisition/get_info";

/// Type of [`GET_INFO_SERVICE`]: an empty request; the response is an [`AcquisitionInfo`].
pub static GET_ACQUISITION_INFO: ServiceType = ServiceType {
    name: "rosneuro_msgs/GetAcquisitionInfo",
    md5: "8cf1aae8f1ae02fdc8775b1362badac5",
    definition: include_str!("../../../ros/rosneuro_msgs/srv/GetAcquisitionInfo.srv"),
};

/// Type of `~start`, `~stop` and `~quit`: empty request and response.
pub static EMPTY: ServiceType = ServiceType {
    name: "std_srvs/Empty",
    md5: "d41d8cd98f00b204e9800998ecf8427e",
    definition: include_str!("../foreign/std_srvs/Empty.srv"),
};

/// A request that an acquisition node receives as a service call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AcquisitionCommand {
    /// `~start`: publish frames.
    Start,
    /// `~stop`: publish no frames until the next `~start`.
    Stop,
    /// `~quit`: shut the node down.
    Quit,
}

/// Handles of an acquisition node's services. Dropping the value unregisters them.
#[derive(Debug)]
pub struct AcquisitionServices {
    /// Kept only because dropping a handle unregisters its service.
    _services: [Service; 4],
}

impl AcquisitionServices {
    /// Provides `get_info` (by default [`GET_INFO_SERVICE`]) with the announcement that `on_info`
    /// returns, and the services `~start`, `~stop` and `~quit`.
    ///
    /// `on_info` and `on_command` are called for each call and must not block. If they return an
    /// error message, the call fails and the caller of the service receives the message. Without an
    /// announcement `on_info` must fail: the recorder repeats a failed call and does not check
    /// `result`.
    ///
    /// # Errors
    ///
    /// [`NodeError`] if this node already has one of the services or the master refuses one.
    pub async fn serve(
        node: &Node,
        get_info: &str,
        on_info: impl Fn() -> Result<AcquisitionInfo, String> + Send + Sync + 'static,
        on_command: impl Fn(AcquisitionCommand) -> Result<(), String> + Send + Sync + 'static,
    ) -> Result<AcquisitionServices, NodeError> {
        let on_command = Arc::new(on_command);
        let command = |command: AcquisitionCommand| {
            let on_command = Arc::clone(&on_command);
            move |_request: &[u8]| on_command(command).map(|()| Vec::new())
        };
        let info = node
            .serve(get_info, &GET_ACQUISITION_INFO, move |_request: &[u8]| {
                on_info().map(|info| info.to_response())
            })
            .await?;
        let start = node
            .serve("~start", &EMPTY, command(AcquisitionCommand::Start))
            .await?;
        let stop = node
            .serve("~stop", &EMPTY, command(AcquisitionCommand::Stop))
            .await?;
        let quit = node
            .serve("~quit", &EMPTY, command(AcquisitionCommand::Quit))
            .await?;
        Ok(AcquisitionServices {
            _services: [info, start, stop, quit],
        })
    }
}
