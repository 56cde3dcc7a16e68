//! What an acquisition announces before its first frame.

use serde::Serialize;

use crate::wire::fields;
use crate::{ContractError, NeuroFrame, Shape, Wire, WireError};

/// The answer of `/acquisition/get_info`: what will come, for ever of this shape.
///
/// `rosneuro_recorder` waits for this service, allocates once from its answer and then copies
/// frames unchecked, so an answer that breaks the contract cannot be made.
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

fields!(Response {
    result: bool,
    device_model: String,
    device_id: String,
    frame: NeuroFrame
});

impl AcquisitionInfo {
    /// Announce a device whose frames look like `frame`.
    ///
    /// # Errors
    ///
    /// [`ContractError`] if the frame breaks what consumers rely on.
    pub fn new(
        device_model: &str,
        device_id: &str,
        frame: NeuroFrame,
    ) -> Result<AcquisitionInfo, ContractError> {
        let shape = Shape::of(&frame)?;
        let (device_model, device_id) = (device_model.to_owned(), device_id.to_owned());
        Ok(AcquisitionInfo {
            response: Response {
                result: true,
                device_model,
                device_id,
                frame,
            },
            shape,
        })
    }

    /// The body of the service's response.
    pub fn to_response(&self) -> Vec<u8> {
        self.response.to_bytes()
    }

    /// What a response says; `None` if the acquisition knows nothing yet (`result` false).
    ///
    /// # Errors
    ///
    /// [`WireError`] if the bytes are not such a response.
    pub fn from_response(
        bytes: &[u8],
    ) -> Result<Option<Result<AcquisitionInfo, ContractError>>, WireError> {
        let Response {
            result,
            device_model,
            device_id,
            frame,
        } = Response::from_bytes(bytes)?;
        Ok(result.then(|| AcquisitionInfo::new(&device_model, &device_id, frame)))
    }

    /// The frame that was announced.
    pub fn frame(&self) -> &NeuroFrame {
        &self.response.frame
    }

    /// Model of the device.
    pub fn device_model(&self) -> &str {
        &self.response.device_model
    }

    /// Which device.
    pub fn device_id(&self) -> &str {
        &self.response.device_id
    }

    /// The shape that every frame has.
    pub fn shape(&self) -> Shape {
        self.shape
    }
}
