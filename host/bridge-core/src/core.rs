//! The core of the bridge: frame decoder and session. It performs no I/O itself.

use std::sync::Arc;
use std::time::Duration;

use artifact::classifier::Classifier;
use link::{Counters, Decoder, Frame, MAX_FRAME, Streams, ToHost};
use neuro_ros::{AcquisitionInfo, DiagnosticArray, NeuroEvent, NeuroFrame, NeuroOutput, TriWords};

use crate::decoder::audit::AuditedWindow;
use crate::decoder::model::Model;
use crate::decoder::packed::TimedPackedBlock;
use crate::decoder::reconstruction::TimedCode;
use crate::device::Device;
use crate::exclusion::Exclusions;
use crate::impedance::ImpedanceReport;
use crate::query::report::SelfTestReport;
use crate::session::Session;
use crate::session::diagnosis::{diagnose, electrode_faults};
use crate::session::summary::Summary;
use crate::settings::Settings;
use crate::time::HostTime;
use crate::wire::upload::Upload;
use crate::wire::words;

/// The core of the bridge: receives bytes and times, and requests [`Effects`].
///
/// `Core` reads no clock and no port, so tests can reproduce every fault of a link exactly.
#[derive(Debug)]
pub struct Core {
    decoder: Decoder<MAX_FRAME>,
    session: Session,
}

impl Core {
    /// Time between two calls of [`Core::tick`].
    pub const TICK: Duration = Duration::from_millis(100);
    /// Number of ticks between two calls of [`Core::diagnostics`]: one report per second.
    pub const TICKS_PER_REPORT: u32 = 10;
    /// Time between two attempts to open a port. Several attempts fit into the 1 s within which a
    /// replugged device must be connected again.
    pub const REOPEN_AFTER: Duration = Duration::from_millis(250);
    /// Time without a frame after which a serial port is reopened. A board sends `Stats` every
    /// second and stores at most 4 s of frames, so after a longer time either the board or its port
    /// has stopped.
    pub const TTY_SILENCE_LIMIT: Duration = Duration::from_secs(5);
    /// Time without a frame after which a TCP connection is reopened. TCP itself detects a broken
    /// connection earlier. An intact connection to a suspended device may hold bytes, which
    /// reopening would lose.
    pub const TCP_SILENCE_LIMIT: Duration = Duration::from_mins(1);

    /// Creates a core without a connection. Without a model, codes are published but not decoded.
    pub fn new(settings: Settings, model: Option<Arc<Model>>) -> Core {
        Core { decoder: Decoder::new(), session: Session::new(settings, model) }
    }

    /// Records that a port was opened at `now`, and sends the first command.
    pub fn connected(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.decoder.reset();
        self.session.connected(now, effects);
    }

    /// Records that the port was closed or lost. The core keeps the state and counts of its streams
    /// for a reconnection.
    pub fn disconnected(&mut self) {
        self.session.disconnected();
    }

    /// Handles bytes that were read from the port at the time `read`, and sends the next command if
    /// one is due.
    pub fn receive(&mut self, bytes: &[u8], read: HostTime, effects: &mut dyn Effects) {
        self.handle(bytes, read, effects);
        self.session.tick(read, effects);
    }

    /// Handles bytes that were read from the port at the time `read`, but unlike [`Core::receive`]
    /// sends no command.
    pub fn handle(&mut self, mut bytes: &[u8], read: HostTime, effects: &mut dyn Effects) {
        while let Some(outcome) = self.decoder.next::<ToHost>(&mut bytes) {
            match outcome {
                Ok(frame) => {
                    effects.received(&frame);
                    self.session.handle_frame(&frame, read, effects);
                }
                Err(error) => self.session.handle_error(error, read),
            }
        }
    }

    /// Sends the next command if one is due. Call this at least every 100 ms.
    pub fn tick(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.session.tick(now, effects);
    }

    /// Sets whether the device should stream. The next [`Core::tick`] sends `Start` or `Stop`.
    pub fn set_streaming(&mut self, streaming: bool) {
        self.session.commands.set_streaming(streaming);
    }

    /// Sets the rate of the packed code, 0 (finest) to 15 (coarsest). The next [`Core::tick`] sends
    /// the command that sets it on the device.
    pub fn set_packed_rate(&mut self, rate: u8) {
        self.session.commands.set_rate(rate);
    }

    /// Sets the rate that the device's model uses for its packed code. Needed only if the core was
    /// created without this model.
    pub fn set_model_rate(&mut self, rate: u8) {
        self.session.set_model_rate(rate);
    }

    /// Sets the user's choice of electrodes to exclude. The core sends it to a device when the
    /// device has introduced itself, and again after a restart.
    pub fn set_exclusions(&mut self, exclusions: Exclusions) {
        self.session.set_exclusions(exclusions);
    }

    /// Returns the user's choice of electrodes to exclude.
    pub fn exclusions(&self) -> &Exclusions {
        &self.session.exclusions
    }

    /// Returns the labels of the device's electrodes; `None` before a device has introduced itself.
    pub fn electrodes(&self) -> Option<&[String]> {
        self.session.electrodes()
    }

    /// Returns the device's answer to [`Core::set_exclusions`], with the reason, worded for the
    /// user, if it refuses. `None` until it answers; it is asked only while a stream is wanted.
    pub fn exclusion_answer(&self) -> Option<Result<(), String>> {
        self.session.commands.exclusion_answer().map(words::answer)
    }

    /// Returns the device's answer to [`Core::set_packed_rate`], in the form of
    /// [`Core::exclusion_answer`].
    pub fn packed_rate_answer(&self) -> Option<Result<(), String>> {
        self.session.commands.rate_answer().map(words::answer)
    }

    /// Returns the streams that the device is asked for: the wanted streams less the refused ones.
    pub fn streams(&self) -> Streams {
        self.session.commands.streams()
    }

    /// Returns whether the user wants a stream and the core does not refuse the device.
    pub fn is_streaming_wanted(&self) -> bool {
        self.session.commands.wants_stream()
    }

    /// Returns whether the device streams, according to its acknowledgements.
    pub fn is_streaming(&self) -> bool {
        self.session.commands.is_streaming()
    }

    /// Asks a device that does not stream to test its converters. [`Core::take_self_test`] returns
    /// the result.
    ///
    /// # Errors
    ///
    /// The reason why the device cannot be asked, and what the user can do.
    pub fn start_self_test(&mut self) -> Result<(), &'static str> {
        self.session.start_self_test()
    }

    /// Removes and returns the result of a self-test, or the reason, worded for the user, why there
    /// is none; `None` while it is underway.
    pub fn take_self_test(&mut self) -> Option<Result<Box<SelfTestReport>, String>> {
        self.session.take_self_test()
    }

    /// Publishes an event at `now` with the user's `text`, and returns whether the bridge publishes
    /// events at all. A recording by `rosneuro_recorder` holds the event at the next row.
    pub fn mark(&mut self, text: &str, now: HostTime, effects: &mut dyn Effects) -> bool {
        self.session.mark(text, now, effects)
    }

    /// Converts the host time `now` to device time, microseconds, and to the wall-clock time that
    /// stamps use, nanoseconds since 1970. The device time comes from the fit of the clocks, so it
    /// is `None` before the first frame, and too small by as much as stamps are late, see
    /// [`Clock`](crate::Clock).
    pub fn times_at(&mut self, now: HostTime) -> (Option<i64>, i64) {
        self.session.times_at(now)
    }

    /// Sets the packed model to upload to every device that does not have it, before the device
    /// streams. The upload must belong to the model with which the core was created. A device
    /// without a slot for a model keeps its own model.
    pub fn set_upload(&mut self, upload: Upload) {
        self.session.upload = Some(upload);
    }

    /// Sets the classifier of the stream of features. The core sends the classifier's filters to a
    /// device when the device has introduced itself, and again after a restart.
    pub fn set_classifier(&mut self, classifier: Classifier) {
        self.session.set_classifier(classifier);
    }

    /// Asks every device to measure the impedance of the electrodes while it streams. Reports
    /// subtract `series_ohms`, the resistance in series with each electrode on the board.
    pub fn measure_impedance(&mut self, series_ohms: u32) {
        self.session.measure_impedance(series_ohms);
    }

    /// Does what [`Core::measure_impedance`] does, but asks for trigger edges as the only stream.
    /// At ADC rates below 500 Hz, a device measures impedance only if it streams no more than edges
    /// and raw samples.
    pub fn measure_impedance_alone(&mut self, series_ohms: u32) {
        self.session.commands.stream_events_alone();
        self.session.measure_impedance(series_ohms);
    }

    /// After [`Core::measure_impedance`], returns why the device refuses to measure impedance, and
    /// what the user can do; `None` if it has not refused.
    pub fn impedance_refusal(&self) -> Option<String> {
        self.session.commands.impedance_refusal().map(words::impedance_refusal)
    }

    /// Asks every device whether it accepts a packed model, and also a linear code if
    /// `with_linear`. A device that does not accept them is not started.
    pub fn require_slot(&mut self, with_linear: bool) {
        self.session.commands.require_slot(with_linear);
    }

    /// Returns whether the device has answered to [`Core::require_slot`] that it accepts no such
    /// model, because it lacks the memory or the code.
    pub fn lacks_slot(&self) -> bool {
        self.session.commands.lacks_slot()
    }

    /// Returns whether the user wants no stream and the device has confirmed that none is running.
    pub fn is_stopped(&self) -> bool {
        self.session.commands.is_stopped()
    }

    /// Returns whether the connected device has sent no frame for longer than `limit`, although the
    /// core pings it after 2 s without a frame. The caller should then reopen the port.
    pub fn is_unresponsive(&self, now: HostTime, limit: Duration) -> bool {
        let limit_us = i64::try_from(limit.as_micros()).unwrap_or(i64::MAX);
        let commands = &self.session.commands;
        commands.is_unresponsive(now.monotonic_us, limit_us)
    }

    /// Returns the frame decoder's counts of bytes, frames and errors.
    pub fn wire_counters(&self) -> &Counters {
        self.decoder.counters()
    }

    /// Returns the counts of received, lost and filled codes since the core was created.
    pub fn summary(&self) -> Summary {
        Summary::new(&self.session, self.decoder.counters())
    }

    /// Returns the reason, worded for the user, why the device's codes or decoded signals are not
    /// published; `None` if they are published.
    pub fn objection(&self) -> Option<&str> {
        self.session.objection()
    }

    /// Returns the electrodes that the device's newest report finds flat, at the rail or disturbed
    /// by mains, such as "flat: Fz; at the rail: C3 Cz". `None` if there are none, or if
    /// [`Core::diagnostics`] has already published the report.
    pub fn electrode_faults(&self) -> Option<String> {
        electrode_faults(&self.session)
    }

    /// Returns the report for `/diagnostics`. Call this once a second: only the first report after
    /// a loss warns of it.
    pub fn diagnostics(&mut self, now: HostTime) -> DiagnosticArray {
        diagnose(&mut self.session, self.decoder.counters(), now)
    }
}

/// Actions that [`Core`](crate::Core) requests from its environment. No method may block. By
/// default, all methods but `send` ignore the request.
pub trait Effects {
    /// Queues a complete frame, whose bytes go to the device unchanged.
    fn send(&mut self, frame: &[u8]);

    /// Reports how the stamps of the following frames and events relate to the host's time. Stamps
    /// of frames are `_offset_ns` nanoseconds larger than the host's monotonic time. Stamps of
    /// events are also `_event_shift_us` microseconds later than the events. Called before each
    /// message of the device is handled.
    fn note_stamps(&mut self, _offset_ns: i64, _event_shift_us: i64) {}

    /// Called with every frame from the device, before the core handles the frame.
    fn received(&mut self, _frame: &Frame<ToHost>) {}

    /// Announces the device that sends the following codes. Called again when another compatible
    /// device connects, when the mains frequency changes, or when the device refuses packed blocks
    /// and its signals are therefore decoded from codes.
    fn announce(&mut self, _announcement: &Announcement) {}

    /// Publishes the frame of a code, or of a filler, on `/encoded`.
    fn publish_encoded(&mut self, _frame: &NeuroFrame) {}

    /// Returns how many fillers can be published on `/encoded` at once. In a longer gap, only this
    /// number of codes is filled, and the rest is counted. The default, 68 minutes of codes, suits
    /// an output without a queue.
    fn max_fillers(&self) -> u64 {
        65_536
    }

    /// Decodes a code to electrode signals in microvolts and publishes them on
    /// `/neurodata_reconstructed`. Called only if the announced device is
    /// [`decodable`](Announcement::decodable).
    fn decode(&mut self, _window: TimedCode) {}

    /// Decodes a packed block to electrode signals and publishes them, as [`Self::decode`] does for
    /// a code. While a device sends packed blocks, its codes are not decoded.
    fn decode_block(&mut self, _block: TimedPackedBlock) {}

    /// Publishes the decoded frame of the newest packed block, if it still waits to be corrected by
    /// the next block. Called when no further block follows.
    fn finish_blocks(&mut self) {}

    /// Publishes a frame of ADC samples on `/neurodata`.
    fn publish_raw(&mut self, _frame: &NeuroFrame) {}

    /// Publishes a frame of filtered steps on `/neurodata_corticode`.
    fn publish_filtered(&mut self, _frame: &NeuroFrame) {}

    /// Publishes the prediction for a hop. `_words` are the status words of the hop.
    fn publish_prediction(&mut self, _prediction: &NeuroOutput, _words: TriWords) {}

    /// Publishes an event on `/events/bus`, such as an edge of the trigger input or a loss of data.
    fn publish_event(&mut self, _event: &NeuroEvent, _place: EventPlace) {}

    /// Publishes the impedance of the electrodes. While it is measured, this is about every second,
    /// or every two seconds at an ADC rate of 250 Hz.
    fn publish_impedance(&mut self, _report: &ImpedanceReport) {}

    /// Compares the device's code with the float network's code for the same window. Called only if
    /// the announced device is [`decodable`](Announcement::decodable).
    fn audit(&mut self, _window: AuditedWindow) {}
}

/// Where an event is among the published data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventPlace {
    /// Row of the announced stream at which a recording must have the event, counted from the first
    /// row published on the stream's topic; `None` before a device has introduced itself.
    /// [`RecordingStart`](crate::RecordingStart) turns the row into the stamp for a recorder.
    pub row: Option<u64>,
    /// Device time at which the event happened, microseconds; `None` if it is unknown. For a
    /// trigger edge, it is the time of the edge itself, which can lie between two ADC samples.
    pub device_us: Option<u64>,
}

/// Announcement of a device that has introduced itself, with the description that
/// `/acquisition/get_info` returns.
#[derive(Clone, Debug)]
pub struct Announcement {
    /// Answer to `/acquisition/get_info`; `None` if the stream that the user selected for recording
    /// is not published.
    pub info: Option<AcquisitionInfo>,
    /// The announced device, with scales, rates and labels of its codes.
    pub device: Arc<Device>,
    /// Whether the bridge has the device's model, which is needed to decode and audit the codes.
    pub decodable: bool,
}
