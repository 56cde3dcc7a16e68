//! A server for XML-RPC calls.

use std::{io, sync::Arc, time::Duration};

use tokio::{
    io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader},
    net::{TcpListener, TcpStream},
    sync::watch,
    task::{JoinHandle, JoinSet},
    time::{sleep, timeout},
};

use super::{
    decode::decode_call,
    encode::encode_response,
    multicall::{MULTICALL, multicall},
    value::{Fault, Value},
};
use crate::http::{HttpError, read_body, read_head};

/// A kept-alive connection may be silent for this long.
const IDLE_LIMIT: Duration = Duration::from_mins(2);
/// From the connection to a request's first byte, from there to its last, and as much again for
/// the answer.
const TRANSFER_LIMIT: Duration = Duration::from_secs(10);
/// Connections served at once; further ones wait in the system's queue.
const MAX_CONNECTIONS: usize = 256;
/// After a failed accept, such as out of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// A running server; dropping it ends it.
#[derive(Debug)]
pub(crate) struct Server {
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
}

impl Server {
    /// Answers every call on `listener` with what `answer` returns. `answer` must not block.
    pub(crate) fn start<F>(listener: TcpListener, answer: F) -> Self
    where
        F: Fn(&str, &[Value]) -> Result<Value, Fault> + Send + Sync + 'static,
    {
        let (stop, stopped) = watch::channel(false);
        let task = tokio::spawn(accept(listener, Arc::new(answer), stopped));
        Self { stop, task }
    }

    /// Ends every connection and closes the listener: when this returns, the port is free.
    pub(crate) async fn stop(&mut self) {
        self.stop.send_replace(true);
        // The only failure is that the task was already gone.
        let _ = (&mut self.task).await;
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn accept<F>(listener: TcpListener, answer: Arc<F>, mut stopped: watch::Receiver<bool>)
where
    F: Fn(&str, &[Value]) -> Result<Value, Fault> + Send + Sync + 'static,
{
    let mut connections = JoinSet::new();
    loop {
        tokio::select! {
            () = async { let _ = stopped.wait_for(|stop| *stop).await; } => break,
            Some(_) = connections.join_next() => {}
            accepted = listener.accept(), if connections.len() < MAX_CONNECTIONS => match accepted {
                Ok((stream, _)) => {
                    connections.spawn(serve(stream, Arc::clone(&answer)));
                }
                Err(error) => {
                    tracing::warn!(%error, "an XML-RPC connection could not be accepted");
                    sleep(ACCEPT_PAUSE).await;
                }
            },
        }
    }
    drop(listener);
    connections.shutdown().await;
}

async fn serve<F>(stream: TcpStream, answer: Arc<F>)
where
    F: Fn(&str, &[Value]) -> Result<Value, Fault>,
{
    if let Err(error) = converse(stream, &*answer).await {
        tracing::debug!(%error, "an XML-RPC connection ended");
    }
}

async fn converse<F>(stream: TcpStream, answer: &F) -> Result<(), HttpError>
where
    F: Fn(&str, &[Value]) -> Result<Value, Fault>,
{
    stream.set_nodelay(true)?;
    let mut stream = BufReader::new(stream);
    // Who has called once may keep the connection; who never has may not.
    let mut silence = TRANSFER_LIMIT;
    loop {
        match timeout(silence, stream.fill_buf()).await {
            Ok(Ok([])) | Err(_) => return Ok(()),
            Ok(Ok(_)) => {}
            Ok(Err(error)) => return Err(error.into()),
        }
        silence = IDLE_LIMIT;
        let request = timeout(TRANSFER_LIMIT, read_request(&mut stream)).await;
        let Some((body, method, close)) = request.map_err(|_| timed_out())?? else {
            return Ok(());
        };
        let (status, body) = if method == "POST" {
            ("200 OK", respond(&body, answer))
        } else {
            (
                "501 Not Implemented",
                "only XML-RPC by POST is served here\n".to_owned(),
            )
        };
        let connection = if close { "close" } else { "keep-alive" };
        let response = format!(
            "HTTP/1.1 {status}\r\nContent-Type: text/xml\r\nContent-Length: {}\r\n\
             Connection: {connection}\r\n\r\n{body}",
            body.len()
        );
        let sent = stream.get_mut().write_all(response.as_bytes());
        timeout(TRANSFER_LIMIT, sent)
            .await
            .map_err(|_| timed_out())??;
        if close {
            return Ok(());
        }
    }
}

/// The body, the HTTP method, and whether the connection ends after it.
async fn read_request(
    stream: &mut BufReader<TcpStream>,
) -> Result<Option<(Vec<u8>, String, bool)>, HttpError> {
    let Some(head) = read_head(stream).await? else {
        return Ok(None);
    };
    if head.expects_continue {
        stream
            .get_mut()
            .write_all(b"HTTP/1.1 100 Continue\r\n\r\n")
            .await?;
    }
    let body = read_body(stream, &head).await?;
    let method = head
        .first_line
        .split_ascii_whitespace()
        .next()
        .unwrap_or_default()
        .to_owned();
    Ok(Some((body, method, head.close)))
}

fn respond<F>(body: &[u8], answer: &F) -> String
where
    F: Fn(&str, &[Value]) -> Result<Value, Fault>,
{
    let response = match decode_call(body) {
        Ok(call) if call.method == MULTICALL => multicall(&call.arguments, answer),
        Ok(call) => answer(&call.method, &call.arguments),
        Err(error) => Err(Fault {
            code: 1,
            message: error.to_string(),
        }),
    };
    encode_response(&response)
}

fn timed_out() -> HttpError {
    HttpError::Io(io::Error::new(
        io::ErrorKind::TimedOut,
        "the peer sends or reads too slowly",
    ))
}
