//! What the core asks of the world.

use std::sync::Arc;

use neuro_ros::{AcquisitionInfo, NeuroEvent, NeuroFrame};

use crate::decoder::audit::AuditedWindow;
use crate::decoder::reconstruction::TimedCode;
use crate::device::Device;

/// What the core asks of the world. None of these may wait.
pub trait Effects {
    /// Bytes for the device.
    fn send(&mut self, frame: &[u8]);

    /// A device is known, and from here on codes are its. Called again when it is another one of
    /// the same shape, or the same with other mains.
    fn announce(&mut self, announcement: &Announcement);

    /// A frame of `/encoded`.
    fn publish_encoded(&mut self, frame: &NeuroFrame);

    /// A window for the decoder; called only if the announcement says that the model fits.
    fn decode(&mut self, window: TimedCode);

    /// A frame of `/neurodata`.
    fn publish_raw(&mut self, frame: &NeuroFrame);

    /// A frame of `/neurodata_filtered`.
    fn publish_filtered(&mut self, frame: &NeuroFrame);

    /// An event of `/events/bus`.
    fn publish_event(&mut self, event: &NeuroEvent);

    /// A window for the float encoder; comes only if the announcement says that the model fits.
    fn audit(&mut self, window: AuditedWindow);
}

/// A device that is known.
#[derive(Clone, Debug)]
pub struct Announcement {
    /// For `/acquisition/get_info`; none if what shall be announced is not published.
    pub info: Option<AcquisitionInfo>,
    /// What the codes mean.
    pub device: Arc<Device>,
    /// Whether the model fits the device's codes.
    pub decodable: bool,
}
