//! The slave API, which other nodes and the tools of ROS call.

use ros1::{
    PublisherOptions,
    xmlrpc::{Value, call_ros},
};
use tokio::time::timeout;

use crate::{
    local::{TIMEOUT, start_master, start_node, wait_until},
    types::{STRING, string},
};

const QUEUE: PublisherOptions = PublisherOptions {
    queue: 4096,
    latch: false,
};

#[tokio::test]
async fn the_slave_api_answers_every_method_of_ros() {
    let master = start_master().await;
    let ours = start_node("ours", &master).await;
    let publisher = ours.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let mut subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
    wait_until("the connection from the node to itself", async || {
        publisher.subscribers() == 1
    })
    .await;
    publisher.publish(&string("hello"));
    subscriber.recv().await;
    let ask = async |method: &str, arguments: &[&str]| {
        let arguments: Vec<Value> = arguments.iter().map(|text| Value::from(*text)).collect();
        call_ros(ours.uri(), method, &arguments).await
    };
    let topics = Value::Array(vec![Value::from(["/chat", "std_msgs/String"])]);
    assert_eq!(ask("getPublications", &["/t"]).await.unwrap(), topics);
    assert_eq!(ask("getSubscriptions", &["/t"]).await.unwrap(), topics);
    assert_eq!(
        ask("getMasterUri", &["/t"]).await.unwrap(),
        master.uri().into()
    );
    assert_eq!(
        ask("paramUpdate", &["/t", "/p", "v"]).await.unwrap(),
        0.into()
    );
    let pid = i32::try_from(std::process::id()).unwrap();
    assert_eq!(ask("getPid", &["/t"]).await.unwrap(), pid.into());
    // The node sends and receives one message of 9 bytes. The sender counts a message only after
    // writing it, so the sender's counter can change after the message has been received.
    wait_until("the counters", async || {
        let stats = ask("getBusStats", &["/t"]).await.unwrap();
        let [sent, received, _] = stats.as_array().unwrap() else {
            panic!("{stats:?}")
        };
        let outgoing_link = Value::Array(vec![0.into(), 9.into(), 1.into(), true.into()]);
        let topic = Value::Array(vec![
            "/chat".into(),
            9.into(),
            Value::Array(vec![outgoing_link]),
        ]);
        let incoming_link = Value::Array(vec![0.into(), 9.into(), (-1).into(), true.into()]);
        let incoming = Value::Array(vec!["/chat".into(), Value::Array(vec![incoming_link])]);
        *sent == Value::Array(vec![topic]) && *received == Value::Array(vec![incoming])
    })
    .await;
    let info = ask("getBusInfo", &["/t"]).await.unwrap();
    let directions: Vec<_> = info
        .as_array()
        .unwrap()
        .iter()
        .map(|link| link.as_array().unwrap()[2].clone())
        .collect();
    assert_eq!(directions, ["o", "i"].map(Value::from));
    let protocols = Value::from([Value::from(["UDPROS"])]);
    let request = [Value::from("/t"), "/chat".into(), protocols];
    let refused = call_ros(ours.uri(), "requestTopic", &request)
        .await
        .unwrap_err();
    assert!(refused.to_string().contains("TCPROS"));
    assert!(
        ask("nothing", &["/t"])
            .await
            .unwrap_err()
            .to_string()
            .contains("not known")
    );
    ask("shutdown", &["/t", "test"]).await.unwrap();
    timeout(TIMEOUT, ours.shutdown_requested()).await.unwrap();
}
