//! The XML-RPC server of nodes and masters.

use std::{collections::VecDeque, io, sync::Arc, time::Duration};

use tokio::{
    io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader},
    net::{TcpListener, TcpStream},
    sync::watch,
    task::{AbortHandle, JoinHandle, JoinSet},
    time::{sleep, timeout},
};

use super::{
    codec::{decode_call, encode_response},
    value::{Fault, Value},
};
use crate::http::{HttpError, read_body, read_head};

/// Longest time between two requests on a kept-alive connection.
const IDLE_TIMEOUT: Duration = Duration::from_mins(2);
/// Time limit for each of three phases: waiting for the first byte of a connection's first request,
/// receiving the rest of a request, and sending a response.
const TRANSFER_TIMEOUT: Duration = Duration::from_secs(10);
/// Maximum number of open connections. Each further connection closes the oldest one: a call takes
/// milliseconds, so the oldest of 256 connections is idle or its peer is slow.
const MAX_CONNECTIONS: usize = 256;
/// Delay after a failed accept, for example when no file descriptor is left.
const ACCEPT_RETRY_DELAY: Duration = Duration::from_millis(100);

/// Name of the method that makes several calls in one request. All XML-RPC servers in ROS have it.
const MULTICALL: &str = "system.multicall";

/// Computes the result of a call from the method's name and the arguments.
type Answer = dyn Fn(&str, &[Value]) -> Result<Value, Fault> + Send + Sync;

/// A running XML-RPC server. Dropping the value stops the server without waiting until the port is
/// free.
#[derive(Debug)]
pub(crate) struct Server {
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
}

impl Server {
    /// Starts an XML-RPC server on `listener`. `answer` computes the result of each call and must
    /// not block.
    pub(crate) fn start(
        listener: TcpListener,
        answer: impl Fn(&str, &[Value]) -> Result<Value, Fault> + Send + Sync + 'static,
    ) -> Self {
        let (stop, stopped) = watch::channel(false);
        let task = tokio::spawn(accept(listener, Arc::new(answer), stopped));
        Self { stop, task }
    }

    /// Closes every connection and the listener. The port is free when this function returns.
    pub(crate) async fn stop(&mut self) {
        self.stop.send_replace(true);
        // Joining fails only if the task was aborted or panicked; the port is free in both cases.
        let _ = (&mut self.task).await;
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn accept(listener: TcpListener, answer: Arc<Answer>, mut stopped: watch::Receiver<bool>) {
    let mut connections = JoinSet::new();
    let mut by_age = VecDeque::new();
    loop {
        tokio::select! {
            () = async { let _ = stopped.wait_for(|stop| *stop).await; } => break,
            Some(_) = connections.join_next() => {}
            accepted = listener.accept() => match accepted {
                Ok((stream, _)) => {
                    make_room(&mut by_age);
                    by_age.push_back(connections.spawn(serve(stream, Arc::clone(&answer))));
                }
                Err(error) => {
                    tracing::warn!(%error, "an XML-RPC connection could not be accepted");
                    sleep(ACCEPT_RETRY_DELAY).await;
                }
            },
        }
    }
    drop(listener);
    connections.shutdown().await;
}

/// Closes the oldest connections, until fewer than [`MAX_CONNECTIONS`] are open. `by_age` holds the
/// connections in the order in which they were accepted.
fn make_room(by_age: &mut VecDeque<AbortHandle>) {
    by_age.retain(|connection| !connection.is_finished());
    while by_age.len() >= MAX_CONNECTIONS {
        if let Some(oldest) = by_age.pop_front() {
            oldest.abort();
        }
    }
}

async fn serve(stream: TcpStream, answer: Arc<Answer>) {
    if let Err(error) = serve_requests(stream, &*answer).await {
        tracing::debug!(%error, "an XML-RPC connection ended");
    }
}

async fn serve_requests(stream: TcpStream, answer: &Answer) -> Result<(), HttpError> {
    stream.set_nodelay(true)?;
    let mut stream = BufReader::new(stream);
    // Until the first request begins, the shorter transfer timeout applies instead of the idle
    // timeout.
    let mut first_byte_timeout = TRANSFER_TIMEOUT;
    loop {
        match timeout(first_byte_timeout, stream.fill_buf()).await {
            Ok(Ok([])) | Err(_) => return Ok(()),
            Ok(Ok(_)) => {}
            Ok(Err(error)) => return Err(error.into()),
        }
        first_byte_timeout = IDLE_TIMEOUT;
        let request = timeout(TRANSFER_TIMEOUT, read_request(&mut stream)).await;
        let Some((body, method, close)) = request.map_err(|_| timed_out())?? else {
            return Ok(());
        };
        let (status, body) = if method == "POST" {
            ("200 OK", respond(&body, answer))
        } else {
            ("501 Not Implemented", "only XML-RPC by POST is served here\n".to_owned())
        };
        let connection = if close { "close" } else { "keep-alive" };
        let response = format!(
            "HTTP/1.1 {status}\r\nContent-Type: text/xml\r\nContent-Length: {}\r\n\
             Connection: {connection}\r\n\r\n{body}",
            body.len()
        );
        let sent = stream.get_mut().write_all(response.as_bytes());
        timeout(TRANSFER_TIMEOUT, sent).await.map_err(|_| timed_out())??;
        if close {
            return Ok(());
        }
    }
}

/// Reads one request. Returns its body, its HTTP method and whether the connection closes after the
/// response; `None` if the stream has ended.
async fn read_request(
    stream: &mut BufReader<TcpStream>,
) -> Result<Option<(Vec<u8>, String, bool)>, HttpError> {
    let Some(head) = read_head(stream).await? else {
        return Ok(None);
    };
    if head.expects_continue {
        stream.get_mut().write_all(b"HTTP/1.1 100 Continue\r\n\r\n").await?;
    }
    let body = read_body(stream, &head).await?;
    let method = head.first_line.split_ascii_whitespace().next().unwrap_or_default().to_owned();
    Ok(Some((body, method, head.close)))
}

fn respond(body: &[u8], answer: &Answer) -> String {
    let response = match decode_call(body) {
        Ok(call) if call.method == MULTICALL => multicall(&call.arguments, answer),
        Ok(call) => answer(&call.method, &call.arguments),
        Err(error) => Err(Fault::new(error.to_string())),
    };
    encode_response(&response)
}

fn timed_out() -> HttpError {
    HttpError::Io(io::Error::new(io::ErrorKind::TimedOut, "the peer sends or receives too slowly"))
}

/// Answers each call in a list. The result for one call is an array that holds the value, or a
/// struct that describes the fault.
fn multicall(arguments: &[Value], answer: &Answer) -> Result<Value, Fault> {
    let [Value::Array(calls)] = arguments else {
        return Err(Fault::new(format!("{MULTICALL} takes one array of calls")));
    };
    Ok(calls.iter().map(|call| answer_one(call, answer)).collect())
}

fn answer_one(call: &Value, answer: &Answer) -> Value {
    let method = call.member("methodName").and_then(Value::as_str);
    let method = method.unwrap_or_default();
    let arguments = call.member("params").and_then(Value::as_array);
    let outcome = if method == MULTICALL {
        Err(Fault::new(format!("{MULTICALL} cannot contain itself")))
    } else {
        answer(method, arguments.unwrap_or_default())
    };
    match outcome {
        Ok(value) => Value::Array(vec![value]),
        Err(fault) => fault.into(),
    }
}
