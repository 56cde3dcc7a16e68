//! XML-RPC peers that are slow, send invalid data or use unusual HTTP.

use std::time::{Duration, Instant};

use ros1::{
    PublisherOptions,
    xmlrpc::{CallError, call_ros},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    time::timeout,
};

use crate::{
    local::{TIMEOUT, is_closed, start_master, start_node},
    types::STRING,
};

const QUEUE: PublisherOptions = PublisherOptions {
    queue: 4096,
    latch: false,
};

#[tokio::test]
async fn invalid_xml_slow_requests_and_oversized_heads_block_nobody() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let _publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    for uri in [master.uri(), talker.uri()] {
        let address = uri.trim_start_matches("http://").trim_end_matches('/');
        let mut slow = TcpStream::connect(address).await.unwrap();
        slow.write_all(b"POST / HTTP/1.1\r\nContent-")
            .await
            .unwrap();
        let mut answers = Vec::new();
        for body in [
            "<methodCall>",
            "no xml",
            "<a></b>",
            "\u{0}",
            "<methodCall><methodName>\u{e9}",
        ] {
            let mut stream = TcpStream::connect(address).await.unwrap();
            let head = format!("POST / HTTP/1.0\r\nContent-Length: {}\r\n\r\n", body.len());
            stream.write_all((head + body).as_bytes()).await.unwrap();
            let mut answer = String::new();
            timeout(TIMEOUT, stream.read_to_string(&mut answer))
                .await
                .unwrap()
                .unwrap();
            answers.push(answer);
        }
        assert!(
            answers.iter().all(|answer| answer.contains("<fault>")),
            "{answers:?}"
        );
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream
            .write_all(b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n")
            .await
            .unwrap();
        assert!(is_closed(&mut stream).await);
        let mut stream = TcpStream::connect(address).await.unwrap();
        let _ = stream.write_all(&vec![b'a'; 100_000]).await;
        assert!(is_closed(&mut stream).await);
        assert!(call_ros(uri, "getPid", &["/test".into()]).await.is_ok());
        assert!(
            is_closed(&mut slow).await,
            "an incomplete request must time out"
        );
    }
}

#[tokio::test]
async fn chunked_requests_on_a_kept_alive_connection_are_answered() {
    let master = start_master().await;
    let address = master
        .uri()
        .trim_start_matches("http://")
        .trim_end_matches('/');
    let mut stream = TcpStream::connect(address).await.unwrap();
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
            let count = timeout(TIMEOUT, stream.read(&mut part))
                .await
                .unwrap()
                .unwrap();
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
    let mut errors = Vec::new();
    for _ in 0..=count {
        errors.push(
            timeout(TIMEOUT, call_ros(&uri, "getPid", &[]))
                .await
                .unwrap()
                .unwrap_err(),
        );
    }
    let kinds: Vec<&str> = errors
        .iter()
        .map(|error| match error {
            CallError::Status { .. } => "status",
            CallError::Decode { .. } => "decode",
            CallError::Http { .. } => "http",
            CallError::Shape { .. } => "shape",
            CallError::Timeout { .. } => "timeout",
            _ => "other",
        })
        .collect();
    assert_eq!(
        kinds,
        [
            "status", "decode", "http", "http", "shape", "http", "timeout"
        ]
    );
    server.abort();
}

#[tokio::test]
async fn four_hundred_slow_connections_do_not_delay_a_new_subscriber() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let address = talker.uri().trim_start_matches("http://");
    let listener = start_node("listener", &master).await;
    let received = async {
        let mut slow = Vec::new();
        for _ in 0..400 {
            let stream = TcpStream::connect(address.trim_end_matches('/')).await;
            let mut stream = stream.unwrap();
            stream.write_all(b"POST / HT").await.unwrap();
            slow.push(stream);
        }
        let mut subscriber = listener.subscribe("/chat", &STRING, 8).await.unwrap();
        loop {
            publisher.publish(b"\x01\0\0\0a");
            let message = timeout(Duration::from_millis(50), subscriber.recv());
            if message.await.is_ok() {
                return;
            }
        }
    };
    // A slow connection is closed after 10 s, so a subscriber that waits for one takes longer.
    let began = Instant::now();
    let limit = Duration::from_secs(5);
    timeout(limit, received).await.expect("a message");
    println!("subscribed after {:?}", began.elapsed());
}
