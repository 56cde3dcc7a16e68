//! Interface between the pure core and its environment.

use std::sync::Arc;

use neuro_ros::{AcquisitionInfo, NeuroEvent, NeuroFrame};

use crate::decoder::audit::AuditedWindow;
use crate::decoder::packed::TimedPackedBlock;
use crate::decoder::reconstruction::TimedCode;
use crate::device::Device;

/// Actions that [`Core`](crate::Core) requests from its environment. No method may block. The default
/// of each action but `send` does nothing, for an environment without that output.
pub trait Effects {
    /// Queues a complete frame for the device.
    fn send(&mut self, frame: &[u8]);

    /// Announces the device that sends the following codes. Called again when another compatible
    /// device connects, when the mains frequency changes, or when the reconstruction is made from codes instead of
    /// packed blocks, because the device refused those.
    fn announce(&mut self, _announcement: &Announcement) {}

    /// Publishes a frame on `/encoded`.
    fn publish_encoded(&mut self, _frame: &NeuroFrame) {}

    /// Returns how many fillers can be published on `/encoded` at once. The rest of a longer gap is
    /// counted and not filled. The default, 68 minutes of codes, is for an output without a queue.
    fn max_fillers(&self) -> u64 {
        65_536
    }

    /// Decodes a code to electrode signals in microvolts and publishes them on
    /// `/neurodata_reconstructed`. Called only if the announcement is
    /// [`decodable`](Announcement::decodable).
    fn decode(&mut self, _window: TimedCode) {}

    /// Decodes a packed block as [`Self::decode`] does a code. A device whose packed blocks arrive has its
    /// signals reconstructed from them, and none from codes.
    fn decode_block(&mut self, _block: TimedPackedBlock) {}

    /// Publishes the signals of the newest packed block, if they wait for the next one: none follows.
    fn finish_blocks(&mut self) {}

    /// Publishes a frame of ADC samples on `/neurodata`.
    fn publish_raw(&mut self, _frame: &NeuroFrame) {}

    /// Publishes a frame of filtered steps on `/neurodata_corticode`.
    fn publish_filtered(&mut self, _frame: &NeuroFrame) {}

    /// Publishes an edge of the trigger input on `/events/bus`.
    fn publish_event(&mut self, _event: &NeuroEvent) {}

    /// Compares the device's code with the float network's code for the same window. Called only if
    /// the announcement is [`decodable`](Announcement::decodable).
    fn audit(&mut self, _window: AuditedWindow) {}
}

/// A device that has introduced itself, with the description for `/acquisition/get_info`.
#[derive(Clone, Debug)]
pub struct Announcement {
    /// Answer to `/acquisition/get_info`; `None` if the selected stream is not published.
    pub info: Option<AcquisitionInfo>,
    /// Scales, rates and labels of the device's codes.
    pub device: Arc<Device>,
    /// Whether the bridge has the device's model, which is needed to decode and audit the codes.
    pub decodable: bool,
}
