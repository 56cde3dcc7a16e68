//! Interface between the pure core and its environment.

use std::sync::Arc;

use neuro_ros::{AcquisitionInfo, NeuroEvent, NeuroFrame};

use crate::decoder::audit::AuditedWindow;
use crate::decoder::reconstruction::TimedCode;
use crate::device::Device;

/// Actions that [`Core`](crate::Core) requests from its environment. No method may block.
pub trait Effects {
    /// Queues a complete frame for the device.
    fn send(&mut self, frame: &[u8]);

    /// Announces the device that the following codes belong to. Called again for another device of
    /// the same shape, or when the mains frequency changes.
    fn announce(&mut self, announcement: &Announcement);

    /// Publishes a frame on `/encoded`.
    fn publish_encoded(&mut self, frame: &NeuroFrame);

    /// Decodes a code to microvolts and publishes it on `/neurodata_reconstructed`. Called only if
    /// the announcement is [`decodable`](Announcement::decodable).
    fn decode(&mut self, window: TimedCode);

    /// Publishes a frame of ADC samples on `/neurodata`.
    fn publish_raw(&mut self, frame: &NeuroFrame);

    /// Publishes a frame of filtered steps on `/neurodata_filtered`.
    fn publish_filtered(&mut self, frame: &NeuroFrame);

    /// Publishes an edge of the trigger input on `/events/bus`.
    fn publish_event(&mut self, event: &NeuroEvent);

    /// Compares the device's code of a window with the float network's. Called only if the
    /// announcement is [`decodable`](Announcement::decodable).
    fn audit(&mut self, window: AuditedWindow);
}

/// An introduced device, and what is announced of it.
#[derive(Clone, Debug)]
pub struct Announcement {
    /// Answer of `/acquisition/get_info`; `None` if the stream to announce is not published.
    pub info: Option<AcquisitionInfo>,
    /// Scales, rates and labels of the device's codes.
    pub device: Arc<Device>,
    /// Whether the bridge has the device's model, so that codes can be decoded and audited.
    pub decodable: bool,
}
