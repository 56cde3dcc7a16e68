//! A live page: the frames and diagnostics of a bridge in a browser.
//!
//! ```text
//! publish ──► ViewSink ──► ring of 512 messages ─┬─► HTTP response of viewer 1 ──► page
//!                          (never waits)         └─► HTTP response of viewer 2 ──► page
//! ```
//!
//! A thread of its own serves the page over HTTP. Published messages go into a ring, from which
//! each viewer receives every message. A slow viewer loses the oldest messages, which are counted;
//! nobody waits for it. Messages are encoded only while somebody views.
//!
//! ```
//! use neuro_ros::{NeuroFrame, Sink};
//! use view::{View, ViewTopic};
//!
//! let view = View::start("127.0.0.1:0".parse()?, None, |_command, reply| reply.done("done"))?;
//! let mut sink = view.sink(ViewTopic::Filtered);
//! sink.publish(&NeuroFrame::default())?;
//! assert!(view.url().starts_with("http://127.0.0.1:"));
//! assert_eq!((view.viewers(), view.dropped()), (0, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod command;
mod feed;
mod files;
mod request;
mod server;
mod token;

use std::io;
use std::net::SocketAddr;

use neuro_ros::Wire;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

pub use crate::command::{Answer, Command, Decision, MAX_MARKER, Reply};
use crate::feed::Feed;
pub use crate::feed::{ViewSink, ViewTopic};
pub use crate::request::{Refusal, Request};
use crate::server::Server;
pub use crate::token::{Token, TokenError};

/// The live page, served until this value is dropped.
#[derive(Debug)]
pub struct View {
    feed: Feed,
    url: String,
    /// Dropped to end the thread that serves the page.
    _stop: oneshot::Sender<()>,
}

impl View {
    /// Serves the page at `address` in a new thread. Without a `token`, a random one is used, and
    /// is a part of [`View::url`]. `on_command` is called for each command of a user who has the
    /// token. It must not block; the [`Reply`] can be sent later, within 30 s.
    ///
    /// # Errors
    ///
    /// The operating system's error if the port cannot be opened or no thread can be started.
    pub fn start(
        address: SocketAddr,
        token: Option<Token>,
        on_command: impl Fn(Command, Reply) + Send + Sync + 'static,
    ) -> io::Result<View> {
        let listener = std::net::TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let (token, end) = if let Some(token) = token {
            (token, String::new())
        } else {
            let token = Token::random()?;
            let end = format!("#token={}", token.as_str());
            (token, end)
        };
        let url = format!("http://{address}/{end}");
        let feed = Feed::default();
        let server = Server::new(address, token, feed.clone(), on_command);
        let (stop, stopped) = oneshot::channel();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        std::thread::Builder::new().name("view".to_owned()).spawn(move || {
            runtime.block_on(async move {
                match TcpListener::from_std(listener) {
                    Ok(listener) => tokio::select! {
                        () = server.serve(listener) => {}
                        // An error means that the `View` was dropped.
                        _ = stopped => {}
                    },
                    Err(error) => tracing::error!(%error, "the live page is not served"),
                }
            });
        })?;
        Ok(View { feed, url, _stop: stop })
    }

    /// Creates a sink for the messages of one topic.
    pub fn sink<M: Wire>(&self, topic: ViewTopic) -> ViewSink<M> {
        ViewSink::new(self.feed.clone(), topic)
    }

    /// Returns the page's address. A random token is in the part after `#`, which a browser does
    /// not send to any server.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Returns how many pages receive messages at present.
    pub fn viewers(&self) -> usize {
        self.feed.viewers()
    }

    /// Returns how many messages were dropped for slow viewers, over all viewers.
    pub fn dropped(&self) -> u64 {
        self.feed.dropped()
    }
}
