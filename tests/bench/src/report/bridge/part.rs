//! One part of the run: figures of both nodes over the same time.

use picture::intervals::{Intervals, Series};
use serde_json::{Value as Json, json};

use super::node_figures::Figures;

/// Figures of both nodes over the same time.
#[derive(Debug)]
pub(super) struct Part {
    /// What was subscribed to.
    pub(super) name: &'static str,
    pub(super) bridge: Figures,
    /// `None` where rospy is not installed.
    pub(super) rospy: Option<Figures>,
}

impl Part {
    /// Returns the figures of both nodes as objects with the nodes' names.
    pub(super) fn nodes(&self) -> impl Iterator<Item = Json> {
        let nodes = [
            ("bridge", Some(&self.bridge)),
            ("rospy", self.rospy.as_ref()),
        ];
        nodes.into_iter().filter_map(|(node, figures)| {
            let mut object = json!(figures?);
            object["name"] = format!("{node}: {}", self.name).into();
            Some(object)
        })
    }

    /// Returns the histogram of the intervals of both nodes.
    pub(super) fn intervals(&self) -> Intervals {
        let series = |name: &str, ms: &[f64]| Series {
            name: name.to_owned(),
            ms: ms.to_owned(),
        };
        let rospy = self.rospy.as_ref();
        Intervals {
            arrival: series("through the bridge", &self.bridge.intervals_ms),
            source: series("sent to the bridge", &self.bridge.sent_intervals_ms),
            rival: rospy.map(|rospy| series("through rospy", &rospy.intervals_ms)),
            subtitle: format!(
                "{} codes from host-sim to a subscriber, all on this machine",
                self.bridge.codes
            ),
        }
    }
}
