//! A subscriber that notes the time at which each code arrives.

use std::time::{Duration, Instant};

use anyhow::ensure;
use link::Flags;
use neuro_ros::{NeuroFrame, RosMessage, Wire};
use ros1::Node;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};

use super::figures::{SharedTimes, Times};

/// Largest number of received messages that wait for the subscriber.
const QUEUE: usize = 256;

/// Subscription to a topic with `NeuroFrame` messages, until it is dropped.
#[derive(Debug)]
pub(super) struct Subscriber {
    topic: &'static str,
    arrived: SharedTimes,
    task: JoinHandle<()>,
}

impl Subscriber {
    /// Subscribes to `topic` and notes the arrival time of each code.
    ///
    /// # Errors
    /// The ROS node `node` has shut down.
    pub(super) async fn start(node: &Node, topic: &'static str) -> anyhow::Result<Self> {
        let mut subscription = node.subscribe(topic, NeuroFrame::TYPE, QUEUE).await?;
        let arrived = SharedTimes::default();
        let times = arrived.clone();
        let task = tokio::spawn(async move {
            while let Some(body) = subscription.recv().await {
                let now = Instant::now();
                let window = NeuroFrame::from_bytes(&body).ok();
                if let Some(window) = window.and_then(|frame| window_of(&frame)) {
                    times.note(window, now);
                }
            }
        });
        Ok(Self { topic, arrived, task })
    }

    /// Waits until at least one code has arrived.
    ///
    /// # Errors
    /// No code arrives within `limit`.
    pub(super) async fn wait_for_code(&self, limit: Duration) -> anyhow::Result<()> {
        let arrived = async {
            while self.times().is_empty() {
                sleep(Duration::from_millis(10)).await;
            }
        };
        let arrived = timeout(limit, arrived).await.is_ok();
        ensure!(
            arrived,
            "no code came on {} within {} s\n  next: is the machine very busy? repeat",
            self.topic,
            limit.as_secs()
        );
        Ok(())
    }

    /// Returns the arrival times of the codes so far, without fillers.
    pub(super) fn times(&self) -> Times {
        self.arrived.so_far()
    }
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// Returns the index of the window from a frame's status words; `None` for a filler.
fn window_of(frame: &NeuroFrame) -> Option<u64> {
    let word = |label: &str| {
        let place = frame.tri.info.labels.iter().position(|name| name == label)?;
        u64::try_from(*frame.tri.data.get(place)?).ok()
    };
    let is_filler = word("flags")? & u64::from(Flags::FILLER.bits()) != 0;
    (!is_filler).then_some(word("seq_lo")? | word("seq_hi")? << 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_has_two_words_and_a_filler_has_none() {
        let mut frame = NeuroFrame::default();
        assert_eq!(window_of(&frame), None);
        frame.tri.info.labels = ["flags", "seq_lo", "seq_hi"].map(str::to_owned).to_vec();
        frame.tri.data = vec![1, 5, 2];
        assert_eq!(window_of(&frame), Some(5 + 2 * 65_536));
        frame.tri.data[0] = i32::from(Flags::FILLER.bits());
        assert_eq!(window_of(&frame), None);
    }
}
