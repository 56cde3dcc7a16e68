//! Serves the page, its stream of messages and its commands, each only to who may have it.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::io::AsyncWriteExt as _;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};

use crate::Command;
use crate::feed::Feed;
use crate::files::{file, places};
use crate::request::{
    self, CONTENT_TOO_LARGE, FORBIDDEN, METHOD_NOT_ALLOWED, NOT_FOUND, Refusal, Request,
    UNAUTHORIZED, UNAVAILABLE,
};
use crate::token::Token;

/// Largest number of connections that are served at a time. A further one is closed.
const MAX_CONNECTIONS: usize = 64;
/// Largest number of pages that receive messages at a time.
const MAX_VIEWERS: usize = 8;
/// Longest time in which a client must take what is written. A page that comes back later connects
/// again.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Time until a connection is accepted again after an error, such as too many open files.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Fields of every response. The page may load and connect to nothing but this server, no other
/// site may embed or read it, and nothing is kept.
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
    on_command: Box<dyn Fn(Command) + Send + Sync>,
}

/// What a request is answered with.
enum Answer {
    Text(&'static str, String),
    Stream,
    /// The command was passed on.
    Done,
}

impl Server {
    pub(crate) fn new(
        address: SocketAddr,
        token: Token,
        feed: Feed,
        on_command: impl Fn(Command) + Send + Sync + 'static,
    ) -> Server {
        Server {
            address,
            token,
            feed,
            on_command: Box::new(on_command),
        }
    }

    /// Serves every connection in a task of its own.
    pub(crate) async fn serve(self, listener: TcpListener) {
        let server = Arc::new(self);
        let connections = Arc::new(Semaphore::new(MAX_CONNECTIONS));
        let viewers = Arc::new(Semaphore::new(MAX_VIEWERS));
        loop {
            let Ok((stream, _)) = listener.accept().await else {
                sleep(ACCEPT_PAUSE).await;
                continue;
            };
            if let Ok(permit) = Arc::clone(&connections).try_acquire_owned() {
                let (server, viewers) = (Arc::clone(&server), Arc::clone(&viewers));
                tokio::spawn(async move {
                    server.converse(stream, &viewers).await;
                    drop(permit);
                });
            }
        }
    }

    /// Reads a request and answers it.
    async fn converse(&self, mut stream: TcpStream, viewers: &Arc<Semaphore>) {
        // A message is written at once; waiting for more bytes would delay it.
        let _ = stream.set_nodelay(true);
        let Some(request) = request::read(&mut stream).await else {
            return;
        };
        let answer = request.and_then(|request| self.answer(&request));
        // A client that has left needs no answer.
        let _ = match answer {
            Ok(Answer::Text(kind, text)) => respond(&mut stream, "200 OK", kind, &text).await,
            Ok(Answer::Done) => respond(&mut stream, "204 No Content", "text/plain", "").await,
            Ok(Answer::Stream) => match Arc::clone(viewers).try_acquire_owned() {
                Ok(permit) => self.stream(stream, permit).await,
                Err(_) => respond(&mut stream, UNAVAILABLE, "text/plain", UNAVAILABLE).await,
            },
            Err(refusal) => respond(&mut stream, refusal, "text/plain", refusal).await,
        };
    }

    /// Decides what a request is answered with, and passes on a command.
    fn answer(&self, request: &Request) -> Result<Answer, Refusal> {
        if request.has_body {
            return Err(CONTENT_TOO_LARGE);
        }
        let own_origin = format!("http://{}", request.host);
        let origin = request.origin.as_ref();
        if !self.is_own_host(&request.host) || origin.is_some_and(|origin| *origin != own_origin) {
            return Err(FORBIDDEN);
        }
        let token = request.token.as_ref();
        let has_token = token.is_some_and(|token| self.token.matches(token));
        let (path, query) = request
            .target
            .split_once('?')
            .unwrap_or((&request.target, ""));
        match (request.method.as_str(), path) {
            // Otherwise any page could occupy the places of all viewers, without reading a byte.
            ("GET", "/stream") if request.is_foreign => Err(FORBIDDEN),
            ("GET", "/stream") => {
                // A token that is given must be right, so that a user learns of a mistake.
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
            ("POST", "/start" | "/stop") if !has_token => Err(UNAUTHORIZED),
            // Browsers send the origin with every request that is not a GET.
            ("POST", "/start" | "/stop") if origin.is_none() => Err(FORBIDDEN),
            ("POST", "/start") => Ok(self.pass_on(Command::Start)),
            ("POST", "/stop") => Ok(self.pass_on(Command::Stop)),
            _ => Err(METHOD_NOT_ALLOWED),
        }
    }

    fn pass_on(&self, command: Command) -> Answer {
        tracing::info!(?command, "from the live page");
        (self.on_command)(command);
        Answer::Done
    }

    /// Returns whether a browser can have reached this server under the name `host`. On loopback no
    /// other name counts, because any site can give its own name this machine's address. Elsewhere
    /// the token protects.
    fn is_own_host(&self, host: &str) -> bool {
        let local = format!("localhost:{}", self.address.port());
        !self.address.ip().is_loopback() || host == self.address.to_string() || host == local
    }

    /// Sends every message, until the viewer leaves or takes none for [`WRITE_TIMEOUT`].
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

async fn respond(stream: &mut TcpStream, status: &str, kind: &str, text: &str) -> Option<()> {
    let length = text.len();
    let response = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{FIELDS}\r\n{text}"
    );
    write(stream, response.as_bytes()).await?;
    timeout(WRITE_TIMEOUT, stream.shutdown()).await.ok()?.ok()
}

/// Writes `bytes`. Returns `None` if the client has left or does not take them in time.
async fn write(stream: &mut TcpStream, bytes: &[u8]) -> Option<()> {
    let written = timeout(WRITE_TIMEOUT, stream.write_all(bytes)).await;
    written.ok()?.ok()
}
