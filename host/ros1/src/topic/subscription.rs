//! A subscribed topic: its inbox and a link to each publisher.

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU32, Ordering::Relaxed},
    },
    time::Duration,
};

use tokio::{task::AbortHandle, time::sleep};

use super::{inbox::Inbox, publisher_link::PublisherLink};
use crate::lock::lock;

/// Delay before the first attempt to reconnect to a publisher; doubles after each further failure.
const FIRST_RETRY_DELAY: Duration = Duration::from_millis(100);
/// Longest delay before an attempt to reconnect to a publisher.
const MAX_RETRY_DELAY: Duration = Duration::from_secs(5);

/// One topic that the node subscribes to. Its links are keyed by the publishers' XML-RPC URIs.
#[derive(Debug)]
pub(crate) struct Subscription {
    pub(crate) inbox: Inbox,
    links: Mutex<HashMap<String, RunningLink>>,
    next_id: AtomicU32,
}

#[derive(Debug)]
struct RunningLink {
    link: Arc<PublisherLink>,
    task: AbortHandle,
}

impl Subscription {
    pub(crate) fn new(inbox: Inbox) -> Self {
        Self {
            inbox,
            links: Mutex::default(),
            next_id: AtomicU32::new(0),
        }
    }

    /// Returns the links to all publishers, whether connected or waiting to reconnect.
    pub(crate) fn links(&self) -> Vec<Arc<PublisherLink>> {
        lock(&self.links)
            .values()
            .map(|running| Arc::clone(&running.link))
            .collect()
    }

    /// Connects to those of `publishers` that have no link yet. Removes no link, because a
    /// restarted master lists only publishers that have registered again.
    pub(crate) fn add_publishers(self: &Arc<Self>, publishers: &[String]) {
        let mut links = lock(&self.links);
        for uri in publishers {
            if let Some(running) = links.get(uri) {
                running.link.mark_listed();
                continue;
            }
            let id = self.next_id.fetch_add(1, Relaxed);
            let link = Arc::new(PublisherLink::new(id, uri.clone()));
            let run = Arc::clone(self).run_link(Arc::clone(&link));
            let task = tokio::spawn(run).abort_handle();
            links.insert(uri.clone(), RunningLink { link, task });
        }
    }

    /// Replaces the list of publishers with the master's list. A publisher that is not in the list
    /// is not reconnected, but its open connection is kept until the publisher closes it.
    pub(crate) fn set_publishers(self: &Arc<Self>, publishers: &[String]) {
        lock(&self.links).retain(|uri, running| {
            if publishers.contains(uri) {
                return true;
            }
            running.link.mark_unlisted();
            if running.link.is_connected() {
                return true;
            }
            running.task.abort();
            false
        });
        self.add_publishers(publishers);
    }

    /// Closes the connections to all publishers. Messages already received stay in the inbox.
    pub(crate) fn close(&self) {
        for (_, running) in lock(&self.links).drain() {
            running.task.abort();
        }
        self.inbox.close();
    }

    /// Receives from one publisher and reconnects after failures. Ends when the inbox closes or the
    /// master no longer lists the publisher.
    async fn run_link(self: Arc<Self>, link: Arc<PublisherLink>) {
        let mut delay = FIRST_RETRY_DELAY;
        loop {
            let messages_before = link.messages.load(Relaxed);
            let (topic, publisher) = (&self.inbox.topic, link.uri());
            match link.receive(&self.inbox).await {
                Ok(()) => return,
                Err(error) if error.is_refusal() => {
                    tracing::warn!(topic, publisher, "{error}");
                }
                Err(error) => tracing::debug!(topic, publisher, "{error}"),
            }
            if self.remove_if_unlisted(&link) {
                return;
            }
            if link.messages.load(Relaxed) != messages_before {
                delay = FIRST_RETRY_DELAY;
            }
            tokio::select! {
                () = sleep(delay) => delay = (delay * 2).min(MAX_RETRY_DELAY),
                // The master has listed the publisher again: reconnect without further delay.
                () = link.retry_requested() => {}
            }
        }
    }

    /// Removes the link to a publisher without an open connection, unless the master lists that
    /// publisher. Returns whether the link was removed.
    fn remove_if_unlisted(&self, link: &PublisherLink) -> bool {
        let mut links = lock(&self.links);
        let listed = link.is_listed();
        if !listed {
            links.remove(link.uri());
        }
        !listed
    }
}
