//! Events with their device times, for the live page.

use neuro_ros::{NeuroEvent, Sink, Stamp};

/// `frame_id` of an event whose stamp is a device time.
const DEVICE: &str = "device";

/// Publishes events to the live page with device times as stamps, because the page's samples have
/// device times too. Events on the ROS topic have times of day as stamps, shifted so that a
/// recorder places the events correctly.
pub(crate) struct EventTimes<S> {
    sink: S,
    event: NeuroEvent,
}

impl<S: Sink<NeuroEvent>> EventTimes<S> {
    pub(crate) fn new(sink: S) -> EventTimes<S> {
        EventTimes { sink, event: NeuroEvent::default() }
    }

    /// Publishes an event with the device time `device_us`, in microseconds. If that is `None`, the
    /// stamp is zero and `frame_id` is empty.
    pub(crate) fn publish(&mut self, event: &NeuroEvent, device_us: Option<u64>) {
        if !self.sink.has_receivers() {
            return;
        }
        self.event.clone_from(event);
        let header = &mut self.event.header;
        header.stamp = Stamp::default();
        header.frame_id.clear();
        if let Some(us) = device_us {
            let ns = i64::try_from(us).unwrap_or(i64::MAX).saturating_mul(1000);
            header.stamp = Stamp::from_nanoseconds(ns);
            header.frame_id.push_str(DEVICE);
        }
        // The page's sinks never fail.
        let _ = self.sink.publish(&self.event);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use neuro_ros::SinkError;

    use super::*;

    /// Sink that collects all events.
    #[derive(Clone, Default)]
    struct All(Arc<Mutex<Vec<NeuroEvent>>>);

    impl Sink<NeuroEvent> for All {
        fn publish(&mut self, event: &NeuroEvent) -> Result<(), SinkError> {
            self.0.lock().unwrap().push(event.clone());
            Ok(())
        }

        fn dropped(&self) -> u64 {
            0
        }

        fn has_receivers(&self) -> bool {
            true
        }
    }

    #[test]
    fn an_event_has_its_device_time_or_none() {
        let all = All::default();
        let mut sink = EventTimes::new(all.clone());
        let mut event = NeuroEvent::on_bus();
        event.header.stamp = Stamp::from_nanoseconds(1_700_000_000_000_000_000);
        event.event = 1;
        sink.publish(&event, Some(3_000_002));
        sink.publish(&event, None);
        let events = all.0.lock().unwrap();
        let [placed, unplaced] = &events[..] else {
            panic!("{events:?}");
        };
        assert_eq!(placed.header.stamp, Stamp::from_nanoseconds(3_000_002_000));
        assert_eq!(placed.header.frame_id, DEVICE);
        assert!(unplaced.header.stamp.is_unset() && unplaced.header.frame_id.is_empty());
        assert_eq!([placed.event, unplaced.event], [1, 1]);
    }
}
