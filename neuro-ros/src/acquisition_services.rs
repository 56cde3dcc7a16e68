//! The services of an acquisition node.

use std::sync::Arc;

use ros1::{Node, NodeError, Service, ServiceType};

use crate::AcquisitionInfo;

/// Name under which recorder and visualizer look for the announcement.
pub const GET_INFO_SERVICE: &str = "/acquisition/get_info";

/// `rosneuro_msgs/GetAcquisitionInfo`.
pub static GET_ACQUISITION_INFO: ServiceType = ServiceType {
    name: "rosneuro_msgs/GetAcquisitionInfo",
    md5: "8cf1aae8f1ae02fdc8775b1362badac5",
    definition: include_str!("../srv/GetAcquisitionInfo.srv"),
};

/// `std_srvs/Empty`.
pub static EMPTY: ServiceType = ServiceType {
    name: "std_srvs/Empty",
    md5: "d41d8cd98f00b204e9800998ecf8427e",
    definition: include_str!("../foreign/std_srvs/Empty.srv"),
};

/// What an acquisition node can be asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AcquisitionCommand {
    /// `~start`: frames shall come.
    Start,
    /// `~stop`: no frames shall come, until the next start.
    Stop,
    /// `~quit`: the node shall leave.
    Quit,
}

/// The services of an acquisition node, while this lives.
///
/// The announcement is served only from the moment it is known, because the recorder waits for
/// the service to appear and does not look at `result`.
#[derive(Debug)]
pub struct AcquisitionServices {
    /// Services leave with their handles.
    _services: [Service; 4],
}

impl AcquisitionServices {
    /// Serve `info` as [`GET_INFO_SERVICE`], and `~start`, `~stop` and `~quit`.
    ///
    /// `on_command` must not wait. What it returns as an error is what the caller sees.
    ///
    /// # Errors
    ///
    /// [`NodeError`] if one of the services exists on this node already.
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
