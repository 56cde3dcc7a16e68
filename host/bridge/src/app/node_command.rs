//! What other nodes ask the bridge for.

use neuro_ros::AcquisitionCommand;

/// A request from the ROS graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NodeCommand {
    /// A call of `~start`, `~stop` or `~quit`.
    Acquisition(AcquisitionCommand),
    /// A message on `~packed_rate`: the rate that the packed code is to have.
    PackedRate(u8),
}
