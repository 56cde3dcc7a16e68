//! The services of an acquisition node.

use neuro_ros::{AcquisitionCommand, AcquisitionInfo};
use ros2_client::qos::{History, WhenFull};
use ros2_client::{
    CreateResult, Message, Name, Node, QosProfile, Server, ServiceMapping, ServiceTypeName,
};
use rustdds::no_key::SerializerAdapter as _;
use rustdds::serialization::CDRSerializerAdapter;
use serde::{Deserialize, Serialize};
use tokio::sync::watch::Receiver;

use crate::messages::GetAcquisitionInfo;
use crate::node::{Ros2Error, name};

/// Number of requests and of responses of a service that can wait.
const DEPTH: usize = 10;

/// Largest reply in bytes that arrives: rustdds sends a larger one in fragments, of which rclpy
/// receives none. The fragments of a message on a topic arrive.
const MAX_REPLY: usize = 1200;

/// Full names of the services of an acquisition node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceNames {
    /// Start the streams of the device.
    pub start: String,
    /// Stop the streams of the device.
    pub stop: String,
    /// End the program.
    pub quit: String,
    /// Shape of the announced frames.
    pub get_info: String,
}

/// Request or response of `std_srvs/Empty`, and request of `ros2neuro_msgs/GetAcquisitionInfo`. A
/// type without fields has this one on the wire.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Empty {
    structure_needs_at_least_one_member: u8,
}

impl Message for Empty {}
impl Message for GetAcquisitionInfo {}

/// The services, before they are served.
pub(crate) struct Services {
    commands: [(AcquisitionCommand, Server<Empty, Empty>); 3],
    info: Server<Empty, GetAcquisitionInfo>,
    announced: Receiver<Option<AcquisitionInfo>>,
}

impl Services {
    pub(crate) fn create(
        node: &mut Node,
        names: &ServiceNames,
        announced: Receiver<Option<AcquisitionInfo>>,
    ) -> Result<Services, Ros2Error> {
        let mapping = service_mapping();
        let empty = ServiceTypeName::new("std_srvs", "Empty");
        let mut command = |command, full_name: &str| {
            let server = create(node, mapping, &name(full_name)?, &empty)?;
            Ok::<_, Ros2Error>((command, server))
        };
        let commands = [
            command(AcquisitionCommand::Start, &names.start)?,
            command(AcquisitionCommand::Stop, &names.stop)?,
            command(AcquisitionCommand::Quit, &names.quit)?,
        ];
        let info = ServiceTypeName::new("ros2neuro_msgs", "GetAcquisitionInfo");
        Ok(Services {
            commands,
            info: create(node, mapping, &name(&names.get_info)?, &info)?,
            announced,
        })
    }

    /// Answers calls and never returns. `on_command` must not wait.
    pub(crate) async fn serve(self, on_command: impl Fn(AcquisitionCommand)) {
        let [start, stop, quit] = &self.commands;
        let command = async |(command, server): &(AcquisitionCommand, Server<Empty, Empty>)| {
            let answer = || {
                on_command(*command);
                Empty::default()
            };
            answer_all(server, answer).await;
        };
        let answer = || {
            let info = self.announced.borrow();
            reply(info.as_ref())
        };
        let info = answer_all(&self.info, answer);
        tokio::join!(command(start), command(stop), command(quit), info);
    }
}

/// Returns how the middleware that `RMW_IMPLEMENTATION` names carries services. Fast DDS and
/// Connext agree, Cyclone DDS differs.
fn service_mapping() -> ServiceMapping {
    match std::env::var("RMW_IMPLEMENTATION").as_deref() {
        Ok("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}

/// Returns the reply of `get_info`: a frame without values, as ROS 2-Neuro's acquisition sends it.
/// `result` is false before the first announcement, and if the reply has more than [`MAX_REPLY`].
fn reply(info: Option<&AcquisitionInfo>) -> GetAcquisitionInfo {
    let Some(info) = info else {
        return GetAcquisitionInfo::default();
    };
    let mut reply = GetAcquisitionInfo::from(info);
    reply.frame.eeg.data.clear();
    reply.frame.exg.data.clear();
    reply.frame.tri.data.clear();
    let encoded = CDRSerializerAdapter::<GetAcquisitionInfo>::to_bytes(&reply);
    let bytes = encoded.map_or(usize::MAX, |bytes| bytes.len());
    if bytes <= MAX_REPLY {
        return reply;
    }
    tracing::warn!(
        "get_info replies that nothing is known, because the names of {} channels make its reply too large for ROS 2; \
         subscribe to neurodata_info, or announce another stream (--announce)",
        info.frame().eeg.info.nchannels
    );
    GetAcquisitionInfo::default()
}

fn create<Response: Message + 'static>(
    node: &mut Node,
    mapping: ServiceMapping,
    name: &Name,
    of: &ServiceTypeName,
) -> CreateResult<Server<Empty, Response>> {
    let qos = QosProfile::publisher_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .history(History::KeepLast { depth: DEPTH });
    node.create_server(mapping, name, of, qos.clone(), qos)
}

/// Answers each call of a service with what `answer` returns.
async fn answer_all<Response: Message + 'static>(
    server: &Server<Empty, Response>,
    answer: impl Fn() -> Response,
) {
    loop {
        let answered = match server.async_receive_request().await {
            Ok((id, _)) => {
                let sent = server.async_send_response(id, answer()).await;
                sent.map_err(|error| error.to_string())
            }
            Err(error) => Err(error.to_string()),
        };
        if let Err(error) = answered {
            tracing::warn!("a call of a ROS 2 service is not answered: {error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use neuro_ros::{NeuroDataInfo, NeuroFrame};

    use super::*;

    fn info(channels: usize) -> AcquisitionInfo {
        let eeg = NeuroDataInfo {
            minmax: vec![-1.0, 1.0],
            stride: 0,
            ..NeuroDataInfo::default()
        };
        let frame = NeuroFrame::encoded(16, channels, eeg);
        AcquisitionInfo::new("board", "1", frame).expect("a valid frame")
    }

    #[test]
    fn get_info_has_the_shape_if_it_fits_and_else_says_that_nothing_is_known() {
        let whole = reply(Some(&info(61)));
        assert!(whole.result && whole.frame.eeg.data.is_empty());
        assert_eq!(whole.frame.eeg.info.labels.len(), 61);
        assert_eq!(whole.device_model, "board");
        let nothing = GetAcquisitionInfo::default();
        assert_eq!(reply(Some(&info(128))), nothing);
        assert_eq!(reply(None), nothing);
    }
}
