//! Runs the same XML-RPC calls against the master of this crate and Debian's rosmaster and compares
//! all answers.
#![expect(clippy::unwrap_used, reason = "test support code fails by panicking")]

#[path = "peers/call_recorder.rs"]
mod call_recorder;
#[path = "peers/debian_ros.rs"]
mod debian_ros;

use std::{net::SocketAddr, time::Duration};

use call_recorder::CallRecorder;
use debian_ros::{RosMaster, free_port, installed};
use ros1::{
    Master,
    xmlrpc::{CallError, Value, call},
};

/// Placeholders for the URIs of two nodes in the script and in the answers.
const NODES: [&str; 2] = ["http://node-a/", "http://node-b/"];

type Call = (&'static str, Vec<Value>);

fn texts(items: &[&str]) -> Vec<Value> {
    items.iter().map(|text| Value::from(*text)).collect()
}

fn tree(members: &[(&str, Value)]) -> Value {
    Value::Struct(
        members
            .iter()
            .map(|(name, value)| ((*name).to_owned(), value.clone()))
            .collect(),
    )
}

fn registrations() -> Vec<Call> {
    let [a, b] = NODES;
    let string = "std_msgs/String";
    vec![
        ("getSystemState", texts(&["/t"])),
        ("getTopicTypes", texts(&["/t"])),
        ("unregisterService", texts(&["/a", "/s", "rosrpc://h:1"])),
        ("registerSubscriber", texts(&["/a", "/chat", "*", a])),
        ("getTopicTypes", texts(&["/t"])),
        ("unregisterService", texts(&["/a", "/s", "rosrpc://h:1"])),
        ("registerPublisher", texts(&["/b", "/chat", string, b])),
        ("registerPublisher", texts(&["/b", "/chat", string, b])),
        (
            "registerPublisher",
            texts(&["/lab/b", "relative", string, b]),
        ),
        (
            "registerPublisher",
            texts(&["/lab/b", "~private//x/", "std_msgs/Empty", b]),
        ),
        ("getPublishedTopics", texts(&["/t", ""])),
        ("getPublishedTopics", texts(&["/t", "/lab"])),
        ("getPublishedTopics", texts(&["/lab/b", "~"])),
        ("getSystemState", texts(&["/t"])),
        ("getTopicTypes", texts(&["/t"])),
        (
            "registerSubscriber",
            texts(&["/a", "/chat", "other/Type", a]),
        ),
        ("registerPublisher", texts(&["/b", "/chat", "*", b])),
        (
            "registerPublisher",
            texts(&["/b", "/chat", "other/Type", b]),
        ),
        ("getTopicTypes", texts(&["/t"])),
        ("lookupNode", texts(&["/t", "/b"])),
        ("lookupNode", texts(&["/t", "/nobody"])),
        ("lookupNode", texts(&["/lab/x", "b"])),
        ("unregisterPublisher", texts(&["/b", "/chat", a])),
        ("unregisterPublisher", texts(&["/nobody", "/chat", a])),
        ("unregisterPublisher", texts(&["/b", "/chat", b])),
        ("lookupNode", texts(&["/t", "/b"])),
        ("unregisterPublisher", texts(&["/b", "/chat", b])),
        (
            "registerService",
            texts(&["/a", "/serve", "rosrpc://h:1", a]),
        ),
        ("lookupService", texts(&["/t", "/serve"])),
        ("lookupService", texts(&["/t", "/none"])),
        (
            "registerService",
            texts(&["/b", "/serve", "rosrpc://h:2", b]),
        ),
        ("lookupService", texts(&["/t", "/serve"])),
        (
            "unregisterService",
            texts(&["/a", "/serve", "rosrpc://h:1"]),
        ),
        (
            "unregisterService",
            texts(&["/b", "/serve", "rosrpc://h:1"]),
        ),
        ("getSystemState", texts(&["/t"])),
        (
            "unregisterService",
            texts(&["/b", "/serve", "rosrpc://h:2"]),
        ),
        ("lookupService", texts(&["/t", "/serve"])),
        ("unregisterSubscriber", texts(&["/a", "/chat", b])),
        ("unregisterSubscriber", texts(&["/a", "/chat", a])),
        ("getSystemState", texts(&["/t"])),
    ]
}

fn displacement() -> Vec<Call> {
    let [a, b] = NODES;
    vec![
        ("registerPublisher", texts(&["/same", "/one", "p/T", a])),
        ("registerSubscriber", texts(&["/same", "/two", "p/T", a])),
        (
            "registerService",
            texts(&["/same", "/three", "rosrpc://h:3", a]),
        ),
        ("subscribeParam", texts(&["/same", a, "/watched"])),
        ("registerPublisher", texts(&["/same", "/four", "p/T", b])),
        ("getSystemState", texts(&["/t"])),
        ("lookupNode", texts(&["/t", "/same"])),
        ("lookupService", texts(&["/t", "/three"])),
        ("unregisterPublisher", texts(&["/same", "/four", a])),
        ("unregisterPublisher", texts(&["/same", "/four", b])),
        ("lookupNode", texts(&["/t", "/same"])),
    ]
}

fn parameters() -> Vec<Call> {
    let [a, b] = NODES;
    let set = |key: &str, value: Value| ("setParam", vec!["/lab/x".into(), key.into(), value]);
    let get = |key: &str| ("getParam", texts(&["/lab/x", key]));
    let nested = tree(&[
        ("p", 1.into()),
        ("q", tree(&[("r", 2.5.into()), ("s", "t".into())])),
    ]);
    vec![
        get("/"),
        get("/none"),
        set("/number", 7.into()),
        set("/flag", true.into()),
        set("/double", 0.1.into()),
        set("/text", "a <b> & \"c\" 'd'\n\u{e9}\u{1F600}".into()),
        set(
            "/list",
            Value::Array(vec![1.into(), "two".into(), Value::Array(vec![])]),
        ),
        set("/nil", Value::Nil),
        set("", 1.into()),
        set("/", 1.into()),
        get("/number"),
        get("/flag"),
        get("/double"),
        get("/text"),
        get("/list"),
        set("/tree", nested.clone()),
        get("/tree"),
        get("/tree/q/r"),
        get("/tree/q/r/deeper"),
        get("/tree/q/"),
        set("/tree/q", tree(&[("only", 1.into())])),
        get("/tree"),
        set("/number/now/branch", 1.into()),
        get("/number"),
        set("relative", "lab".into()),
        set("~private", "x".into()),
        get("relative"),
        get("~private"),
        ("getParamNames", texts(&["/t"])),
        ("hasParam", texts(&["/lab/x", "relative"])),
        ("hasParam", texts(&["/lab/x", "/tree/q"])),
        ("hasParam", texts(&["/lab/x", "/none"])),
        ("searchParam", texts(&["/lab/x", "relative"])),
        ("searchParam", texts(&["/lab/x", "private"])),
        ("searchParam", texts(&["/lab/x", "tree/none"])),
        ("searchParam", texts(&["/lab/x", "none"])),
        ("searchParam", texts(&["/lab/x", "/tree"])),
        ("searchParam", texts(&["/lab/x", "/none"])),
        ("searchParam", texts(&["/lab/x", "~private"])),
        ("searchParam", texts(&["lab", "tree"])),
        ("subscribeParam", texts(&["/a", a, "/tree"])),
        ("subscribeParam", texts(&["/b", b, "/tree/q/only"])),
        ("subscribeParam", texts(&["/b", b, "/unset"])),
        ("lookupNode", texts(&["/t", "/a"])),
        set("/tree/q/only", 2.into()),
        set("/tree", tree(&[("q", tree(&[("only", 3.into())]))])),
        set("/tree", tree(&[("other", 4.into())])),
        ("setParam", vec!["/a".into(), "/tree/own".into(), 1.into()]),
        set("/unset/inside", 5.into()),
        ("deleteParam", texts(&["/t", "/tree"])),
        ("deleteParam", texts(&["/t", "/tree"])),
        ("deleteParam", texts(&["/t", "/"])),
        ("unsubscribeParam", texts(&["/a", a, "/tree"])),
        ("unsubscribeParam", texts(&["/a", a, "/tree"])),
        ("lookupNode", texts(&["/t", "/a"])),
        set("/tree", 1.into()),
        ("getParamNames", texts(&["/t"])),
        get("/"),
        set("/", tree(&[("fresh", 1.into())])),
        get("/"),
    ]
}

fn invalid_calls() -> Vec<Call> {
    let [a, _] = NODES;
    let one = |method: &str, arguments: Vec<Value>| {
        tree(&[
            ("methodName", method.into()),
            ("params", Value::Array(arguments)),
        ])
    };
    let many = vec![
        one("hasParam", texts(&["/t", "/fresh"])),
        one("nothing", vec![]),
        one("getParam", texts(&["/t", "/none"])),
    ];
    vec![
        ("nothing", texts(&["/t"])),
        ("_shutdown", texts(&["/t"])),
        ("getPid", vec![]),
        ("getPid", vec![1.into()]),
        ("getUri", texts(&["/t", "more"])),
        ("getSystemState", vec![]),
        ("registerPublisher", texts(&["/t", "/x"])),
        ("registerPublisher", texts(&["/t", "", "p/T", a])),
        ("registerPublisher", texts(&["/t", "/", "p/T", a])),
        ("registerPublisher", texts(&["/t", "/a b", "p/T", a])),
        ("registerPublisher", texts(&["/t", "http://x", "p/T", a])),
        ("registerPublisher", texts(&["/t", "/x", "T", a])),
        ("registerPublisher", texts(&["/t", "/x", "", a])),
        ("registerPublisher", texts(&["/t", "/x", "p/T", ""])),
        ("registerPublisher", texts(&["/t", "/x", "p/T", "host:1"])),
        (
            "registerSubscriber",
            vec!["/t".into(), 1.into(), "p/T".into(), a.into()],
        ),
        ("registerService", texts(&["/t", "/x", "tcp://h", a])),
        ("lookupService", texts(&["/t", ""])),
        ("lookupNode", vec!["/t".into(), Value::Array(vec![])]),
        ("getParam", vec!["/t".into(), 1.into()]),
        ("getParam", vec!["/t".into(), 0.into()]),
        ("getParam", vec!["/t".into(), Value::Array(vec![])]),
        ("hasParam", vec!["/t".into(), "".into()]),
        ("getPublishedTopics", vec!["/t".into(), 1.into()]),
        ("subscribeParam", texts(&["/t", "", "/x"])),
        ("system.multicall", vec![Value::Array(many)]),
    ]
}

/// Replaces the first text of each pair with the second one in all strings inside `value`.
fn replaced(value: &Value, pairs: &[(&str, &str)]) -> Value {
    match value {
        Value::String(text) => {
            let text = pairs
                .iter()
                .fold(text.clone(), |text, (from, to)| text.replace(from, to));
            Value::String(text)
        }
        Value::Array(items) => items.iter().map(|item| replaced(item, pairs)).collect(),
        Value::Struct(members) => Value::Struct(
            members
                .iter()
                .map(|(name, value)| (name.clone(), replaced(value, pairs)))
                .collect(),
        ),
        other => other.clone(),
    }
}

/// Makes the calls of `script` at `master`. Returns every answer, then the calls that each node
/// received.
async fn run(master: &str, script: &[Call]) -> Vec<String> {
    let nodes = [CallRecorder::start(), CallRecorder::start()];
    let uris = [nodes[0].uri.as_str(), nodes[1].uri.as_str()];
    let to_real = [(NODES[0], uris[0]), (NODES[1], uris[1])];
    let from_real = [(uris[0], NODES[0]), (uris[1], NODES[1])];
    let mut lines = Vec::new();
    for (method, arguments) in script {
        let real: Vec<Value> = arguments
            .iter()
            .map(|value| replaced(value, &to_real))
            .collect();
        let answer = match call(master, method, &real).await {
            Ok(value) => format!("{:?}", replaced(&value, &from_real)),
            Err(CallError::Fault { fault, .. }) => format!("fault {fault:?}"),
            Err(error) => panic!("{master} {method}: {error}"),
        };
        lines.push(format!("{method}{arguments:?} -> {answer}"));
        // rosmaster notifies nodes after it has answered, from threads that poll every 100 ms, and
        // sends the value that the parameter has then. Wait until rosmaster has sent the
        // notification.
        if method.contains("register") || method.ends_with("etParam") || *method == "deleteParam" {
            tokio::time::sleep(Duration::from_millis(200)).await;
        }
    }
    tokio::time::sleep(Duration::from_secs(1)).await;
    for (node, name) in nodes.iter().zip(NODES) {
        for call in node.calls() {
            let arguments = replaced(&Value::Array(call.arguments), &from_real);
            lines.push(format!("{name} was called: {} {arguments:?}", call.method));
        }
    }
    lines
}

async fn compare(test: &str, script: Vec<Call>, min_notifications: usize) {
    if !installed(test) {
        return;
    }
    let theirs = RosMaster::start("rosmaster", free_port()).await;
    let ours = Master::start(SocketAddr::from(([127, 0, 0, 1], 0)))
        .await
        .unwrap();
    let their_uri = theirs.uri();
    let (expected, actual) = tokio::join!(run(&their_uri, &script), run(ours.uri(), &script));
    assert!(
        expected.len() >= script.len() + min_notifications,
        "rosmaster sent too few notifications: {expected:#?}"
    );
    for (expected, actual) in expected.iter().zip(&actual) {
        assert_eq!(actual, expected, "left: ours, right: rosmaster's");
    }
    assert_eq!(
        actual.len(),
        expected.len(),
        "ours: {actual:#?}, rosmaster's: {expected:#?}"
    );
    ours.shutdown().await;
}

#[tokio::test]
async fn registrations_and_their_notifications_equal_those_of_rosmaster() {
    compare("registrations as rosmaster", registrations(), 3).await;
}

#[tokio::test]
async fn a_node_of_the_same_name_is_displaced_as_by_rosmaster() {
    compare("displacement as rosmaster", displacement(), 1).await;
}

#[tokio::test]
async fn parameters_and_their_notifications_equal_those_of_rosmaster() {
    compare("parameters as rosmaster", parameters(), 8).await;
}

#[tokio::test]
async fn error_messages_equal_those_of_rosmaster() {
    compare("error messages as rosmaster", invalid_calls(), 0).await;
}

#[tokio::test]
async fn get_uri_and_get_pid_describe_the_master() {
    let master = Master::start(SocketAddr::from(([127, 0, 0, 1], 0)))
        .await
        .unwrap();
    let triple = |value: Value| Value::Array(vec![1.into(), "".into(), value]);
    let uri = call(master.uri(), "getUri", &texts(&["/t"])).await.unwrap();
    assert_eq!(uri, triple(master.uri().into()));
    let pid = call(master.uri(), "getPid", &texts(&["/t"])).await.unwrap();
    assert_eq!(
        pid,
        triple(i32::try_from(std::process::id()).unwrap().into())
    );
}
