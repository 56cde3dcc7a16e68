//! The program's own ROS master.

use std::net::{SocketAddr, TcpListener};

use neuro_ros::ros1::xmlrpc::{Value, call_ros};
use neuro_ros::{NeuroFrame, RosMessage};
use rustix::process::Signal;

use crate::board::Board;
use crate::device::Device;
use crate::graph::{frame, node, until};
use crate::process::Bridge;

fn free_address() -> SocketAddr {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).unwrap();
    listener.local_addr().unwrap()
}

async fn wait(bridge: Bridge) -> (Option<i32>, String) {
    let (status, log) = tokio::task::spawn_blocking(|| bridge.wait()).await.unwrap();
    (status.code(), log)
}

/// Starts the program as a master, and waits until it answers. Returns the URI too.
async fn master() -> (Bridge, String) {
    let address = free_address();
    let master = Bridge::start(&["master", "--bind", &address.to_string()]);
    let uri = format!("http://{address}/");
    until("the master", async || {
        call_ros(&uri, "getUri", &[Value::from("/test")])
            .await
            .is_ok()
    })
    .await;
    (master, uri)
}

#[tokio::test]
async fn a_bridge_and_a_subscriber_find_each_other_at_the_programs_master() {
    let (master, uri) = master().await;
    let device = Device::tcp(Board::new());
    let bridge = Bridge::start_with(&["--port", &device.port], &[("ROS_MASTER_URI", &uri)]);
    let node = node("recorder", &uri).await;
    let type_ = NeuroFrame::TYPE;
    let mut encoded = node.subscribe("/encoded", type_, 64).await.unwrap();
    let first = frame(&mut encoded).await.neuroheader.seq;
    assert_eq!(frame(&mut encoded).await.neuroheader.seq, first + 1);
    for (program, signal) in [(bridge, Signal::TERM), (master, Signal::INT)] {
        program.signal(signal);
        let (status, log) = wait(program).await;
        assert_eq!(status, Some(0), "{log}");
        if signal == Signal::INT {
            let advice = format!("export ROS_MASTER_URI={uri}");
            assert!(log.contains(&advice), "{log}");
        }
    }
}

#[tokio::test]
async fn a_port_in_use_is_status_2_and_a_call_of_shutdown_ends_the_master() {
    let (master, uri) = master().await;
    let address = uri.trim_start_matches("http://").trim_end_matches('/');
    let (status, log) = wait(Bridge::start(&["master", "--bind", address])).await;
    assert_eq!(status, Some(2), "{log}");
    let expected = format!("cannot listen at {address}; end the master that uses this port");
    assert!(log.contains(&expected) && log.contains("in use"), "{log}");
    let arguments = ["/test", "end of the lesson"].map(Value::from);
    call_ros(&uri, "shutdown", &arguments).await.unwrap();
    let (status, log) = wait(master).await;
    assert_eq!(status, Some(0), "{log}");
}

#[tokio::test]
async fn for_other_machines_the_log_has_what_they_need() {
    let address = SocketAddr::from(([0, 0, 0, 0], free_address().port()));
    let master = Bridge::start(&["master", "--bind", &address.to_string()]);
    let uri = format!("http://127.0.0.1:{}/", address.port());
    until("the master", async || {
        call_ros(&uri, "getUri", &[Value::from("/test")])
            .await
            .is_ok()
    })
    .await;
    master.signal(Signal::TERM);
    let (status, log) = wait(master).await;
    assert_eq!(status, Some(0), "{log}");
    let expected = format!(
        "export ROS_MASTER_URI=http://ADDRESS:{}/ ROS_IP=",
        address.port()
    );
    assert!(log.contains(&expected), "{log}");
}
