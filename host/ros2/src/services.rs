//! The services of an acquisition node.

use std::time::Duration;

use neuro_ros::{AcquisitionCommand, AcquisitionInfo};
use ros2_client::qos::{History, WhenFull};
use ros2_client::{
    Message, Publisher, QosProfile, Server, ServiceMapping, ServiceTypeName, Subscription,
};
use rustdds::no_key::SerializerAdapter as _;
use rustdds::serialization::CDRSerializerAdapter;
use rustdds::{DomainParticipant, GUID, TopicKind};
use serde::{Deserialize, Serialize};
use tokio::sync::watch::Receiver;
use tokio::time::sleep;

use crate::domain::{Ros2Error, name};
use crate::messages::GetAcquisitionInfo;
use crate::presence::Place;

/// Number of requests and of responses of a service that can wait.
const DEPTH: usize = 10;

/// Largest reply in bytes that reaches callers with Fast DDS on a network that carries packets of
/// at least 1280 bytes. rustdds sends a larger reply in fragments, whose headers are malformed if
/// they name the request; see decision 34.
const MAX_REPLY: usize = 1150;

/// Time between two searches for a caller that is not found yet, and number of searches.
const FIND_PERIOD: Duration = Duration::from_millis(50);
const FIND_ATTEMPTS: u32 = 100;

/// Full names of the services of an acquisition node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceNames {
    /// Service that starts the streams of the device.
    pub start: String,
    /// Service that stops the streams of the device.
    pub stop: String,
    /// Service that ends the program.
    pub quit: String,
    /// Service that returns the shape of the announced frames.
    pub get_info: String,
}

/// Request or response of `std_srvs/Empty`, and request of `ros2neuro_msgs/GetAcquisitionInfo`. ROS
/// 2 adds this field to types that have none.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Empty {
    structure_needs_at_least_one_member: u8,
}

impl Message for Empty {}
impl Message for GetAcquisitionInfo {}

/// A request or response for callers with Cyclone DDS. It begins with the number of the caller's
/// writer and the number of the call; a response copies both from its request.
#[derive(Debug, Serialize, Deserialize)]
struct Numbered<T> {
    caller: u64,
    call: i64,
    body: T,
}

/// A service without arguments.
struct Service<Response: Message> {
    mapping: Mapping<Response>,
    participant: DomainParticipant,
    /// Name of the DDS topic that carries the replies.
    replies: String,
}

/// How requests and replies are transmitted.
enum Mapping<Response: Message> {
    /// Header and payload as with Fast DDS and Connext.
    Standard(Server<Empty, Response>),
    /// Header and payload as with Cyclone DDS. ros2-client's own mapping for Cyclone DDS also sends
    /// the standard header; replies that are sent in fragments then do not arrive.
    Cyclone { requests: Subscription<Numbered<Empty>>, replies: Publisher<Numbered<Response>> },
}

/// The services of an acquisition node: start, stop, quit and `get_info`.
pub(crate) struct Services {
    commands: [(AcquisitionCommand, Service<Empty>); 3],
    info: Service<GetAcquisitionInfo>,
    announced: Receiver<Option<AcquisitionInfo>>,
}

impl Services {
    pub(crate) fn create(
        place: &mut Place,
        names: &ServiceNames,
        announced: Receiver<Option<AcquisitionInfo>>,
    ) -> Result<Services, Ros2Error> {
        let mut command = |command, name: &str| {
            let service = Service::create(place, name, "std_srvs", "Empty")?;
            Ok::<_, Ros2Error>((command, service))
        };
        let commands = [
            command(AcquisitionCommand::Start, &names.start)?,
            command(AcquisitionCommand::Stop, &names.stop)?,
            command(AcquisitionCommand::Quit, &names.quit)?,
        ];
        let (package, of) = ("ros2neuro_msgs", "GetAcquisitionInfo");
        Ok(Services {
            commands,
            info: Service::create(place, &names.get_info, package, of)?,
            announced,
        })
    }

    /// Answers calls and never returns. `on_command` must not wait.
    pub(crate) async fn serve(self, on_command: impl Fn(AcquisitionCommand)) {
        let [start, stop, quit] = &self.commands;
        let command = async |(command, service): &(AcquisitionCommand, Service<Empty>)| {
            let answer = || {
                on_command(*command);
                Empty::default()
            };
            service.answer_all(answer).await;
        };
        let max_bytes = match self.info.mapping {
            Mapping::Standard(_) => MAX_REPLY,
            Mapping::Cyclone { .. } => usize::MAX,
        };
        let answer = || {
            let info = self.announced.borrow();
            reply(info.as_ref(), max_bytes)
        };
        let info = self.info.answer_all(answer);
        tokio::join!(command(start), command(stop), command(quit), info);
    }
}

impl<Response: Message + 'static> Service<Response> {
    /// Creates the service `full_name` of the type `package/of`, for callers with the middleware
    /// that `RMW_IMPLEMENTATION` names.
    fn create(
        place: &mut Place,
        full_name: &str,
        package: &str,
        of: &str,
    ) -> Result<Service<Response>, Ros2Error> {
        Ok(Service {
            mapping: Mapping::create(place, full_name, package, of)?,
            participant: place.participant.clone(),
            replies: format!("rr{full_name}Reply"),
        })
    }

    /// Answers calls until the task ends, each with what `answer` returns.
    async fn answer_all(&self, answer: impl Fn() -> Response) {
        loop {
            if let Err(error) = self.answer_next(&answer).await {
                tracing::warn!("a call of a ROS 2 service is not answered: {error}");
            }
        }
    }

    /// Waits until the node has found the caller's reader of replies, for at most 5 s. The node can
    /// find this reader later than the call arrives, and a reply sent before that would be lost.
    async fn wait_for(&self, caller: GUID) {
        for attempt in 0..=FIND_ATTEMPTS {
            let readers = self.participant.discovered_readers();
            let is_found = readers.iter().any(|reader| {
                reader.subscription_topic_data.topic_name() == &self.replies
                    && reader.reader_proxy.remote_reader_guid.prefix == caller.prefix
            });
            if is_found && attempt == 0 {
                return;
            }
            sleep(FIND_PERIOD).await;
            if is_found {
                return;
            }
        }
        tracing::warn!(
            "the caller of a ROS 2 service was not found in {} s, so it may receive no reply",
            (FIND_PERIOD * FIND_ATTEMPTS).as_secs()
        );
    }

    async fn answer_next(&self, answer: &impl Fn() -> Response) -> Result<(), String> {
        match &self.mapping {
            Mapping::Standard(server) => {
                let (id, _) = server.async_receive_request().await.map_err(text)?;
                self.wait_for(id.writer_gid.into()).await;
                server.async_send_response(id, answer()).await.map_err(text)
            }
            Mapping::Cyclone { requests, replies } => {
                let (request, info) = requests.async_take().await.map_err(text)?;
                self.wait_for(info.publisher_gid().into()).await;
                let Numbered { caller, call, .. } = request;
                let body = answer();
                let response = Numbered { caller, call, body };
                replies.async_publish(response).await.map_err(text)
            }
        }
    }
}

impl<Response: Message + 'static> Mapping<Response> {
    fn create(
        place: &mut Place,
        full_name: &str,
        package: &str,
        of: &str,
    ) -> Result<Mapping<Response>, Ros2Error> {
        let valid_name = name(full_name)?;
        let qos = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::DEFAULT)
            .history(History::KeepLast { depth: DEPTH });
        let rmw = std::env::var("RMW_IMPLEMENTATION");
        if rmw.as_deref() != Ok("rmw_cyclonedds_cpp") {
            let of = ServiceTypeName::new(package, of);
            let mapping = ServiceMapping::Enhanced;
            let node = &mut place.node;
            let server = node.create_server(mapping, &valid_name, &of, qos.clone(), qos)?;
            return Ok(Mapping::Standard(server));
        }
        let topic = |prefix: &str, suffix: &str, part: &str| {
            let topic = format!("{prefix}{full_name}{suffix}");
            let of = format!("{package}::srv::dds_::{of}_{part}_");
            let (participant, qos) = (&place.participant, qos.clone().into());
            let created = participant.create_topic(topic, of, &qos, TopicKind::NoKey);
            created.map_err(Ros2Error::network)
        };
        let requests = topic("rq", "Request", "Request")?;
        let replies = topic("rr", "Reply", "Response")?;
        let node = &mut place.node;
        Ok(Mapping::Cyclone {
            requests: node.create_subscription(&requests, None)?,
            replies: node.create_publisher(&replies, None)?,
        })
    }
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Returns the reply of `get_info`: a frame without values, as ROS 2-Neuro's acquisition sends it.
/// `result` is false before the first announcement, and if the reply has more than `max_bytes`.
fn reply(info: Option<&AcquisitionInfo>, max_bytes: usize) -> GetAcquisitionInfo {
    let Some(info) = info else {
        return GetAcquisitionInfo::default();
    };
    let mut reply = GetAcquisitionInfo::from(info);
    reply.frame.eeg.data.clear();
    reply.frame.exg.data.clear();
    reply.frame.tri.data.clear();
    let encoded = CDRSerializerAdapter::<GetAcquisitionInfo>::to_bytes(&reply);
    let bytes = encoded.map_or(usize::MAX, |bytes| bytes.len());
    if bytes <= max_bytes {
        return reply;
    }
    tracing::warn!(
        "get_info replies that nothing is known, because the names of {} channels make its reply too large for callers with \
         Fast DDS; subscribe to neurodata_info, or announce another stream (--announce)",
        info.frame().eeg.info.nchannels
    );
    GetAcquisitionInfo::default()
}

#[cfg(test)]
mod tests {
    use neuro_ros::{NeuroDataInfo, NeuroFrame};

    use super::*;

    fn info(channels: usize) -> AcquisitionInfo {
        let eeg = NeuroDataInfo { minmax: vec![-1.0, 1.0], stride: 0, ..NeuroDataInfo::default() };
        let frame = NeuroFrame::encoded(16, channels, eeg);
        AcquisitionInfo::new("board", "1", frame).expect("a valid frame")
    }

    #[test]
    fn get_info_has_the_shape_if_it_fits_and_else_says_that_nothing_is_known() {
        let whole = reply(Some(&info(61)), MAX_REPLY);
        assert!(whole.result && whole.frame.eeg.data.is_empty());
        assert_eq!(whole.frame.eeg.info.labels.len(), 61);
        assert_eq!(whole.device_model, "board");
        let nothing = GetAcquisitionInfo::default();
        assert_eq!(reply(Some(&info(128)), MAX_REPLY), nothing);
        assert_eq!(reply(None, MAX_REPLY), nothing);
        let whole = reply(Some(&info(128)), usize::MAX);
        assert_eq!(whole.frame.eeg.info.labels.len(), 128);
    }
}
