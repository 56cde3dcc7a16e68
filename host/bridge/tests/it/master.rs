//! The subcommand `master`, the program's own ROS master.

use std::net::SocketAddr;

use neuro_ros::ros1::xmlrpc::{Value, call_ros};
use rustix::process::Signal;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::graph::{ended, frame, node, subscribe, until};
use crate::process::{Bridge, free_address};

/// Runs `corticode-bridge master` at an address and waits until it answers. Returns the running
/// program and its URI.
async fn master(address: SocketAddr) -> (Bridge, String) {
    let master = Bridge::start(&["master", "--bind", &address.to_string()]);
    let uri = format!("http://127.0.0.1:{}/", address.port());
    until("the master", async || call_ros(&uri, "getUri", &[Value::from("/test")]).await.is_ok())
        .await;
    (master, uri)
}

#[tokio::test]
async fn a_bridge_and_a_subscriber_find_each_other_at_the_programs_master() {
    let (master, uri) = master(free_address()).await;
    let device = Device::tcp(Board::new());
    let bridge = Bridge::start_with(&["--port", &device.port], &[("ROS_MASTER_URI", &uri)]);
    let node = node("recorder", &uri).await;
    let mut encoded = subscribe(&node, "/encoded").await;
    let first = frame(&mut encoded).await.neuroheader.seq;
    assert_eq!(frame(&mut encoded).await.neuroheader.seq, first + 1);
    bridge.signal(Signal::TERM);
    ended(bridge).await;
    master.signal(Signal::INT);
    let log = ended(master).await;
    assert_has(&log, [&format!("export ROS_MASTER_URI={uri}")]);
}

#[tokio::test]
async fn a_port_in_use_is_status_2_and_a_call_of_shutdown_ends_the_master() {
    let address = free_address();
    let (master, uri) = master(address).await;
    let second = Bridge::start(&["master", "--bind", &address.to_string()]);
    let log = tokio::task::spawn_blocking(|| second.failure(2)).await;
    let expected = format!("cannot listen at {address}; end the master that uses this port");
    assert_has(&log.unwrap(), [&expected, "in use"]);
    let arguments = ["/test", "end of the lesson"].map(Value::from);
    call_ros(&uri, "shutdown", &arguments).await.unwrap();
    ended(master).await;
}

#[tokio::test]
async fn for_other_machines_the_log_has_what_they_need() {
    let port = free_address().port();
    let (master, _) = master(SocketAddr::from(([0, 0, 0, 0], port))).await;
    master.signal(Signal::TERM);
    let log = ended(master).await;
    let expected = format!("export ROS_MASTER_URI=http://ADDRESS:{port}/ ROS_IP=");
    assert_has(&log, [&expected]);
}
