//! The interface of an acquisition node: its announcement, which recorders request before the first
//! frame, and its commands start, stop and quit.

use std::sync::Arc;

use ros1::{Node, NodeError, Service, ServiceType};
use serde::Serialize;

use crate::rosneuro_msgs::NeuroFrame;
use crate::shape::{ContractError, Shape};
use crate::wire::{Wire, WireError, impl_wire};

/// The response of the service `/acquisition/get_info`: the device, and an example frame with the
/// shape of all later frames.
///
/// `rosneuro_recorder` waits for this service, allocates its buffers once from the response and
/// then copies frames without checking their size. Therefore a value of this type always holds a
/// frame that fulfils the contract, whose rules [`ContractError`] lists.
#[derive(Clone, Debug, PartialEq)]
pub struct AcquisitionInfo {
    response: Response,
    shape: Shape,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
struct Response {
    result: bool,
    device_model: String,
    device_id: String,
    frame: NeuroFrame,
}

impl_wire!(Response { result, device_model, device_id, frame });

impl AcquisitionInfo {
    /// Creates the announcement of a device whose frames have the shape of `frame`.
    ///
    /// # Errors
    ///
    /// [`ContractError`] if the frame violates the contract.
    pub fn new(
        device_model: &str,
        device_id: &str,
        frame: NeuroFrame,
    ) -> Result<AcquisitionInfo, ContractError> {
        let shape = Shape::from_frame(&frame)?;
        let (device_model, device_id) = (device_model.to_owned(), device_id.to_owned());
        Ok(AcquisitionInfo {
            response: Response { result: true, device_model, device_id, frame },
            shape,
        })
    }

    /// Encodes the body of the service's response.
    pub fn to_response(&self) -> Vec<u8> {
        self.response.to_bytes()
    }

    /// Decodes the body of a response. Returns `None` if the acquisition has no information yet
    /// (`result` is false). Returns the inner error if the announced frame violates the contract.
    ///
    /// # Errors
    ///
    /// [`WireError`] if the bytes are not a response of this service.
    pub fn from_response(
        bytes: &[u8],
    ) -> Result<Option<Result<AcquisitionInfo, ContractError>>, WireError> {
        let Response { result, device_model, device_id, frame } = Response::from_bytes(bytes)?;
        Ok(result.then(|| AcquisitionInfo::new(&device_model, &device_id, frame)))
    }

    /// Returns the announced frame, an example with the shape of all later frames.
    pub fn frame(&self) -> &NeuroFrame {
        &self.response.frame
    }

    /// Model name of the device as free text, such as board and firmware version.
    pub fn device_model(&self) -> &str {
        &self.response.device_model
    }

    /// Identifier of the individual device, such as its unique ID.
    pub fn device_id(&self) -> &str {
        &self.response.device_id
    }

    /// Shape of the announced frame, which all later frames must have.
    pub fn shape(&self) -> Shape {
        self.shape
    }
}

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
    _services: Vec<Service>,
}

impl AcquisitionServices {
    /// Provides the service named `get_info` (usually [`GET_INFO_SERVICE`]), with the announcement
    /// that `on_info` returns for the calling node's name, and the services `~start`, `~stop` and
    /// `~quit`.
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
        on_info: impl Fn(&str) -> Result<AcquisitionInfo, String> + Send + Sync + 'static,
        on_command: impl Fn(AcquisitionCommand) -> Result<(), String> + Send + Sync + 'static,
    ) -> Result<AcquisitionServices, NodeError> {
        let on_command = Arc::new(on_command);
        let command = |command: AcquisitionCommand| {
            let on_command = Arc::clone(&on_command);
            move |_caller: &str, _request: &[u8]| on_command(command).map(|()| Vec::new())
        };
        let info = move |caller: &str, _: &[u8]| on_info(caller).map(|info| info.to_response());
        let mut services = vec![node.serve(get_info, &GET_ACQUISITION_INFO, info).await?];
        for (name, request) in [
            ("~start", AcquisitionCommand::Start),
            ("~stop", AcquisitionCommand::Stop),
            ("~quit", AcquisitionCommand::Quit),
        ] {
            services.push(node.serve(name, &EMPTY, command(request)).await?);
        }
        Ok(AcquisitionServices { _services: services })
    }
}
