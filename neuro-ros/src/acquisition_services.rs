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
    definition: include_str!("../srv/GetAcquisitionInfo.srv"),
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
///
/// Start the services only when the announcement is complete. The recorder requests it as soon as
/// the service appears and does not check `result`.
#[derive(Debug)]
pub struct AcquisitionServices {
    /// Kept only because dropping a handle unregisters its service.
    _services: [Service; 4],
}

impl AcquisitionServices {
    /// Provides [`GET_INFO_SERVICE`] with the response `info`, and the services `~start`, `~stop`
    /// and `~quit`.
    ///
    /// `on_command` is called for each command and must not block. If `on_command` returns an error
    /// message, the caller of the service receives the message.
    ///
    /// # Errors
    ///
    /// [`NodeError`] if this node already has one of the services or the master refuses one.
    pub async fn serve(
        node: &Node,
        info: &AcquisitionInfo,
        on_command: impl Fn(AcquisitionCommand) -> Result<(), String> + Send + Sync + 'static,
    ) -> Result<AcquisitionServices, NodeError> {
        let response = info.to_response();
        let on_command = Arc::new(on_command);
        let command = |command: AcquisitionCommand| {
            let on_command = Arc::clone(&on_command);
            move |_request: &[u8]| on_command(command).map(|()| Vec::new())
        };
        let info = node
            .serve(
                GET_INFO_SERVICE,
                &GET_ACQUISITION_INFO,
                move |_request: &[u8]| Ok(response.clone()),
            )
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
