//! Tells nodes what changed: one message at a time per node, in order, and the newest wins.

use std::{
    collections::{HashMap, VecDeque},
    sync::{Arc, Mutex},
};

use crate::{
    lock::lock,
    xmlrpc::{Value, call_ros},
};

/// One call to one node.
#[derive(Debug)]
pub(super) struct Notice {
    pub(super) method: &'static str,
    /// The topic or parameter: a later notice about the same replaces one that still waits.
    pub(super) subject: String,
    pub(super) arguments: Vec<Value>,
}

/// The notices that wait, by the URI of their node. A node is in the map while a task is
/// delivering to it.
#[derive(Debug, Default)]
pub(super) struct Notifier {
    waiting: Arc<Mutex<HashMap<String, VecDeque<Notice>>>>,
}

impl Notifier {
    /// Queues a notice; never waits. The queue cannot grow beyond one notice per subject.
    pub(super) fn notify(&self, api: &str, notice: Notice) {
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
            tracing::debug!(api, notice.method, %error, "a node could not be told");
        }
    }
}
