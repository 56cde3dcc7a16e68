//! Serves the page, its stream of messages and its commands, each only to clients that may use it.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};

use crate::command::{Command, Reply};
use crate::feed::Feed;
use crate::files::{file, places};
use crate::request::{
    self, BAD_REQUEST, CONTENT_TOO_LARGE, FORBIDDEN, METHOD_NOT_ALLOWED, NOT_FOUND, Refusal,
    Request, UNAUTHORIZED, UNAVAILABLE,
};
use crate::token::Token;

/// Largest number of connections that are served at the same time. A further connection replaces
/// the oldest one whose request has not arrived yet.
const MAX_CONNECTIONS: usize = 64;
/// Largest number of pages that receive messages at the same time.
const MAX_VIEWERS: usize = 8;
/// Time limit for a client to accept what is written. A page that was cut off connects again.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Time limit for the program to answer a command. A self-test takes some seconds.
const REPLY_TIMEOUT: Duration = Duration::from_secs(30);
/// Longest time for which the rest of a refused request is read, so that its client reads why.
const LINGER: Duration = Duration::from_secs(1);
/// Pause after an error in accepting a connection, such as too many open files.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Header fields of every response. The page may load from and connect to this server only, no
/// other site may embed or read it, and no response is cached.
const FIELDS: &str = "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src \
'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
X-Content-Type-Options: nosniff\r\n\
Referrer-Policy: no-referrer\r\n\
Cross-Origin-Opener-Policy: same-origin\r\n\
Cross-Origin-Resource-Policy: same-origin\r\n\
Cache-Control: no-store\r\n\
Connection: close\r\n";

/// Answers the requests to one address.
pub(crate) struct Server {
    address: SocketAddr,
    token: Token,
    feed: Feed,
    on_command: Box<dyn Fn(Command, Reply) + Send + Sync>,
    /// Tasks of the connections whose request has not arrived, by number, so the oldest is first.
    waiting: Mutex<BTreeMap<u64, AbortHandle>>,
}

/// How to answer a request.
enum Answer {
    Text(&'static str, String),
    Stream,
    /// A command of a user who may send it.
    Command(Command),
}

impl Server {
    pub(crate) fn new(
        address: SocketAddr,
        token: Token,
        feed: Feed,
        on_command: impl Fn(Command, Reply) + Send + Sync + 'static,
    ) -> Server {
        Server { address, token, feed, on_command: Box::new(on_command), waiting: Mutex::default() }
    }

    fn waiting(&self) -> MutexGuard<'_, BTreeMap<u64, AbortHandle>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Serves every connection in a task of its own.
    pub(crate) async fn serve(self, listener: TcpListener) {
        let server = Arc::new(self);
        let connections = Arc::new(Semaphore::new(MAX_CONNECTIONS));
        let viewers = Arc::new(Semaphore::new(MAX_VIEWERS));
        for number in 0.. {
            let Ok((stream, _)) = listener.accept().await else {
                sleep(ACCEPT_PAUSE).await;
                continue;
            };
            if connections.available_permits() == 0 {
                let Some((_, oldest)) = server.waiting().pop_first() else {
                    continue;
                };
                oldest.abort();
            }
            // The aborted task returns its permit as soon as it is dropped.
            let Ok(permit) = Arc::clone(&connections).acquire_owned().await else {
                return;
            };
            let (of_task, viewers) = (Arc::clone(&server), Arc::clone(&viewers));
            let task = tokio::spawn(async move {
                of_task.converse(stream, number, &viewers).await;
                drop(permit);
            });
            server.waiting().insert(number, task.abort_handle());
        }
    }

    /// Reads and answers the request of the connection with the number `number`.
    async fn converse(&self, mut stream: TcpStream, number: u64, viewers: &Arc<Semaphore>) {
        // Send each message at once: waiting for more bytes would delay it.
        let _ = stream.set_nodelay(true);
        let request = request::read(&mut stream).await;
        self.waiting().remove(&number);
        let Some(request) = request else {
            return;
        };
        let answer = request.and_then(|request| self.answer(&request));
        // Ignore a failure, because it means that the client has left.
        let _ = match answer {
            Ok(Answer::Text(kind, text)) => respond(&mut stream, "200 OK", kind, &text).await,
            Ok(Answer::Command(command)) => self.perform(command, &mut stream).await,
            Ok(Answer::Stream) => match Arc::clone(viewers).try_acquire_owned() {
                Ok(permit) => self.stream(stream, permit).await,
                Err(_) => refuse(&mut stream, UNAVAILABLE).await,
            },
            Err(refusal) => refuse(&mut stream, refusal).await,
        };
    }

    /// Checks that the client may send the request, and returns how to answer it.
    fn answer(&self, request: &Request) -> Result<Answer, Refusal> {
        if request.method != "POST" && !request.body.is_empty() {
            return Err(CONTENT_TOO_LARGE);
        }
        let own_origin = format!("http://{}", request.host);
        let origin = request.origin.as_ref();
        if !self.is_own_host(&request.host) || origin.is_some_and(|origin| *origin != own_origin) {
            return Err(FORBIDDEN);
        }
        let token = request.token.as_ref();
        let has_token = token.is_some_and(|token| self.token.matches(token));
        let (path, query) = request.target.split_once('?').unwrap_or((&request.target, ""));
        match (request.method.as_str(), path) {
            // Refuse pages of other sites: they could use up the connections of all viewers.
            ("GET", "/stream") if request.is_foreign => Err(FORBIDDEN),
            ("GET", "/stream") => {
                // Loopback needs no token, but a wrong one is refused, so that the user notices it.
                if has_token || (self.address.ip().is_loopback() && token.is_none()) {
                    Ok(Answer::Stream)
                } else {
                    Err(UNAUTHORIZED)
                }
            }
            ("GET", "/places") => Ok(Answer::Text("application/json", places(query))),
            ("GET", path) => {
                let file = file(path).ok_or(NOT_FOUND)?;
                Ok(Answer::Text(file.content_type, file.text.to_owned()))
            }
            ("POST", path) => {
                let command = Command::parse(path, &request.body).ok_or(METHOD_NOT_ALLOWED)?;
                if !has_token {
                    return Err(UNAUTHORIZED);
                }
                // Browsers send `Origin` with every `POST`, so this request is not from the page.
                if origin.is_none() {
                    return Err(FORBIDDEN);
                }
                let command = command.map_err(|why| Refusal { why, ..BAD_REQUEST })?;
                Ok(Answer::Command(command))
            }
            _ => Err(METHOD_NOT_ALLOWED),
        }
    }

    /// Passes a command to the program, and sends the program's reply to the client.
    async fn perform(&self, command: Command, stream: &mut TcpStream) -> Option<()> {
        tracing::info!(?command, "from the live page");
        let (reply, answer) = Reply::new();
        (self.on_command)(command, reply);
        match timeout(REPLY_TIMEOUT, answer).await {
            Ok(Ok(Ok(value))) => {
                respond(stream, "200 OK", "application/json", &value.to_string()).await
            }
            Ok(Ok(Err(why))) => respond(stream, "409 Conflict", TEXT, &why).await,
            Ok(Err(_)) => {
                let why = "the program has ended";
                respond(stream, UNAVAILABLE.status, TEXT, why).await
            }
            Err(_) => {
                let why = "the program has not answered within 30 s; see its log";
                respond(stream, "504 Gateway Timeout", TEXT, why).await
            }
        }
    }

    /// Returns whether the server accepts requests whose field `Host` is `host`. On loopback it
    /// accepts only its address and `localhost`, because any site can make its own name resolve to
    /// this machine. Elsewhere it accepts any name, because the token protects the server.
    fn is_own_host(&self, host: &str) -> bool {
        let local = format!("localhost:{}", self.address.port());
        !self.address.ip().is_loopback() || host == self.address.to_string() || host == local
    }

    /// Sends every message, until the viewer leaves or accepts none for [`WRITE_TIMEOUT`].
    async fn stream(&self, mut stream: TcpStream, _permit: OwnedSemaphorePermit) -> Option<()> {
        let mut messages = self.feed.subscribe();
        let head =
            format!("HTTP/1.1 200 OK\r\nContent-Type: application/octet-stream\r\n{FIELDS}\r\n");
        write(&mut stream, head.as_bytes()).await?;
        while let Some(message) = messages.next().await {
            let Ok(written) = timeout(WRITE_TIMEOUT, stream.write_all(&message)).await else {
                messages.abandon();
                return None;
            };
            written.ok()?;
        }
        Some(())
    }
}

/// Content type of a text for the user.
const TEXT: &str = "text/plain; charset=utf-8";

/// Sends the reason why a request is refused. Then reads the rest of the request for a while:
/// closing the connection earlier would discard the response to a client that is still writing.
async fn refuse(stream: &mut TcpStream, refusal: Refusal) -> Option<()> {
    respond(stream, refusal.status, TEXT, refusal.why).await?;
    let mut rest = [0; 4096];
    let read_rest = async { while stream.read(&mut rest).await.is_ok_and(|count| count > 0) {} };
    timeout(LINGER, read_rest).await.ok()
}

async fn respond(stream: &mut TcpStream, status: &str, kind: &str, text: &str) -> Option<()> {
    let length = text.len();
    let response = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{FIELDS}\r\n{text}"
    );
    write(stream, response.as_bytes()).await?;
    timeout(WRITE_TIMEOUT, stream.shutdown()).await.ok()?.ok()
}

/// Writes `bytes`. Returns `None` if the client has left or does not accept them in time.
async fn write(stream: &mut TcpStream, bytes: &[u8]) -> Option<()> {
    let written = timeout(WRITE_TIMEOUT, stream.write_all(bytes)).await;
    written.ok()?.ok()
}
