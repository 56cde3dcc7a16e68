//! Services whose handlers fail and whose clients misbehave.

use ros1::{
    tcpros::Header,
    xmlrpc::{Value, call_ros},
};
use tokio::{io::AsyncWriteExt as _, net::TcpStream};

use crate::{
    local::{is_closed, master, node, read_header},
    types::SET_BOOL,
};

#[tokio::test]
async fn a_service_that_fails_panics_or_is_asked_nonsense_goes_on_serving() {
    let master = master().await;
    let server = node("server", &master).await;
    let _service = server
        .serve("/negate", &SET_BOOL, |request| match request {
            [0] => Ok(vec![1, 0, 0, 0, 0]),
            [1] => Err("not this".to_owned()),
            _ => panic!("a handler's bug"),
        })
        .await
        .unwrap();
    let client = node("client", &master).await;
    let mut lasting = client.connect("/negate", &SET_BOOL).await.unwrap();
    for _ in 0..3 {
        assert_eq!(lasting.call(&[0]).await.unwrap(), [1, 0, 0, 0, 0]);
        assert!(
            lasting
                .call(&[1])
                .await
                .unwrap_err()
                .to_string()
                .contains("not this")
        );
        assert!(
            lasting
                .call(&[7, 7])
                .await
                .unwrap_err()
                .to_string()
                .contains("handler failed")
        );
    }
    let address = tcpros_service(&master).await;
    let mut stream = TcpStream::connect(&address).await.unwrap();
    let header = Header::new().with("service", "/negate").with("md5sum", "*");
    stream.write_all(&header.encode().unwrap()).await.unwrap();
    read_header(&mut stream).await;
    stream.write_all(&[0xff; 4]).await.unwrap();
    assert!(is_closed(&mut stream).await);
    assert!(client.call("/negate", &SET_BOOL, &[0]).await.is_ok());
}

#[tokio::test]
async fn a_client_that_asks_nothing_is_closed_and_a_persistent_one_may_take_its_time() {
    let master = master().await;
    let server = node("server", &master).await;
    let _service = server
        .serve("/negate", &SET_BOOL, |_| Ok(vec![1, 0, 0, 0, 0]))
        .await
        .unwrap();
    let client = node("client", &master).await;
    let mut lasting = client.connect("/negate", &SET_BOOL).await.unwrap();
    let address = tcpros_service(&master).await;
    let mut silent = TcpStream::connect(&address).await.unwrap();
    let header = Header::new().with("service", "/negate").with("md5sum", "*");
    silent.write_all(&header.encode().unwrap()).await.unwrap();
    read_header(&mut silent).await;
    assert!(is_closed(&mut silent).await);
    assert_eq!(lasting.call(&[0]).await.unwrap(), [1, 0, 0, 0, 0]);
}

#[tokio::test]
async fn a_service_that_is_dropped_right_before_its_node_ends_is_unregistered() {
    let master = master().await;
    let server = node("server", &master).await;
    let service = server
        .serve("/negate", &SET_BOOL, |_| Ok(Vec::new()))
        .await
        .unwrap();
    tcpros_service(&master).await;
    drop(service);
    server.shutdown().await;
    let arguments = [Value::from("/test"), "/negate".into()];
    let found = call_ros(master.uri(), "lookupService", &arguments).await;
    assert!(found.is_err(), "{found:?}");
}

async fn tcpros_service(master: &ros1::Master) -> String {
    let arguments = [Value::from("/test"), "/negate".into()];
    let uri = call_ros(master.uri(), "lookupService", &arguments)
        .await
        .unwrap();
    uri.as_str()
        .unwrap()
        .trim_start_matches("rosrpc://")
        .to_owned()
}
