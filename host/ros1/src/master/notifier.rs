//! Notifies nodes of changes by XML-RPC: one call at a time per node, in order. A notice that has
//! not been sent yet is replaced by a newer one about the same subject.

use std::{
    collections::{HashMap, VecDeque},
    sync::{Arc, Mutex},
};

use crate::{
    sync::lock,
    xmlrpc::{Value, call_ros},
};

/// Caller ID that the master uses in its calls to nodes.
const MASTER: &str = "/master";

#[derive(Debug)]
struct Notice {
    method: &'static str,
    /// Name of the topic, parameter or node that the notice is about.
    subject: String,
    arguments: Vec<Value>,
}

/// Queues of notices, keyed by the XML-RPC URI of the node. A queue exists only while a task
/// delivers its notices.
#[derive(Debug, Default)]
pub(super) struct Notifier {
    waiting: Arc<Mutex<HashMap<String, VecDeque<Notice>>>>,
}

impl Notifier {
    /// Queues a call of `method` to the node at the XML-RPC URI `api`, without waiting. Replaces a
    /// waiting call of the same method about the same subject, so a queue holds at most one call
    /// per method and subject.
    pub(super) fn notify(
        &self,
        api: &str,
        method: &'static str,
        subject: &str,
        arguments: impl IntoIterator<Item = Value>,
    ) {
        let notice = Notice {
            method,
            subject: subject.to_owned(),
            arguments: std::iter::once(MASTER.into()).chain(arguments).collect(),
        };
        let mut waiting = lock(&self.waiting);
        if let Some(queue) = waiting.get_mut(api) {
            let same =
                |old: &&mut Notice| old.method == notice.method && old.subject == notice.subject;
            match queue.iter_mut().find(same) {
                Some(old) => *old = notice,
                None => queue.push_back(notice),
            }
            return;
        }
        waiting.insert(api.to_owned(), VecDeque::from([notice]));
        tokio::spawn(deliver(Arc::clone(&self.waiting), api.to_owned()));
    }

    /// Asks the node at `api`, if any, to shut down, because another node has registered under the
    /// name `node`.
    pub(super) fn notify_displaced(&self, api: Option<String>, node: &str) {
        if let Some(api) = api {
            let reason = format!("[{node}] Reason: new node registered with same name");
            self.notify(&api, "shutdown", node, [reason.into()]);
        }
    }
}

async fn deliver(waiting: Arc<Mutex<HashMap<String, VecDeque<Notice>>>>, api: String) {
    loop {
        let notice = {
            let mut waiting = lock(&waiting);
            let next = waiting.get_mut(&api).and_then(VecDeque::pop_front);
            if next.is_none() {
                waiting.remove(&api);
            }
            next
        };
        let Some(notice) = notice else { return };
        if let Err(error) = call_ros(&api, notice.method, &notice.arguments).await {
            tracing::debug!(api, notice.method, %error, "a node could not be notified");
        }
    }
}
