//! A master whose answer to one method is late.

use std::sync::Arc;

use ros1::Master;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
    sync::Notify,
    time::timeout,
};

use crate::local::{PATIENCE, address};

/// Stands before a master and passes everything on; the first answer to `method` waits.
pub(crate) struct HeldMaster {
    held: Arc<Notify>,
    release: Arc<Notify>,
}

impl HeldMaster {
    pub(crate) fn start(listener: TcpListener, master: &Master, method: &'static str) -> Self {
        let (held, release) = (Arc::new(Notify::new()), Arc::new(Notify::new()));
        let ours = Self {
            held: Arc::clone(&held),
            release: Arc::clone(&release),
        };
        let master = address(master);
        tokio::spawn(async move {
            let mut first = true;
            loop {
                let (mut stream, _) = listener.accept().await.unwrap();
                // The request is small and comes in one piece.
                let mut request = vec![0; 4096];
                let count = stream.read(&mut request).await.unwrap();
                let mut upstream = TcpStream::connect(master).await.unwrap();
                upstream.write_all(&request[..count]).await.unwrap();
                let mut answer = Vec::new();
                upstream.read_to_end(&mut answer).await.unwrap();
                let asked = String::from_utf8_lossy(&request).contains(method);
                if asked && std::mem::take(&mut first) {
                    held.notify_one();
                    release.notified().await;
                }
                // The caller may have given up.
                let _ = stream.write_all(&answer).await;
            }
        });
        ours
    }

    /// The master has answered; the node does not know yet.
    pub(crate) async fn holds(&self) {
        timeout(PATIENCE, self.held.notified()).await.unwrap();
    }

    pub(crate) fn release(&self) {
        self.release.notify_one();
    }
}
