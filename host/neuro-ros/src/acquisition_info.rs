//! The announcement of an acquisition. Recorders request it before the first frame.

use serde::Serialize;

use crate::neuro_frame::NeuroFrame;
use crate::shape::{ContractError, Shape};
use crate::wire::{Wire, WireError, impl_wire};

/// The response of the service `/acquisition/get_info`: the device, and an example frame with the
/// shape of all later frames.
///
/// `rosneuro_recorder` waits for this service, allocates its buffers once from the response and
/// then copies frames without checking their size. Therefore a value of this type always fulfils
/// the contract.
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

impl_wire!(Response {
    result: bool,
    device_model: String,
    device_id: String,
    frame: NeuroFrame
});

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
            response: Response {
                result: true,
                device_model,
                device_id,
                frame,
            },
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
        let Response {
            result,
            device_model,
            device_id,
            frame,
        } = Response::from_bytes(bytes)?;
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
