//! Peers that violate the protocol, send garbage or do not read. All other peers are still served.

use std::time::{Duration, Instant};

use ros1::{
    MessageType, PublisherOptions,
    tcpros::Header,
    xmlrpc::{Value, call_ros},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    time::{sleep, timeout},
};
use tracing::Level;

use crate::{
    fakes::{FakePublisher, register},
    local::{
        LATCH, QUEUE, SET_BOOL, STRING, TIMEOUT, Talker, answers, expect_text, free_port,
        host_and_port, is_closed, open, read_header, receive, serve, start_master, start_node,
        string, uri, wait_for_subscribers, wait_until,
    },
    log::Log,
};

/// A queue so short that it drops messages if a subscriber reads slowly.
const SHORT_QUEUE: PublisherOptions = PublisherOptions { queue: 16, latch: false };

/// Encodes the connection header of a subscriber to `topic`.
fn subscription(topic: &str, md5: &str) -> Vec<u8> {
    let header = Header::new()
        .with("callerid", "/abuser")
        .with("md5sum", md5)
        .with("topic", topic)
        .with("type", "std_msgs/String");
    header.encode().unwrap()
}

#[tokio::test]
async fn silent_connections_block_nobody_and_are_closed() {
    let talker = Talker::latched().await;
    let address = talker.address().await;
    let mut silent = Vec::new();
    for _ in 0..40 {
        silent.push(TcpStream::connect(&address).await.unwrap());
    }
    let (_listener, mut subscriber) = talker.listener(4).await;
    let message = timeout(Duration::from_secs(3), subscriber.recv()).await;
    assert_eq!(message.unwrap(), Some(string("hello")));
    assert!(is_closed(&mut silent[0]).await);
}

#[tokio::test]
async fn subscribers_that_reset_after_their_header_do_not_end_the_topic() {
    let talker = Talker::start(SHORT_QUEUE).await;
    let publisher = &talker.publisher;
    let (_listener, mut subscriber) = talker.listener(64).await;
    wait_for_subscribers(publisher, 1).await;
    let address = talker.address().await;
    for round in 0..20 {
        let resetting = open(&address, &subscription("/chat", STRING.md5)).await;
        resetting.set_zero_linger().unwrap();
        drop(resetting);
        publisher.publish(&string(&format!("{round}")));
        expect_text(&mut subscriber, &format!("{round}")).await;
    }
    wait_for_subscribers(publisher, 1).await;
    assert_eq!((publisher.dropped(), subscriber.dropped()), (0, 0));
}

#[tokio::test]
async fn a_wrong_md5_is_refused_with_a_reason_and_a_wildcard_is_accepted() {
    let talker = Talker::latched().await;
    let address = talker.address().await;
    let wrong = "0123456789abcdef0123456789abcdef";
    let encoded = |fields: &[(&str, &str)]| {
        let fields = fields.iter();
        let header = fields.fold(Header::new(), |header, (name, value)| header.with(name, value));
        header.encode().unwrap()
    };
    for (header, expected) in [
        (subscription("/chat", wrong), wrong),
        (subscription("/none", STRING.md5), "/none"),
        (encoded(&[("topic", "/chat")]), "md5sum"),
        (encoded(&[("callerid", "/abuser")]), "neither"),
        (encoded(&[("service", "/none"), ("md5sum", "*")]), "/none"),
    ] {
        let mut stream = open(&address, &header).await;
        let answer = read_header(&mut stream).await;
        let error = answer.get("error").unwrap();
        assert!(error.contains(expected), "{error}");
        assert!(is_closed(&mut stream).await);
    }
    let mut stream = open(&address, &subscription("/chat", "*")).await;
    let answer = read_header(&mut stream).await;
    assert_eq!(answer.get("md5sum"), Some(STRING.md5));
    assert_eq!(answer.get("latching"), Some("1"));
    assert_eq!(answer.get("message_definition"), Some(STRING.definition));
    assert_eq!(talker.publisher.subscribers(), 1);
}

#[tokio::test]
async fn a_subscriber_of_another_type_receives_nothing_and_one_of_any_type_everything() {
    static OTHER: MessageType =
        MessageType { name: "other/Type", md5: "0123456789abcdef0123456789abcdef", definition: "" };
    static ANY: MessageType = MessageType { name: "*", md5: "*", definition: "" };
    let talker = Talker::latched().await;
    let wrong = start_node("wrong", &talker.master).await;
    let mut nothing = wrong.subscribe("/chat", &OTHER, 4).await.unwrap();
    let right = start_node("right", &talker.master).await;
    let mut all = right.subscribe("/chat", &ANY, 4).await.unwrap();
    expect_text(&mut all, "hello").await;
    let received = timeout(Duration::from_millis(300), nothing.recv()).await;
    assert!(received.is_err());
    assert_eq!((nothing.publishers(), all.publishers()), (0, 1));
}

#[tokio::test]
async fn a_header_of_4_gib_is_refused_at_once() {
    let talker = Talker::start(QUEUE).await;
    let address = talker.address().await;
    let started = Instant::now();
    let mut stream = open(&address, &[0xff; 4]).await;
    assert!(is_closed(&mut stream).await);
    assert!(started.elapsed() < Duration::from_secs(3));
    // If a peer announces an allowed length but sends no header, the handshake timeout closes the
    // connection.
    let mut stream = open(&address, &1_000_000_u32.to_le_bytes()).await;
    assert!(is_closed(&mut stream).await);
}

#[tokio::test]
async fn a_subscriber_that_does_not_read_loses_only_its_own_oldest_messages() {
    const MESSAGES: u32 = 2000;
    let talker = Talker::start(SHORT_QUEUE).await;
    let publisher = &talker.publisher;
    let (_listener, mut subscriber) = talker.listener(64).await;
    let address = talker.address().await;
    let mut slow = open(&address, &subscription("/chat", STRING.md5)).await;
    wait_for_subscribers(publisher, 2).await;
    let body = |number: u32| string(&format!("{number:>20000}"));
    let mut slowest = Duration::ZERO;
    for number in 0..MESSAGES {
        let message = body(number);
        let started = Instant::now();
        assert_eq!(publisher.publish(&message), 2);
        slowest = slowest.max(started.elapsed());
        assert_eq!(receive(&mut subscriber).await, Some(message));
    }
    println!("slowest publish: {slowest:?}");
    assert_eq!(subscriber.dropped(), 0);
    let dropped = publisher.dropped();
    assert!(dropped > 0);
    // When the slow subscriber starts to read, it receives complete messages in order, including
    // the newest. All other messages were counted as dropped.
    read_header(&mut slow).await;
    let (mut received, mut last) = (0, None);
    while last != Some(MESSAGES - 1) {
        let length = timeout(TIMEOUT, slow.read_u32_le()).await.unwrap().unwrap();
        let mut message = vec![0; length as usize];
        slow.read_exact(&mut message).await.unwrap();
        let text = String::from_utf8_lossy(&message[4..]);
        let number = text.trim().parse().unwrap();
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
    let mut third = fake.accept_and_answer().await;
    third.write_all(&[0xff, 0xff, 0xff, 0xff, 1]).await.unwrap();
    let mut fourth = fake.accept_and_answer().await;
    fourth.write_all(&[9, 0, 0, 0, 1]).await.unwrap();
    drop(fourth);
    let mut last = fake.accept_and_answer().await;
    let message = [&[9, 0, 0, 0][..], &string("hello")].concat();
    last.write_all(&message).await.unwrap();
    expect_text(&mut subscriber, "hello").await;
}

#[tokio::test]
async fn a_publisher_that_cannot_be_reached_is_logged_once_until_it_can_be_or_has_gone() {
    let log = Log::start();
    let master = start_master().await;
    let listener = start_node("listener", &master).await;
    let mut subscriber = listener.subscribe("/chat", &STRING, 8).await.unwrap();
    let api = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let elsewhere = uri(api.local_addr().unwrap().port());
    let _elsewhere = FakePublisher::answer(api, "no-such-host.invalid").await;
    let port = free_port();
    // RFC 6761 reserves `.invalid` for names that never resolve.
    for (uri, reason) in [
        (
            "http://no-such-host.invalid:4321/",
            "the host name no-such-host.invalid does not resolve",
        ),
        (&*elsewhere, "it sends messages at no-such-host.invalid:"),
        (&*uri(port), "Connection refused"),
    ] {
        register("/chat", uri, &master).await;
        wait_until("the fault", async || subscriber.unreachable().len() == 1).await;
        let fault = subscriber.unreachable().remove(0);
        assert!(fault.starts_with(uri) && fault.contains(reason), "{fault}");
        let of_node = listener.unreachable_publishers();
        assert_eq!(of_node, [("/chat".to_owned(), fault.clone())]);
        // The subscriber tries again several times within this second.
        sleep(Duration::from_secs(1)).await;
        assert_eq!(log.count(Level::WARN, &fault), 1, "{fault}");
        if uri.ends_with(&format!(":{port}/")) {
            continue;
        }
        let arguments = ["/fake", "/chat", uri].map(Value::from);
        let unregistered = call_ros(master.uri(), "unregisterPublisher", &arguments).await;
        unregistered.unwrap();
        wait_until("its end", async || subscriber.unreachable().is_empty()).await;
    }
    let api = TcpListener::bind(("127.0.0.1", port)).await.unwrap();
    let back = FakePublisher::answer(api, "127.0.0.1").await;
    let mut stream = back.accept_and_answer().await;
    let message = [&[9, 0, 0, 0][..], &string("hello")].concat();
    stream.write_all(&message).await.unwrap();
    expect_text(&mut subscriber, "hello").await;
    assert_eq!(subscriber.unreachable(), [""; 0]);
    assert_eq!(log.count(Level::INFO, "connected to the publisher"), 1);
    assert_eq!(log.count(Level::INFO, "has gone"), 2);
    assert_eq!(log.count(Level::WARN, "no connection to a publisher"), 3);
}

#[tokio::test]
async fn subscribers_that_come_and_go_cost_a_steady_one_nothing_and_log_no_fault() {
    let log = Log::start();
    let talker = Talker::start(LATCH).await;
    let (_node, mut steady) = talker.listener(4).await;
    wait_for_subscribers(&talker.publisher, 1).await;
    for round in 0..40 {
        let text = format!("{round}");
        talker.publisher.publish(&string(&text));
        let node = start_node(&format!("guest{round}"), &talker.master).await;
        let mut guest = node.subscribe("/chat", &STRING, 4).await.unwrap();
        expect_text(&mut guest, &text).await;
        expect_text(&mut steady, &text).await;
        // Every second node disconnects without unregistering.
        if round % 2 == 0 {
            node.shutdown().await;
        }
    }
    wait_for_subscribers(&talker.publisher, 1).await;
    assert_eq!((talker.publisher.dropped(), steady.dropped()), (0, 0));
    assert_eq!(log.count(Level::WARN, ""), 0);
}

#[tokio::test]
async fn strings_that_are_not_utf8_are_delivered_unchanged_and_shown_with_replacements() {
    let talker = Talker::start(LATCH).await;
    let body = [&[4, 0, 0, 0][..], b"\xff\xfe\xe9\x00"].concat();
    talker.publisher.publish(&body);
    let (_listener, mut subscriber) = talker.listener(4).await;
    assert_eq!(receive(&mut subscriber).await, Some(body));
    // Build a connection header whose caller name is in Latin-1.
    let mut header = subscription("/chat", "*");
    let at = header.windows(7).position(|part| part == b"/abuser");
    header[at.unwrap() + 1] = 0xe9;
    let mut stream = open(&talker.address().await, &header).await;
    assert_eq!(read_header(&mut stream).await.get("error"), None);
    let info = call_ros(talker.node.uri(), "getBusInfo", &["/test".into()]).await;
    assert!(format!("{info:?}").contains("/\u{fffd}buser"), "{info:?}");
}

#[tokio::test]
async fn random_bytes_on_every_port_leave_node_and_master_working() {
    let talker = Talker::latched().await;
    let (master, node) = (talker.master.uri(), talker.node.uri());
    let tcpros = talker.address().await;
    let ports = [host_and_port(master), host_and_port(node), &tcpros];
    // Pseudo-random bytes from Knuth's MMIX generator, so that every run sends the same bytes.
    let mut state = 1_u64;
    let mut noise = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
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
            bytes.splice(..0, [noise() / 2, 0, 0, 0, 9, 0, 0, 0]);
        }
        let stream = TcpStream::connect(ports[(round / 3) % ports.len()]).await;
        let _ = stream.unwrap().write_all(&bytes).await;
    }
    let (_listener, mut subscriber) = talker.listener(4).await;
    expect_text(&mut subscriber, "hello").await;
    assert!(answers(node).await);
}

/// Returns the number of Linux's established sockets with `port` at either end, and the number of
/// these sockets with a running keepalive timer.
fn connections(port: u16) -> (usize, usize) {
    let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
    let port = format!(":{port:04X}");
    let mut counts = (0, 0);
    for line in table.lines().skip(1) {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (local, remote, state, timer) = (fields[1], fields[2], fields[3], fields[5]);
        if state == "01" && (local.ends_with(&port) || remote.ends_with(&port)) {
            counts.0 += 1;
            counts.1 += usize::from(timer.starts_with("02:"));
        }
    }
    counts
}

/// TCP keepalive detects peers whose machine has vanished. A peer on the same machine cannot
/// vanish, so the test checks in Linux's connection table that keepalive is enabled.
#[tokio::test]
#[cfg_attr(not(target_os = "linux"), ignore = "reads the connection table of Linux")]
async fn both_ends_of_topic_and_service_connections_use_keepalive() {
    let talker = Talker::start(QUEUE).await;
    let _service = serve(&talker.node, "/serve", &[]).await;
    let (listener, _subscriber) = talker.listener(4).await;
    let _client = listener.connect("/serve", &SET_BOOL).await.unwrap();
    wait_for_subscribers(&talker.publisher, 1).await;
    let address = talker.address().await;
    let (_, port) = address.rsplit_once(':').unwrap();
    let port = port.parse().unwrap();
    // There is one topic connection and one service connection. Both ends of each are on this
    // machine, so the table lists four sockets.
    wait_until("the keepalive timers", async || connections(port) == (4, 4)).await;
}
