//! Services with failing handlers and misbehaving clients.

use std::time::Duration;

use ros1::{
    Master,
    tcpros::Header,
    xmlrpc::{CallError, Value, call_ros},
};
use tokio::{io::AsyncWriteExt as _, net::TcpStream, time::sleep};

use crate::local::{
    SET_BOOL, is_closed, open, read_header, serve, start_master, start_node, wait_until,
};

async fn look_up(master: &Master) -> Result<Value, CallError> {
    let arguments = [Value::from("/test"), "/negate".into()];
    call_ros(master.uri(), "lookupService", &arguments).await
}

/// Opens a connection to the service `/negate` and exchanges the headers.
async fn client(master: &Master) -> TcpStream {
    let uri = look_up(master).await.unwrap();
    let address = uri.as_str().unwrap().trim_start_matches("rosrpc://");
    let header = Header::new().with("service", "/negate").with("md5sum", "*");
    let mut stream = open(address, &header.encode().unwrap()).await;
    read_header(&mut stream).await;
    stream
}

#[tokio::test]
async fn a_service_keeps_serving_after_errors_panics_and_invalid_requests() {
    let master = start_master().await;
    let server = start_node("server", &master).await;
    let _service = server
        .serve("/negate", &SET_BOOL, |_, request| match request {
            [0] => Ok(vec![1, 0, 0, 0, 0]),
            [1] => Err("not this".to_owned()),
            _ => panic!("a handler's bug"),
        })
        .await
        .unwrap();
    let client = start_node("client", &master).await;
    let mut persistent = client.connect("/negate", &SET_BOOL).await.unwrap();
    for _ in 0..3 {
        assert_eq!(persistent.call(&[0]).await.unwrap(), [1, 0, 0, 0, 0]);
        for (request, reason) in [(&[1][..], "not this"), (&[7, 7], "handler failed")] {
            let error = persistent.call(request).await.unwrap_err();
            assert!(error.to_string().contains(reason), "{error}");
        }
    }
    let mut stream = self::client(&master).await;
    stream.write_all(&[0xff; 4]).await.unwrap();
    assert!(is_closed(&mut stream).await);
    assert!(client.call("/negate", &SET_BOOL, &[0]).await.is_ok());
}

#[tokio::test]
async fn a_silent_client_is_closed_and_a_persistent_one_is_not() {
    let master = start_master().await;
    let server = start_node("server", &master).await;
    let _service = serve(&server, "/negate", &[1, 0, 0, 0, 0]).await;
    let client = start_node("client", &master).await;
    let mut persistent = client.connect("/negate", &SET_BOOL).await.unwrap();
    let mut silent = self::client(&master).await;
    assert!(is_closed(&mut silent).await);
    assert_eq!(persistent.call(&[0]).await.unwrap(), [1, 0, 0, 0, 0]);
}

#[tokio::test]
async fn a_service_dropped_just_before_shutdown_is_unregistered() {
    let master = start_master().await;
    let server = start_node("server", &master).await;
    let service = serve(&server, "/negate", &[]).await;
    look_up(&master).await.unwrap();
    drop(service);
    server.shutdown().await;
    let found = look_up(&master).await;
    assert!(found.is_err(), "{found:?}");
}

#[tokio::test]
async fn a_service_returns_when_the_node_that_took_it_over_leaves() {
    let master = start_master().await;
    let first = start_node("first", &master).await;
    let _kept = serve(&first, "/info", &[1, 0, 0, 0, 0]).await;
    let second = start_node("second", &master).await;
    let _taken = serve(&second, "/info", &[2, 0, 0, 0, 0]).await;
    let client = start_node("client", &master).await;
    let call = async || client.call("/info", &SET_BOOL, &[0]).await;
    assert_eq!(call().await.unwrap()[0], 2);
    // Over two check periods, the first node does not take the service back from the second node.
    sleep(Duration::from_millis(2500)).await;
    assert_eq!(call().await.unwrap()[0], 2);
    second.shutdown().await;
    wait_until("the service of the first node", async || {
        call().await.is_ok_and(|answer| answer[0] == 1)
    })
    .await;
}
