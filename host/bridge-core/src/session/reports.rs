//! Events on the bus that tell a recording about its data.

use link::Streams;

use crate::diagnostics::converters::ChainReport;
use crate::effects::Effects;
use crate::session::state::Session;
use crate::settings::AnnouncedStream;
use crate::streams::bus::BusEvent;
use crate::streams::code::CodeStream;
use crate::streams::packed::PackedStream;
use crate::streams::sample::SampleStream;
use crate::time::host_time::HostTime;

impl Session {
    /// Publishes an event for a stretch of data that is missing in the announced stream. A recorder
    /// records this stream, and each stream loses data of its own.
    pub(super) fn report_missing(&mut self, read: HostTime, effects: &mut dyn Effects) {
        let [codes, packed, raw, filtered] = [
            self.codes.as_mut().and_then(CodeStream::take_missing),
            self.packed.as_mut().and_then(PackedStream::take_missing),
            self.side.raw.as_mut().and_then(SampleStream::take_missing),
            self.side
                .filtered
                .as_mut()
                .and_then(SampleStream::take_missing),
        ];
        let from_packed = self.commands.streams().contains(Streams::PACKED);
        let missing = match self.settings.announced {
            AnnouncedStream::Reconstructed if from_packed => packed,
            AnnouncedStream::Encoded | AnnouncedStream::Reconstructed => codes,
            AnnouncedStream::Raw => raw,
            AnnouncedStream::Filtered => filtered,
        };
        let Some(missing) = missing else { return };
        let event = if missing.restarted {
            BusEvent::DeviceRestarted(missing.seconds)
        } else {
            BusEvent::DataLost(missing.seconds)
        };
        let wall_ns = self.clock.wall_ns(missing.start_us).unwrap_or(read.wall_ns);
        self.side.bus.publish(&event, wall_ns, effects);
    }

    /// Publishes an event if the device's new report shows other electrodes without contact than the
    /// report `before`. `device_us` is the time of the new report.
    pub(super) fn report_electrodes(
        &mut self,
        before: Option<&ChainReport>,
        device_us: u64,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        let (Some(report), Some(codes)) = (&self.converters, &self.codes) else {
            return;
        };
        let labels = &codes.device().labels;
        let was_off = before
            .map(|before| before.electrodes_off(labels))
            .unwrap_or_default();
        let off = report.electrodes_off(labels);
        let event = if off == was_off {
            return;
        } else if off.is_empty() {
            BusEvent::ElectrodesOn
        } else {
            BusEvent::ElectrodesOff(off)
        };
        let wall_ns = self.clock.wall_ns(device_us.into()).unwrap_or(read.wall_ns);
        self.side.bus.publish(&event, wall_ns, effects);
    }

    /// Publishes an event for a device that is refused in the place of one whose codes were published.
    pub(super) fn report_refusal(&mut self, why: &str, read: HostTime, effects: &mut dyn Effects) {
        if self.announced.is_some() {
            let event = BusEvent::DeviceRefused(why.to_owned());
            self.side.bus.publish(&event, read.wall_ns, effects);
        }
    }
}
