//! Tests of the slave API, which other nodes and the tools of ROS call, and of XML-RPC peers that
//! are slow, send invalid data or use unusual HTTP.

use std::time::{Duration, Instant};

use ros1::xmlrpc::{CallError, CallFailure, Value, call_ros};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    time::timeout,
};

use crate::local::{
    QUEUE, STRING, TIMEOUT, Talker, answers, host_and_port, is_closed, open, start_master,
    start_node, string, wait_for_subscribers, wait_until,
};

#[tokio::test]
async fn invalid_xml_slow_requests_and_oversized_heads_block_nobody() {
    let talker = Talker::start(QUEUE).await;
    for uri in [talker.master.uri(), talker.node.uri()] {
        let address = host_and_port(uri);
        let mut slow = open(address, b"POST / HTTP/1.1\r\nContent-").await;
        for body in ["<methodCall>", "no xml", "<a></b>", "\u{0}", "<methodCall><methodName>\u{e9}"]
        {
            let head = format!("POST / HTTP/1.0\r\nContent-Length: {}\r\n\r\n", body.len());
            let mut stream = open(address, (head + body).as_bytes()).await;
            let mut answer = String::new();
            let read = timeout(TIMEOUT, stream.read_to_string(&mut answer)).await;
            read.unwrap().unwrap();
            assert!(answer.contains("<fault>"), "{answer}");
        }
        let head = b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n";
        assert!(is_closed(&mut open(address, head).await).await);
        let mut stream = TcpStream::connect(address).await.unwrap();
        let _ = stream.write_all(&vec![b'a'; 100_000]).await;
        assert!(is_closed(&mut stream).await);
        assert!(answers(uri).await);
        assert!(is_closed(&mut slow).await, "an incomplete request times out");
    }
}

#[tokio::test]
async fn chunked_requests_on_a_kept_alive_connection_are_answered() {
    let master = start_master().await;
    let mut stream = open(host_and_port(master.uri()), b"").await;
    let body = ros1::xmlrpc::encode_call("getUri", &["/t".into()]);
    let (a, b) = body.split_at(30);
    let chunked = format!(
        "POST /RPC2 HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n{:x}\r\n{a}\r\n{:X};x=1\r\n{b}\r\n0\r\n\r\n",
        a.len(),
        b.len()
    );
    for _ in 0..3 {
        stream.write_all(chunked.as_bytes()).await.unwrap();
        let mut answer = String::new();
        while !answer.contains("</methodResponse>") {
            let mut part = [0; 512];
            let read = timeout(TIMEOUT, stream.read(&mut part)).await;
            let count = read.unwrap().unwrap();
            assert!(count > 0, "closed after {answer}");
            answer.push_str(&String::from_utf8_lossy(&part[..count]));
        }
        assert!(answer.contains(master.uri()), "{answer}");
    }
}

#[tokio::test]
async fn invalid_and_missing_answers_are_errors_within_the_timeout() {
    let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let uri = format!("http://{}/", listener.local_addr().unwrap());
    let single_value = "<?xml version='1.0'?><methodResponse><params><param><value><int>1</int></value>\
                </param></params></methodResponse>";
    let answers = [
        "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n".to_owned(),
        "HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nxml".to_owned(),
        "HTTP/1.1 200 OK\r\nContent-Length: 30\r\n\r\ncut".to_owned(),
        "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nxyz\r\n".to_owned(),
        format!("HTTP/1.0 200 OK\r\n\r\n{single_value}"),
        String::new(),
    ];
    let count = answers.len();
    let server = tokio::spawn(async move {
        for answer in answers {
            let (mut stream, _) = listener.accept().await.unwrap();
            let _ = stream.read(&mut [0; 4096]).await;
            stream.write_all(answer.as_bytes()).await.unwrap();
        }
        // Accept the last call and never answer it.
        let (_silent, _) = listener.accept().await.unwrap();
        std::future::pending::<()>().await;
    });
    let mut kinds = Vec::new();
    for _ in 0..=count {
        let answer = timeout(TIMEOUT, call_ros(&uri, "getPid", &[])).await;
        let CallError::Failed { failure, .. } = answer.unwrap().unwrap_err() else {
            panic!("neither an address nor a refusal");
        };
        kinds.push(match failure {
            CallFailure::Status(_) => "status",
            CallFailure::Decode(_) => "decode",
            CallFailure::Http(_) => "http",
            CallFailure::Shape => "shape",
            CallFailure::Timeout => "timeout",
            _ => "other",
        });
    }
    let expected = "status decode http http shape http timeout";
    assert_eq!(kinds.join(" "), expected);
    server.abort();
}

#[tokio::test]
async fn four_hundred_slow_connections_do_not_delay_a_new_subscriber() {
    let talker = Talker::start(QUEUE).await;
    let address = host_and_port(talker.node.uri());
    let listener = start_node("listener", &talker.master).await;
    let received = async {
        let mut slow = Vec::new();
        for _ in 0..400 {
            slow.push(open(address, b"POST / HT").await);
        }
        let mut subscriber = listener.subscribe("/chat", &STRING, 8).await.unwrap();
        loop {
            talker.publisher.publish(b"\x01\0\0\0a");
            let message = timeout(Duration::from_millis(50), subscriber.recv());
            if message.await.is_ok() {
                return;
            }
        }
    };
    // A subscriber that waited until a slow connection is closed, after 10 s, would exceed the
    // limit.
    let began = Instant::now();
    let limit = Duration::from_secs(5);
    timeout(limit, received).await.expect("a message");
    println!("subscribed after {:?}", began.elapsed());
}

#[tokio::test]
async fn the_slave_api_answers_every_method_of_ros() {
    let talker = Talker::start(QUEUE).await;
    let (ours, publisher) = (&talker.node, &talker.publisher);
    let mut subscriber = ours.subscribe("/chat", &STRING, 4).await.unwrap();
    wait_for_subscribers(publisher, 1).await;
    publisher.publish(&string("hello"));
    subscriber.recv().await;
    let ask = async |method: &str, arguments: &[&str]| {
        let arguments: Vec<Value> = arguments.iter().map(|text| Value::from(*text)).collect();
        call_ros(ours.uri(), method, &arguments).await
    };
    let topics = Value::Array(vec![Value::from(["/chat", "std_msgs/String"])]);
    let pid = i32::try_from(std::process::id()).unwrap();
    for (method, arguments, answer) in [
        ("getPublications", &["/t"][..], topics.clone()),
        ("getSubscriptions", &["/t"], topics),
        ("getMasterUri", &["/t"], talker.master.uri().into()),
        ("paramUpdate", &["/t", "/p", "v"], 0.into()),
        ("getPid", &["/t"], pid.into()),
    ] {
        assert_eq!(ask(method, arguments).await.unwrap(), answer, "{method}");
    }
    // The node sends and receives one message of 9 bytes. The sender counts a message only after
    // writing it, so the sender's counter can change after the message has been received.
    wait_until("the counters", async || {
        let stats = ask("getBusStats", &["/t"]).await.unwrap();
        let [sent, received, _] = stats.as_array().unwrap() else { panic!("{stats:?}") };
        let link = |messages: i32| [Value::from(0), 9.into(), messages.into(), true.into()];
        let topic = [Value::from("/chat"), 9.into(), [Value::from(link(1))].into()];
        let incoming = [Value::from("/chat"), [Value::from(link(-1))].into()];
        *sent == [Value::from(topic)].into() && *received == [Value::from(incoming)].into()
    })
    .await;
    let info = ask("getBusInfo", &["/t"]).await.unwrap();
    let links = info.as_array().unwrap().iter();
    let directions: Vec<_> = links.map(|link| &link.as_array().unwrap()[2]).collect();
    assert_eq!(directions, [&"o".into(), &"i".into()]);
    let protocols = Value::from([Value::from(["UDPROS"])]);
    let request = [Value::from("/t"), "/chat".into(), protocols];
    let refused = call_ros(ours.uri(), "requestTopic", &request).await;
    assert!(refused.unwrap_err().to_string().contains("TCPROS"));
    let unknown = ask("nothing", &["/t"]).await;
    assert!(unknown.unwrap_err().to_string().contains("not known"));
    ask("shutdown", &["/t", "test"]).await.unwrap();
    timeout(TIMEOUT, ours.shutdown_requested()).await.unwrap();
}
