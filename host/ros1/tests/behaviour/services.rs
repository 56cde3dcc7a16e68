//! Services with failing handlers and misbehaving clients.

use std::time::Duration;

use ros1::{
    tcpros::Header,
    xmlrpc::{Value, call_ros},
};
use tokio::{io::AsyncWriteExt as _, net::TcpStream};

use crate::{
    local::{is_closed, read_header, start_master, start_node, wait_until},
    types::SET_BOOL,
};

#[tokio::test]
async fn a_service_keeps_serving_after_errors_panics_and_invalid_requests() {
    let master = start_master().await;
    let server = start_node("server", &master).await;
    let _service = server
        .serve("/negate", &SET_BOOL, |request| match request {
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
        assert!(
            persistent
                .call(&[1])
                .await
                .unwrap_err()
                .to_string()
                .contains("not this")
        );
        assert!(
            persistent
                .call(&[7, 7])
                .await
                .unwrap_err()
                .to_string()
                .contains("handler failed")
        );
    }
    let address = service_address(&master).await;
    let mut stream = TcpStream::connect(&address).await.unwrap();
    let header = Header::new().with("service", "/negate").with("md5sum", "*");
    stream.write_all(&header.encode().unwrap()).await.unwrap();
    read_header(&mut stream).await;
    stream.write_all(&[0xff; 4]).await.unwrap();
    assert!(is_closed(&mut stream).await);
    assert!(client.call("/negate", &SET_BOOL, &[0]).await.is_ok());
}

#[tokio::test]
async fn a_silent_client_is_closed_and_a_persistent_one_is_not() {
    let master = start_master().await;
    let server = start_node("server", &master).await;
    let _service = server
        .serve("/negate", &SET_BOOL, |_| Ok(vec![1, 0, 0, 0, 0]))
        .await
        .unwrap();
    let client = start_node("client", &master).await;
    let mut persistent = client.connect("/negate", &SET_BOOL).await.unwrap();
    let address = service_address(&master).await;
    let mut silent = TcpStream::connect(&address).await.unwrap();
    let header = Header::new().with("service", "/negate").with("md5sum", "*");
    silent.write_all(&header.encode().unwrap()).await.unwrap();
    read_header(&mut silent).await;
    assert!(is_closed(&mut silent).await);
    assert_eq!(persistent.call(&[0]).await.unwrap(), [1, 0, 0, 0, 0]);
}

#[tokio::test]
async fn a_service_dropped_just_before_shutdown_is_unregistered() {
    let master = start_master().await;
    let server = start_node("server", &master).await;
    let service = server
        .serve("/negate", &SET_BOOL, |_| Ok(Vec::new()))
        .await
        .unwrap();
    service_address(&master).await;
    drop(service);
    server.shutdown().await;
    let arguments = [Value::from("/test"), "/negate".into()];
    let found = call_ros(master.uri(), "lookupService", &arguments).await;
    assert!(found.is_err(), "{found:?}");
}

async fn service_address(master: &ros1::Master) -> String {
    let arguments = [Value::from("/test"), "/negate".into()];
    let uri = call_ros(master.uri(), "lookupService", &arguments)
        .await
        .unwrap();
    uri.as_str()
        .unwrap()
        .trim_start_matches("rosrpc://")
        .to_owned()
}

#[tokio::test]
async fn a_service_returns_when_the_node_that_took_it_over_leaves() {
    let master = start_master().await;
    let answers = |byte: u8| move |_request: &[u8]| Ok(vec![byte, 0, 0, 0, 0]);
    let first = start_node("first", &master).await;
    let _kept = first.serve("/info", &SET_BOOL, answers(1)).await.unwrap();
    let second = start_node("second", &master).await;
    let _taken = second.serve("/info", &SET_BOOL, answers(2)).await.unwrap();
    let client = start_node("client", &master).await;
    let call = async || client.call("/info", &SET_BOOL, &[0]).await;
    assert_eq!(call().await.unwrap()[0], 2);
    // The first node does not take the service back while the other one provides it.
    tokio::time::sleep(Duration::from_millis(2500)).await;
    assert_eq!(call().await.unwrap()[0], 2);
    second.shutdown().await;
    wait_until("the service of the first node", async || {
        call().await.is_ok_and(|answer| answer[0] == 1)
    })
    .await;
}
