//! A proxy between nodes and a master that delays one of the master's answers.

use std::sync::Arc;

use ros1::Master;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    sync::Notify,
    time::timeout,
};

use crate::local::{TIMEOUT, socket_address};

/// Forwards every call to a master and holds back the first answer to `method` until
/// [`DelayingProxy::release`] is called.
pub(crate) struct DelayingProxy {
    held: Arc<Notify>,
    release: Arc<Notify>,
}

impl DelayingProxy {
    pub(crate) fn start(listener: TcpListener, master: &Master, method: &'static str) -> Self {
        let (held, release) = (Arc::new(Notify::new()), Arc::new(Notify::new()));
        let ours = Self {
            held: Arc::clone(&held),
            release: Arc::clone(&release),
        };
        let master = socket_address(master);
        tokio::spawn(async move {
            let mut first = true;
            loop {
                let (mut stream, _) = listener.accept().await.unwrap();
                // A request of at most 4096 bytes on loopback arrives in one read.
                let mut request = vec![0; 4096];
                let count = stream.read(&mut request).await.unwrap();
                let mut upstream = TcpStream::connect(master).await.unwrap();
                upstream.write_all(&request[..count]).await.unwrap();
                let mut answer = Vec::new();
                upstream.read_to_end(&mut answer).await.unwrap();
                let matches = String::from_utf8_lossy(&request).contains(method);
                if matches && std::mem::take(&mut first) {
                    held.notify_one();
                    release.notified().await;
                }
                // Ignore errors: the caller can have timed out and closed the connection.
                let _ = stream.write_all(&answer).await;
            }
        });
        ours
    }

    /// Waits until the master has answered and the answer is held back.
    pub(crate) async fn wait_until_held(&self) {
        timeout(TIMEOUT, self.held.notified()).await.unwrap();
    }

    pub(crate) fn release(&self) {
        self.release.notify_one();
    }
}
