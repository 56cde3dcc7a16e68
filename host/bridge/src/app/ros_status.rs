//! Faults that keep the ROS node and other nodes from reaching each other: logged once each, and
//! reported in `/diagnostics`.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use neuro_ros::ros1::{MasterStatus, Node, NodeOptions};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};
use tokio::sync::watch::Receiver;
use tokio::task::JoinHandle;
use tokio::time::sleep;

use crate::doctor::ros_checks::{OwnHost, SET_MASTER_URI, check_own_host, master_is_here};
use crate::lock;

/// Time after the node's start in which a missing ROS master is not logged yet.
const REGISTRATION_GRACE: Duration = Duration::from_secs(1);
/// Interval between checks of the node's own host, whose network can come up after the bridge.
const HOST_PERIOD: Duration = Duration::from_secs(5);

/// The state of the ROS node, with the tasks that watch and log it.
#[derive(Debug)]
pub(crate) struct RosStatus {
    node: Arc<Node>,
    master_uri: String,
    /// Why other nodes cannot connect to this one, and what to do; `None` if they can.
    host_fault: Arc<Mutex<Option<String>>>,
    tasks: [JoinHandle<()>; 2],
}

impl RosStatus {
    /// Watches `node`, which was started with `options`.
    pub(crate) fn watch(node: Arc<Node>, options: &NodeOptions) -> RosStatus {
        let host_fault = Arc::default();
        let uri = options.master_uri.clone();
        let tasks = [
            tokio::spawn(log_master_changes(node.master_status(), uri.clone())),
            tokio::spawn(watch_own_host(options.host.clone(), uri, Arc::clone(&host_fault))),
        ];
        RosStatus { node, master_uri: options.master_uri.clone(), host_fault, tasks }
    }

    /// Ends the tasks that watch the node.
    pub(crate) fn stop(&self) {
        for task in &self.tasks {
            task.abort();
        }
    }

    /// Returns the status for `/diagnostics`: a warning with all present faults, if there are any.
    pub(crate) fn status(&self) -> DiagnosticStatus {
        let unreachable = self.node.unreachable_publishers().into_iter();
        let unreachable =
            unreachable.map(|(topic, why)| format!("no messages of {topic} from {why}"));
        let mut faults: Vec<String> = unreachable.collect();
        faults.extend(lock(&self.host_fault).clone());
        faults.extend(master_fault(&self.node.master_status().borrow(), &self.master_uri));
        let (level, message) = if faults.is_empty() {
            let is_unknown = *self.node.master_status().borrow() == MasterStatus::Unknown;
            let message = if is_unknown {
                "the ROS master has not been called yet"
            } else {
                "the ROS master answers"
            };
            (DiagnosticLevel::Ok, message.to_owned())
        } else {
            (DiagnosticLevel::Warn, faults.join("; "))
        };
        DiagnosticStatus::new(
            "ros",
            (level, message),
            vec![
                KeyValue::new("node", &self.node.uri()),
                KeyValue::new("master", &self.master_uri),
            ],
        )
    }
}

/// Returns why the ROS master at `uri` cannot be used, and what to do; `None` if it can.
fn master_fault(status: &MasterStatus, uri: &str) -> Option<String> {
    match status {
        MasterStatus::Unknown | MasterStatus::Online => None,
        MasterStatus::Unresolved(error) => Some(format!(
            "the host name {} of ROS_MASTER_URI does not resolve: {}; {SET_MASTER_URI}",
            error.host, error.reason
        )),
        MasterStatus::Silent(why) => Some(format!(
            "no ROS master answers at {uri}; waiting for it: start roscore, or set --ros-master-uri ({why})"
        )),
    }
}

/// Logs when the ROS master appears or disappears. Starts after [`REGISTRATION_GRACE`], because
/// even a running master takes several milliseconds to answer.
async fn log_master_changes(mut status: Receiver<MasterStatus>, uri: String) {
    let mut logged = None;
    sleep(REGISTRATION_GRACE).await;
    loop {
        let now = status.borrow_and_update().clone();
        let kind = std::mem::discriminant(&now);
        if now != MasterStatus::Unknown && logged != Some(kind) {
            logged = Some(kind);
            if let Some(fault) = master_fault(&now, &uri) {
                tracing::warn!("{fault}");
            } else {
                tracing::info!("registered with the ROS master at {uri}");
            }
        }
        if status.changed().await.is_err() {
            return;
        }
    }
}

/// Checks every [`HOST_PERIOD`] whether other nodes can connect to this one at `host`, if the user
/// has set it. Logs when this changes.
async fn watch_own_host(host: Option<String>, uri: String, fault: Arc<Mutex<Option<String>>>) {
    let Some(host) = host else { return };
    loop {
        let own_host = OwnHost::find(&host).await;
        let check = check_own_host(Some(&own_host), master_is_here(&uri).await);
        let now = check.remedy.map(|remedy| {
            format!("other nodes cannot connect to this one: {}; {remedy}", check.finding)
        });
        let before = std::mem::replace(&mut *lock(&fault), now.clone());
        match (before, now) {
            (None, Some(fault)) => tracing::warn!("{fault}"),
            (Some(_), None) => tracing::info!("other nodes can connect to this one at {host}"),
            (None, None) | (Some(_), Some(_)) => {}
        }
        sleep(HOST_PERIOD).await;
    }
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;

    use neuro_ros::ros1::Master;
    use tokio::time::Instant;

    use super::*;

    /// Waits until the status of a node with this host and master has a message for which `wanted`
    /// is true. Returns the level of this status.
    async fn level(host: &str, master: &str, wanted: impl Fn(&str) -> bool) -> DiagnosticLevel {
        let options =
            NodeOptions { host: Some(host.to_owned()), ..NodeOptions::new("acquisition", master) };
        let node = Arc::new(Node::start(options.clone()).await.unwrap());
        let status = RosStatus::watch(node, &options);
        let deadline = Instant::now() + Duration::from_secs(30);
        loop {
            let DiagnosticStatus { level, message, .. } = status.status();
            let checked = *status.node.master_status().borrow() != MasterStatus::Unknown;
            if checked && wanted(&message) {
                status.stop();
                return level;
            }
            assert!(Instant::now() < deadline, "{host}, {master}: {message}");
            sleep(Duration::from_millis(10)).await;
        }
    }

    /// RFC 5737 reserves 192.0.2.1 for documentation, RFC 6761 `.invalid` for names that never
    /// resolve.
    #[tokio::test]
    async fn each_address_that_cannot_be_used_is_a_warning_with_what_why_and_what_to_do() {
        let address = SocketAddr::from(([127, 0, 0, 1], 0));
        let master = Master::start(address).await.unwrap();
        let nobody = "http://127.0.0.1:9/";
        let unknown = "http://no-such-host.invalid:11311/";
        for (host, uri, parts) in [
            (
                "192.0.2.1",
                master.uri(),
                ["other nodes cannot connect", "no address of this machine", "export ROS_IP="],
            ),
            (
                "no-such-host.invalid",
                master.uri(),
                ["other nodes cannot connect", "does not resolve", "export ROS_IP="],
            ),
            (
                "127.0.0.1",
                unknown,
                [
                    "the host name no-such-host.invalid of ROS_MASTER_URI",
                    "does not resolve",
                    "export ROS_MASTER_URI=",
                ],
            ),
            (
                "127.0.0.1",
                nobody,
                [
                    "no ROS master answers at http://127.0.0.1:9/",
                    "Connection refused",
                    "start roscore",
                ],
            ),
        ] {
            let wanted = |message: &str| parts.iter().all(|part| message.contains(part));
            assert_eq!(level(host, uri, wanted).await, DiagnosticLevel::Warn);
        }
        let is_calm = |message: &str| message == "the ROS master answers";
        assert_eq!(level("127.0.0.1", master.uri(), is_calm).await, DiagnosticLevel::Ok);
    }
}
