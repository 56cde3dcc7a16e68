//! Tests of this crate's node with the programs of Debian's ROS 1.

use std::{process::Stdio, time::Duration};

use ros1::{
    Node, NodeOptions, Publisher, ServiceError, Subscriber,
    xmlrpc::{Value, call_ros},
};
use tokio::time::timeout;

use crate::{
    debian_ros::{RosMaster, Running, command, installed},
    local::{
        LATCH, QUEUE, SET_BOOL, STRING, TIMEOUT, expect_text, socket_address, start_master, string,
        uri, wait_for_subscribers, wait_until,
    },
};

async fn start_node(name: &str, port: u16) -> Node {
    let mut options = NodeOptions::new(name, &uri(port));
    options.host = Some("127.0.0.1".to_owned());
    Node::start(options).await.unwrap()
}

/// Runs a ROS program to completion and returns its standard output.
async fn output(program: &str, port: u16, arguments: &[&str]) -> String {
    let mut command = command(program, port);
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    let what = format!("{program} {arguments:?}");
    let run = tokio::task::spawn_blocking(move || command.output().unwrap());
    let output = timeout(TIMEOUT, run).await.expect(&what).unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}: {text} {errors}");
    assert!(!errors.contains("Traceback"), "{what}: {errors}");
    text
}

/// Sets the parameter that decides whether the rospy node's service answers.
async fn permit_negation(port: u16, permitted: bool) {
    let set = [Value::from("/test"), "/may_negate".into(), permitted.into()];
    call_ros(&uri(port), "setParam", &set).await.unwrap();
}

/// Publishes until an echo arrives, then drains the remaining echoes. rospy answers the handshake
/// before it adds the subscriber, so messages that rospy publishes in between are lost.
async fn wait_for_echo(up: &Publisher, down: &mut Subscriber) {
    wait_until("the first echo", async || {
        up.publish(&string("hello"));
        timeout(Duration::from_millis(100), down.recv()).await.is_ok()
    })
    .await;
    while timeout(Duration::from_millis(500), down.recv()).await.is_ok() {}
}

/// Starts a rospy node that republishes `/up` on `/down` and provides `/negate`, and uses all three
/// from a node of this crate.
async fn echoes_through_rospy(port: u16) {
    permit_negation(port, true).await;
    let mut program = command("python3", port);
    program.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/echo.py"));
    let _rospy = Running::start(program);
    let ours = start_node("/ours", port).await;
    let up = ours.advertise("/up", &STRING, QUEUE).await.unwrap();
    let mut down = ours.subscribe("/down", &STRING, 1000).await.unwrap();
    wait_until("the rospy node to connect", async || {
        up.subscribers() == 1 && down.publishers() == 1
    })
    .await;
    wait_for_echo(&up, &mut down).await;
    for number in 0..500 {
        up.publish(&string(&format!("message {number}")));
    }
    for number in 0..500 {
        expect_text(&mut down, &format!("message {number}")).await;
    }
    assert_eq!((up.dropped(), down.dropped()), (0, 0));

    wait_until("the rospy service", async || ours.call("/negate", &SET_BOOL, &[1]).await.is_ok())
        .await;
    let answer = ours.call("/negate", &SET_BOOL, &[0]).await.unwrap();
    assert_eq!(answer, [&[1][..], &string("negated")].concat());
    let mut persistent = ours.connect("/negate", &SET_BOOL).await.unwrap();
    for flag in [0, 1, 0] {
        assert_eq!(persistent.call(&[flag]).await.unwrap()[0], 1 - flag);
    }
    permit_negation(port, false).await;
    let refusal = ours.call("/negate", &SET_BOOL, &[0]).await.unwrap_err();
    assert!(matches!(&refusal, ServiceError::Failed(_, reason) if reason.contains("not allowed")));
    ours.shutdown().await;
}

#[tokio::test]
async fn a_rospy_node_echoes_every_message_in_order_and_answers_calls() {
    if installed("rospy through roscore") {
        let master = RosMaster::start("roscore").await;
        echoes_through_rospy(master.port).await;
    }
}

#[tokio::test]
async fn a_rospy_node_echoes_and_answers_through_our_master() {
    if installed("rospy through our master") {
        let master = start_master().await;
        let port = socket_address(&master).port();
        echoes_through_rospy(port).await;
        let nodes = output("rosnode", port, &["list"]).await;
        assert!(!nodes.contains("/ours"), "{nodes}");
        output("rosparam", port, &["set", "/a/b", "[1, {c: 2.5}]"]).await;
        assert_eq!(output("rosparam", port, &["get", "/a"]).await.trim(), "b:\n- 1\n- c: 2.5");
        master.shutdown().await;
    }
}

#[tokio::test]
async fn rostopic_rosservice_and_rosnode_work_with_our_node() {
    if !installed("rostopic, rosservice and rosnode") {
        return;
    }
    let master = RosMaster::start("roscore").await;
    let port = master.port;
    let ours = start_node("/lab/ours", port).await;
    let publisher = ours.advertise("chatter", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let _service = ours
        .serve("~negate", &SET_BOOL, |_, request| match request {
            [0] => Ok([&[1][..], &string("was false")].concat()),
            [1] => Err("true is not allowed".to_owned()),
            other => Err(format!("{} bytes are no SetBool", other.len())),
        })
        .await
        .unwrap();

    let echo = output("rostopic", port, &["echo", "-n", "1", "/lab/chatter"]).await;
    assert_eq!(echo.trim(), "data: \"hello\"\n---");
    let kind = output("rostopic", port, &["type", "/lab/chatter"]).await;
    assert_eq!(kind.trim(), "std_msgs/String");
    let mut listener = command("rostopic", port);
    listener.args(["echo", "/lab/chatter"]).stdout(Stdio::null());
    let listener = Running::start(listener);
    wait_for_subscribers(&publisher, 1).await;
    let info = output("rosnode", port, &["info", "/lab/ours"]).await;
    for part in [
        " * /lab/chatter [std_msgs/String]",
        " * /lab/ours/negate",
        "direction: outbound",
        "transport: TCPROS",
        &format!("Pid: {}", std::process::id()),
    ] {
        assert!(info.contains(part), "{part} is missing in {info}");
    }
    drop(listener);
    wait_for_subscribers(&publisher, 0).await;
    output("rosnode", port, &["ping", "-c", "1", "/lab/ours"]).await;

    let kind = output("rosservice", port, &["type", "/lab/ours/negate"]).await;
    assert_eq!(kind.trim(), "std_srvs/SetBool");
    let answer = output("rosservice", port, &["call", "/lab/ours/negate", "false"]).await;
    assert_eq!(answer.trim(), "success: True\nmessage: \"was false\"");
    let mut refused = command("rosservice", port);
    refused.args(["call", "/lab/ours/negate", "true"]);
    let refused = tokio::task::spawn_blocking(move || refused.output().unwrap()).await.unwrap();
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(message.contains("true is not allowed"), "{message}");

    output("rosnode", port, &["kill", "/lab/ours"]).await;
    timeout(TIMEOUT, ours.shutdown_requested()).await.unwrap();
    ours.shutdown().await;
    let topics = output("rostopic", port, &["list", "-p"]).await;
    assert!(!topics.contains("chatter"), "{topics}");
}
