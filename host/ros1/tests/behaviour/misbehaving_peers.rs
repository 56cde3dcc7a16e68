//! Peers that violate the protocol, send garbage or do not read. All other peers are still served.

use std::time::{Duration, Instant};

use ros1::{MessageType, PublisherOptions, tcpros::Header, xmlrpc::call_ros};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    time::timeout,
};

use crate::{
    fake_publisher::FakePublisher,
    local::{
        TIMEOUT, is_closed, read_header, start_master, start_node, tcpros_address, wait_until,
    },
    types::{STRING, string},
};

const QUEUE: PublisherOptions = PublisherOptions {
    queue: 16,
    latch: false,
};
const LATCH: PublisherOptions = PublisherOptions {
    queue: 16,
    latch: true,
};

fn subscription(topic: &str, md5: &str) -> Header {
    Header::new()
        .with("callerid", "/abuser")
        .with("md5sum", md5)
        .with("topic", topic)
        .with("type", "std_msgs/String")
}

#[tokio::test]
async fn silent_connections_block_nobody_and_are_closed() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let address = tcpros_address(&talker, "/chat").await;
    let mut silent = Vec::new();
    for _ in 0..40 {
        silent.push(TcpStream::connect(&address).await.unwrap());
    }
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    let message = timeout(Duration::from_secs(3), subscriber.recv())
        .await
        .unwrap();
    assert_eq!(message, Some(string("hello")));
    assert!(is_closed(&mut silent[0]).await);
}

#[tokio::test]
async fn subscribers_that_reset_after_their_header_do_not_end_the_topic() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 64).await.unwrap();
    wait_until("the subscriber to connect", async || {
        publisher.subscribers() == 1
    })
    .await;
    let address = tcpros_address(&talker, "/chat").await;
    for round in 0..20 {
        let mut resetting = TcpStream::connect(&address).await.unwrap();
        let header = subscription("/chat", STRING.md5).encode().unwrap();
        resetting.write_all(&header).await.unwrap();
        resetting.set_zero_linger().unwrap();
        drop(resetting);
        publisher.publish(&string(&format!("{round}")));
        let message = timeout(TIMEOUT, subscriber.recv()).await.unwrap();
        assert_eq!(message, Some(string(&format!("{round}"))));
    }
    wait_until("the reset connections to be removed", async || {
        publisher.subscribers() == 1
    })
    .await;
    assert_eq!((publisher.dropped(), subscriber.dropped()), (0, 0));
}

#[tokio::test]
async fn a_wrong_md5_is_refused_with_a_reason_and_a_wildcard_is_accepted() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let address = tcpros_address(&talker, "/chat").await;
    let wrong = "0123456789abcdef0123456789abcdef";
    for (header, expected) in [
        (subscription("/chat", wrong), wrong),
        (subscription("/none", STRING.md5), "/none"),
        (Header::new().with("topic", "/chat"), "md5sum"),
        (Header::new().with("callerid", "/abuser"), "neither"),
        (
            Header::new().with("service", "/none").with("md5sum", "*"),
            "/none",
        ),
    ] {
        let mut stream = TcpStream::connect(&address).await.unwrap();
        stream.write_all(&header.encode().unwrap()).await.unwrap();
        let answer = read_header(&mut stream).await;
        let error = answer.get("error").unwrap();
        assert!(error.contains(expected), "{error}");
        assert!(is_closed(&mut stream).await);
    }
    let mut stream = TcpStream::connect(&address).await.unwrap();
    stream
        .write_all(&subscription("/chat", "*").encode().unwrap())
        .await
        .unwrap();
    let answer = read_header(&mut stream).await;
    assert_eq!(answer.get("md5sum"), Some(STRING.md5));
    assert_eq!(answer.get("latching"), Some("1"));
    assert_eq!(answer.get("message_definition"), Some(STRING.definition));
    assert_eq!(publisher.subscribers(), 1);
}

#[tokio::test]
async fn a_subscriber_of_another_type_receives_nothing_and_one_of_any_type_everything() {
    static OTHER: MessageType = MessageType {
        name: "other/Type",
        md5: "0123456789abcdef0123456789abcdef",
        definition: "",
    };
    static ANY: MessageType = MessageType {
        name: "*",
        md5: "*",
        definition: "",
    };
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let wrong = start_node("wrong", &master).await;
    let mut nothing = wrong.subscribe("/chat", &OTHER, 4).await.unwrap();
    let right = start_node("right", &master).await;
    let mut all = right.subscribe("/chat", &ANY, 4).await.unwrap();
    assert_eq!(
        timeout(TIMEOUT, all.recv()).await.unwrap(),
        Some(string("hello"))
    );
    assert!(
        timeout(Duration::from_millis(300), nothing.recv())
            .await
            .is_err()
    );
    assert_eq!((nothing.publishers(), all.publishers()), (0, 1));
}

#[tokio::test]
async fn a_header_of_4_gib_is_refused_at_once() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let _publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let address = tcpros_address(&talker, "/chat").await;
    let mut stream = TcpStream::connect(&address).await.unwrap();
    let started = Instant::now();
    stream.write_all(&[0xff; 4]).await.unwrap();
    assert!(is_closed(&mut stream).await);
    assert!(started.elapsed() < Duration::from_secs(3));
    // If a peer announces an allowed length but sends no header, the handshake timeout closes the
    // connection.
    let mut stream = TcpStream::connect(&address).await.unwrap();
    stream
        .write_all(&1_000_000_u32.to_le_bytes())
        .await
        .unwrap();
    assert!(is_closed(&mut stream).await);
}

#[tokio::test]
async fn a_subscriber_that_does_not_read_loses_only_its_own_oldest_messages() {
    const MESSAGES: u32 = 2000;
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, QUEUE).await.unwrap();
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 64).await.unwrap();
    let address = tcpros_address(&talker, "/chat").await;
    let mut slow = TcpStream::connect(&address).await.unwrap();
    slow.write_all(&subscription("/chat", STRING.md5).encode().unwrap())
        .await
        .unwrap();
    wait_until("both subscribers to connect", async || {
        publisher.subscribers() == 2
    })
    .await;
    let body = |number: u32| string(&format!("{number:>20000}"));
    let mut slowest = Duration::ZERO;
    for number in 0..MESSAGES {
        let message = body(number);
        let started = Instant::now();
        assert_eq!(publisher.publish(&message), 2);
        slowest = slowest.max(started.elapsed());
        assert_eq!(
            timeout(TIMEOUT, subscriber.recv()).await.unwrap(),
            Some(message)
        );
    }
    println!("slowest publish: {slowest:?}");
    assert_eq!(subscriber.dropped(), 0);
    let dropped = publisher.dropped();
    assert!(dropped > 0);
    // Once the slow subscriber reads, it receives complete messages in order, including the newest.
    // All other messages were counted as dropped.
    read_header(&mut slow).await;
    let (mut received, mut last) = (0, None);
    while last != Some(MESSAGES - 1) {
        let length = timeout(TIMEOUT, slow.read_u32_le()).await.unwrap().unwrap();
        let mut message = vec![0; length as usize];
        slow.read_exact(&mut message).await.unwrap();
        let number = String::from_utf8_lossy(&message[4..])
            .trim()
            .parse()
            .unwrap();
        assert!(last < Some(number), "{number} after {last:?}");
        assert_eq!(message, body(number));
        last = Some(number);
        received += 1;
    }
    assert_eq!(received + dropped, u64::from(MESSAGES));
}

#[tokio::test]
async fn a_publisher_that_resets_or_sends_garbage_is_tried_again() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 8).await.unwrap();
    // Four faulty connections: a reset, a header of 4 GiB, a message of 4 GiB and a truncated
    // message. The fifth is correct.
    let fake = FakePublisher::start("/chat", &master).await;
    let first = fake.accept().await;
    first.set_zero_linger().unwrap();
    drop(first);
    let mut second = fake.accept().await;
    second.write_all(&[0xff; 8]).await.unwrap();
    let mut third = fake.accept_and_answer(&STRING).await;
    third.write_all(&[0xff, 0xff, 0xff, 0xff, 1]).await.unwrap();
    let mut fourth = fake.accept_and_answer(&STRING).await;
    fourth.write_all(&[9, 0, 0, 0, 1]).await.unwrap();
    drop(fourth);
    let mut last = fake.accept_and_answer(&STRING).await;
    last.write_all(&[&[9, 0, 0, 0][..], &string("hello")].concat())
        .await
        .unwrap();
    assert_eq!(
        timeout(TIMEOUT, subscriber.recv()).await.unwrap(),
        Some(string("hello"))
    );
    drop(talker);
}

#[tokio::test]
async fn strings_that_are_not_utf8_are_delivered_unchanged_and_shown_with_replacements() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    let body = [&[4, 0, 0, 0][..], b"\xff\xfe\xe9\x00"].concat();
    publisher.publish(&body);
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    assert_eq!(
        timeout(TIMEOUT, subscriber.recv()).await.unwrap(),
        Some(body)
    );
    // A connection header with a caller name in Latin-1.
    let mut header = subscription("/chat", "*").encode().unwrap();
    let at = header
        .windows(7)
        .position(|part| part == b"/abuser")
        .unwrap();
    header[at + 1] = 0xe9;
    let address = tcpros_address(&talker, "/chat").await;
    let mut stream = TcpStream::connect(&address).await.unwrap();
    stream.write_all(&header).await.unwrap();
    assert_eq!(read_header(&mut stream).await.get("error"), None);
    let info = call_ros(talker.uri(), "getBusInfo", &["/test".into()])
        .await
        .unwrap();
    assert!(format!("{info:?}").contains("/\u{fffd}buser"), "{info:?}");
}

#[tokio::test]
async fn random_bytes_on_every_port_leave_node_and_master_working() {
    let master = start_master().await;
    let talker = start_node("talker", &master).await;
    let publisher = talker.advertise("/chat", &STRING, LATCH).await.unwrap();
    publisher.publish(&string("hello"));
    let api = |uri: &str| {
        uri.trim_start_matches("http://")
            .trim_end_matches('/')
            .to_owned()
    };
    let ports = [
        api(master.uri()),
        api(talker.uri()),
        tcpros_address(&talker, "/chat").await,
    ];
    // Knuth's MMIX linear congruential generator: the same bytes in every run.
    let mut state = 1_u64;
    let mut noise = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        state.to_be_bytes()[0]
    };
    for round in 0..300 {
        let length = usize::from(noise());
        let mut bytes: Vec<u8> = (0..length).map(|_| noise()).collect();
        // One third of the inputs start like an HTTP request and one third like a connection
        // header.
        if round % 3 == 0 {
            bytes.splice(..0, *b"POST / HTTP/1.1\r\nContent-Length: 90\r\n\r\n");
        } else if round % 3 == 1 {
            bytes.splice(
                ..0,
                (noise() / 2)
                    .to_le_bytes()
                    .into_iter()
                    .chain([0, 0, 0, 9, 0, 0, 0]),
            );
        }
        let mut stream = TcpStream::connect(&ports[(round / 3) % ports.len()])
            .await
            .unwrap();
        let _ = stream.write_all(&bytes).await;
    }
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 4).await.unwrap();
    assert_eq!(
        timeout(TIMEOUT, subscriber.recv()).await.unwrap(),
        Some(string("hello"))
    );
    assert!(
        call_ros(talker.uri(), "getPid", &["/test".into()])
            .await
            .is_ok()
    );
}
