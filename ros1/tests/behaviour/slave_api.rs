//! What other nodes and ROS's tools ask a node.

use ros1::{
    PublisherOptions,
    xmlrpc::{Value, call_ros},
};
use tokio::time::timeout;

use crate::{
    local::{PATIENCE, master, node, until},
    types::{STRING, string},
};

const QUEUE: PublisherOptions = PublisherOptions {
    queue: 4096,
    latch: false,
};

#[tokio::test]
async fn the_slave_api_answers_every_method_of_ros() {
    let master = master().await;
    let ours = node("ours", &master).await;
    let publisher = ours.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let mut subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
    until("the link to ourselves", async || {
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
    // One message of 9 bytes, in and out; the link's own counter may be a moment behind.
    until("the counters", async || {
        let stats = ask("getBusStats", &["/t"]).await.unwrap();
        let [sent, received, _] = stats.as_array().unwrap() else {
            panic!("{stats:?}")
        };
        let link = Value::Array(vec![0.into(), 9.into(), 1.into(), true.into()]);
        let topic = Value::Array(vec!["/chat".into(), 9.into(), Value::Array(vec![link])]);
        let inlet = Value::Array(vec![0.into(), 9.into(), (-1).into(), true.into()]);
        let incoming = Value::Array(vec!["/chat".into(), Value::Array(vec![inlet])]);
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
    timeout(PATIENCE, ours.shutdown_requested()).await.unwrap();
}
