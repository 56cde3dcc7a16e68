//! Compares the answers of this crate's master and Debian's rosmaster to the same XML-RPC calls.

use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

use ros1::xmlrpc::{CallError, CallFailure, MethodCall, Value, call, decode_call};
use tokio::net::TcpListener;

use crate::{
    debian_ros::{RosMaster, installed},
    fakes::answer_one,
    local::start_master,
};

/// Placeholders for the URIs of two nodes in the script and in the answers. The calls themselves
/// have the nodes' real URIs.
const NODES: [&str; 2] = ["http://node-a/", "http://node-b/"];

type Call = (&'static str, Vec<Value>);

fn texts(items: &[&str]) -> Vec<Value> {
    items.iter().map(|text| Value::from(*text)).collect()
}

/// Parses a call: the name of the method, then its arguments as texts, all separated by spaces. `A`
/// and `B` stand for the URIs of the two nodes, `-` for an empty text.
fn line(words: &'static str) -> Call {
    let mut words = words.split(' ');
    let method = words.next().unwrap();
    let arguments = words.map(|word| match word {
        "A" => NODES[0],
        "B" => NODES[1],
        "-" => "",
        word => word,
    });
    (method, arguments.map(Value::from).collect())
}

fn tree(members: &[(&str, Value)]) -> Value {
    Value::Struct(members.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect())
}

fn registrations() -> Vec<Call> {
    vec![
        line("getSystemState /t"),
        line("getTopicTypes /t"),
        line("unregisterService /a /s rosrpc://h:1"),
        line("registerSubscriber /a /chat * A"),
        line("getTopicTypes /t"),
        line("unregisterService /a /s rosrpc://h:1"),
        line("registerPublisher /b /chat std_msgs/String B"),
        line("registerPublisher /b /chat std_msgs/String B"),
        line("registerPublisher /lab/b relative std_msgs/String B"),
        line("registerPublisher /lab/b ~private//x/ std_msgs/Empty B"),
        line("getPublishedTopics /t -"),
        line("getPublishedTopics /t /lab"),
        line("getPublishedTopics /lab/b ~"),
        line("getSystemState /t"),
        line("getTopicTypes /t"),
        line("registerSubscriber /a /chat other/Type A"),
        line("registerPublisher /b /chat * B"),
        line("registerPublisher /b /chat other/Type B"),
        line("getTopicTypes /t"),
        line("lookupNode /t /b"),
        line("lookupNode /t /nobody"),
        line("lookupNode /lab/x b"),
        line("unregisterPublisher /b /chat A"),
        line("unregisterPublisher /nobody /chat A"),
        line("unregisterPublisher /b /chat B"),
        line("lookupNode /t /b"),
        line("unregisterPublisher /b /chat B"),
        line("registerService /a /serve rosrpc://h:1 A"),
        line("lookupService /t /serve"),
        line("lookupService /t /none"),
        line("registerService /b /serve rosrpc://h:2 B"),
        line("lookupService /t /serve"),
        line("unregisterService /a /serve rosrpc://h:1"),
        line("unregisterService /b /serve rosrpc://h:1"),
        line("getSystemState /t"),
        line("unregisterService /b /serve rosrpc://h:2"),
        line("lookupService /t /serve"),
        line("unregisterSubscriber /a /chat B"),
        line("unregisterSubscriber /a /chat A"),
        line("getSystemState /t"),
    ]
}

fn displacement() -> Vec<Call> {
    vec![
        line("registerPublisher /same /one p/T A"),
        line("registerSubscriber /same /two p/T A"),
        line("registerService /same /three rosrpc://h:3 A"),
        line("subscribeParam /same A /watched"),
        line("registerPublisher /same /four p/T B"),
        line("getSystemState /t"),
        line("lookupNode /t /same"),
        line("lookupService /t /three"),
        line("unregisterPublisher /same /four A"),
        line("unregisterPublisher /same /four B"),
        line("lookupNode /t /same"),
    ]
}

fn parameters() -> Vec<Call> {
    let set = |key: &str, value: Value| ("setParam", vec!["/lab/x".into(), key.into(), value]);
    let get = |key: &str| ("getParam", texts(&["/lab/x", key]));
    let nested = tree(&[("p", 1.into()), ("q", tree(&[("r", 2.5.into()), ("s", "t".into())]))]);
    vec![
        get("/"),
        get("/none"),
        set("/number", 7.into()),
        set("/flag", true.into()),
        set("/double", 0.1.into()),
        set("/text", "a <b> & \"c\" 'd'\n\u{e9}\u{1F600}".into()),
        set("/list", Value::Array(vec![1.into(), "two".into(), Value::Array(vec![])])),
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
        line("getParamNames /t"),
        line("hasParam /lab/x relative"),
        line("hasParam /lab/x /tree/q"),
        line("hasParam /lab/x /none"),
        line("searchParam /lab/x relative"),
        line("searchParam /lab/x private"),
        line("searchParam /lab/x tree/none"),
        line("searchParam /lab/x none"),
        line("searchParam /lab/x /tree"),
        line("searchParam /lab/x /none"),
        line("searchParam /lab/x ~private"),
        line("searchParam lab tree"),
        line("subscribeParam /a A /tree"),
        line("subscribeParam /b B /tree/q/only"),
        line("subscribeParam /b B /unset"),
        line("lookupNode /t /a"),
        set("/tree/q/only", 2.into()),
        set("/tree", tree(&[("q", tree(&[("only", 3.into())]))])),
        set("/tree", tree(&[("other", 4.into())])),
        ("setParam", vec!["/a".into(), "/tree/own".into(), 1.into()]),
        set("/unset/inside", 5.into()),
        line("deleteParam /t /tree"),
        line("deleteParam /t /tree"),
        line("deleteParam /t /"),
        line("unsubscribeParam /a A /tree"),
        line("unsubscribeParam /a A /tree"),
        line("lookupNode /t /a"),
        set("/tree", 1.into()),
        line("getParamNames /t"),
        get("/"),
        set("/", tree(&[("fresh", 1.into())])),
        get("/"),
    ]
}

fn invalid_calls() -> Vec<Call> {
    let [a, _] = NODES;
    let one = |method: &str, arguments: Vec<Value>| {
        tree(&[("methodName", method.into()), ("params", Value::Array(arguments))])
    };
    let many = vec![
        one("hasParam", texts(&["/t", "/fresh"])),
        one("nothing", vec![]),
        one("getParam", texts(&["/t", "/none"])),
    ];
    vec![
        line("nothing /t"),
        line("_shutdown /t"),
        ("getPid", vec![]),
        ("getPid", vec![1.into()]),
        line("getUri /t more"),
        ("getSystemState", vec![]),
        line("registerPublisher /t /x"),
        line("registerPublisher /t - p/T A"),
        line("registerPublisher /t / p/T A"),
        ("registerPublisher", texts(&["/t", "/a b", "p/T", a])),
        line("registerPublisher /t http://x p/T A"),
        line("registerPublisher /t /x T A"),
        line("registerPublisher /t /x - A"),
        line("registerPublisher /t /x p/T -"),
        line("registerPublisher /t /x p/T host:1"),
        ("registerSubscriber", vec!["/t".into(), 1.into(), "p/T".into(), a.into()]),
        line("registerService /t /x tcp://h A"),
        line("lookupService /t -"),
        ("lookupNode", vec!["/t".into(), Value::Array(vec![])]),
        ("getParam", vec!["/t".into(), 1.into()]),
        ("getParam", vec!["/t".into(), 0.into()]),
        ("getParam", vec!["/t".into(), Value::Array(vec![])]),
        ("hasParam", vec!["/t".into(), "".into()]),
        ("getPublishedTopics", vec!["/t".into(), 1.into()]),
        line("subscribeParam /t - /x"),
        ("system.multicall", vec![Value::Array(many)]),
    ]
}

/// Replaces the first text of each pair with the second one in all strings inside `value`.
fn replaced(value: &Value, pairs: &[(&str, &str)]) -> Value {
    match value {
        Value::String(text) => {
            let text = pairs.iter().fold(text.clone(), |text, (from, to)| text.replace(from, to));
            Value::String(text)
        }
        Value::Array(items) => items.iter().map(|item| replaced(item, pairs)).collect(),
        Value::Struct(members) => Value::Struct(
            members.iter().map(|(name, value)| (name.clone(), replaced(value, pairs))).collect(),
        ),
        other => other.clone(),
    }
}

/// A node that records the calls it receives and answers each with success.
struct CallRecorder {
    uri: String,
    calls: Arc<Mutex<Vec<MethodCall>>>,
}

impl CallRecorder {
    async fn start() -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let uri = format!("http://{}/", listener.local_addr().unwrap());
        let calls = Arc::new(Mutex::new(Vec::new()));
        let recorded = Arc::clone(&calls);
        tokio::spawn(async move {
            loop {
                let request = answer_one(&listener, [1.into(), "".into(), 0.into()]).await;
                let (_, body) = request.split_once("\r\n\r\n").unwrap();
                let call = decode_call(body.as_bytes()).unwrap();
                recorded.lock().unwrap().push(call);
            }
        });
        Self { uri, calls }
    }
}

/// Makes the calls of `script` to the master at the URI `master`. Returns a line for every answer,
/// then a line for every call that the nodes received.
async fn run(master: &str, script: &[Call]) -> Vec<String> {
    let nodes = [CallRecorder::start().await, CallRecorder::start().await];
    let uris = [nodes[0].uri.as_str(), nodes[1].uri.as_str()];
    let to_real = [(NODES[0], uris[0]), (NODES[1], uris[1])];
    let from_real = [(uris[0], NODES[0]), (uris[1], NODES[1])];
    let mut lines = Vec::new();
    for (method, arguments) in script {
        let real: Vec<Value> = arguments.iter().map(|value| replaced(value, &to_real)).collect();
        let answer = match call(master, method, &real).await {
            Ok(value) => format!("{:?}", replaced(&value, &from_real)),
            Err(CallError::Failed { failure: CallFailure::Fault(fault), .. }) => {
                format!("fault {fault:?}")
            }
            Err(error) => panic!("{master} {method}: {error}"),
        };
        lines.push(format!("{method}{arguments:?} -> {answer}"));
        // rosmaster notifies nodes only after it has answered, from threads that poll every 100 ms,
        // and sends the parameter's value at that later time. Wait until it has sent the
        // notification.
        if method.contains("register") || method.ends_with("etParam") || *method == "deleteParam" {
            tokio::time::sleep(Duration::from_millis(200)).await;
        }
    }
    tokio::time::sleep(Duration::from_secs(1)).await;
    for (node, name) in nodes.iter().zip(NODES) {
        for call in node.calls.lock().unwrap().drain(..) {
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
    let theirs = RosMaster::start("rosmaster").await;
    let ours = start_master().await;
    let their_uri = theirs.uri();
    let (expected, actual) = tokio::join!(run(&their_uri, &script), run(ours.uri(), &script));
    assert!(
        expected.len() >= script.len() + min_notifications,
        "rosmaster sent too few notifications: {expected:#?}"
    );
    for (expected, actual) in expected.iter().zip(&actual) {
        assert_eq!(actual, expected, "left: ours, right: rosmaster's");
    }
    assert_eq!(actual.len(), expected.len(), "ours: {actual:#?}, rosmaster's: {expected:#?}");
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
