//! The streaming bridge: connects the state machine [`Core`] to the port, to ROS and to the clock.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use artifact::{Artifact, Mode};
use bridge_core::{
    AnnouncedStream, Core, EventStamps, Exclusions, HostTime, Model, Settings, Summary, Upload,
};
use link::Streams;
use lsl::{Library, Lsl};
use neuro_ros::ros1::{Node, NodeError, NodeOptions};
use neuro_ros::{
    AcquisitionCommand, AcquisitionInfo, GET_INFO_SERVICE, Log, NdjsonWriter, SinkError,
};
use tokio::sync::{mpsc, watch};
use view::View;

use crate::app::browser;
use crate::app::classifying::Classifying;
use crate::app::command_line::{Options, SinkKind, ViewOptions};
use crate::app::driver::{DRAIN_TIMEOUT, Driver};
use crate::app::live_recording::LiveRecording;
use crate::app::outlet::OutletCount;
use crate::app::outlets::Outlets;
use crate::app::page_commands::PageCommands;
use crate::app::recorders::Recorders;
use crate::app::ros_node::{Namespace, NodeCommand, RosNode};
use crate::app::ros2_outlet::Ros2Outlet;
use crate::app::rosout;
use crate::app::shutdown::Shutdown;
use crate::app::sinks::{Destinations, RosOutlet, Sinks};
use crate::app::whole_lines::WholeLines;
use crate::error::BridgeError;
use crate::realtime;
use crate::wire::connection::{Connection, Event, Feed};

/// Time limit for writing queued JSON lines after the device has disconnected. It is long, because
/// no user waits for the program then.
const END_TIMEOUT: Duration = Duration::from_mins(1);

/// Configuration of a program that publishes the streams of a device.
#[derive(Clone, Debug)]
pub struct Publication {
    /// Settings of the state machine [`Core`], such as which streams to publish.
    pub settings: Settings,
    /// Folder of the model with which codes are decoded; `None` for the built-in model.
    pub model: Option<PathBuf>,
    /// Folder of a model to upload to the device; the bridge decodes codes with this model instead
    /// of `model`. `None` uploads nothing.
    pub upload_model: Option<PathBuf>,
    /// Options of the ROS node, such as its name and the address of its master.
    pub ros: NodeOptions,
    /// Prefix of the names of topics and services. It extends the node's namespace, but a prefix
    /// that starts with a slash replaces the namespace.
    pub topic_prefix: String,
    /// Name of the service that tells recorders and other subscribers the shape and rate of frames.
    pub get_info: &'static str,
    /// Electrodes that the user excludes, and whether the device excludes bad ones by itself.
    pub exclusions: Exclusions,
    /// Resistance on the board in series with each electrode, in ohms, if the device shall measure
    /// the electrodes' impedance; `None` if it shall not.
    pub impedance: Option<u32>,
    /// Classifier that decides from the device's features, and the topic of its predictions.
    pub classifying: Option<Classifying>,
    /// Whether the program ends when a device that has sent frames disconnects.
    pub exit_at_end: bool,
    /// Whether to ask for real-time scheduling.
    pub realtime: bool,
    /// Folder for what the user of the live page records.
    pub record_dir: PathBuf,
}

impl Publication {
    /// Reads the model that decodes codes. Also returns the bytes to upload to the device, if any.
    fn model(&self) -> Result<(Arc<Model>, Option<Upload>), BridgeError> {
        let Some(folder) = &self.upload_model else {
            let model = Model::read(self.model.as_deref());
            return Ok((Arc::new(model.map_err(BridgeError::Model)?), None));
        };
        let artifact = Artifact::read(folder).map_err(BridgeError::Model)?;
        let is_packed = self.settings.streams.contains(Streams::PACKED);
        if artifact.description.mode != Mode::Pca && !is_packed {
            tracing::warn!(
                "the person's model has no effect: it has no numbers for codes, and packed is not among the \
                 streams; fit one with `corticode-bridge calibrate --numbers`, or stream packed"
            );
        }
        let model = Model::new(&artifact).map_err(BridgeError::Model)?;
        let bytes = model_gen::upload(&artifact).map_err(BridgeError::Upload)?;
        let bytes = bytes.ok_or_else(|| BridgeError::NothingToUpload(folder.clone()))?;
        let upload = Upload::new(model.id(), bytes.into());
        Ok((Arc::new(model), Some(upload)))
    }

    /// Returns the settings. If they set no rate of the packed code, the model's rate is filled in.
    ///
    /// # Errors
    ///
    /// [`BridgeError::AnnouncedNotStreamed`] if the announced stream is not among the streams, and
    /// [`BridgeError::NoClassifier`] if features are streamed without a classifier.
    fn settings(&self, model: &Model) -> Result<Settings, BridgeError> {
        let settings = self.settings;
        // Features alone have no frames, and so no stream to announce.
        let has_frames =
            (AnnouncedStream::TOPICS.iter()).any(|(_, stream)| stream.is_in(settings.streams));
        if has_frames && !settings.announced.is_in(settings.streams) {
            return Err(BridgeError::AnnouncedNotStreamed);
        }
        if settings.streams.contains(Streams::FEATURES) && self.classifying.is_none() {
            return Err(BridgeError::NoClassifier);
        }
        let of_model = || model.packed().map(|packed| packed.description.rate);
        Ok(Settings { packed_rate: settings.packed_rate.or_else(of_model), ..settings })
    }

    /// Returns the core with the user's exclusions, impedance measurement, upload and classifier.
    fn core(&self, settings: Settings, model: &Arc<Model>, upload: Option<Upload>) -> Core {
        let mut core = Core::new(settings, Some(Arc::clone(model)));
        core.set_exclusions(self.exclusions.clone());
        if let Some(series_ohms) = self.impedance {
            core.measure_impedance(series_ohms);
        }
        if let Some(upload) = upload {
            core.set_upload(upload);
        }
        if let Some(Classifying { classifier, .. }) = &self.classifying {
            core.set_classifier(classifier.clone());
        }
        core
    }

    /// Publishes the streams of a device through a ROS node until a signal (such as SIGTERM), a
    /// call of `~quit` or `rosnode kill` ends the program. Then stops the device and unregisters
    /// the node. `connect` is called when the node has started, and returns the connection to the
    /// device. `log` yields the lines for `/rosout`. With a `page`, the streams are shown there
    /// too.
    ///
    /// # Errors
    ///
    /// [`BridgeError`] if the program cannot run. An absent device or ROS master is not an error;
    /// the program waits.
    pub async fn publish<F: Feed>(
        mut self,
        log: mpsc::Receiver<Log>,
        connect: impl AsyncFnOnce(&Node, &Namespace) -> Result<F, NodeError>,
        page: Option<LivePage>,
    ) -> Result<FinalCounts, BridgeError> {
        let run = self.prepare()?;
        let view = page.map(|page| page.start(&run)).transpose()?;
        let ros = self.start_ros(&run, log).await?;
        let feed = connect(&ros.ros.node, &run.namespace).await?;
        let parts = Parts { ros: Some(ros), view, ..Parts::default() };
        self.stream(run, feed, parts).await
    }

    /// Shows the streams of a device on a live page, without ROS, until a signal ends the program.
    ///
    /// # Errors
    ///
    /// [`BridgeError`] if the program cannot run.
    pub(crate) async fn show<F: Feed>(
        mut self,
        feed: F,
        page: LivePage,
    ) -> Result<FinalCounts, BridgeError> {
        let run = self.prepare()?;
        let parts = Parts { view: Some(page.start(&run)?), ..Parts::default() };
        self.stream(run, feed, parts).await
    }

    /// Reads the model, and creates the handlers of Unix signals and the channels of commands.
    fn prepare(&mut self) -> Result<Run, BridgeError> {
        let shutdown = Shutdown::new()?;
        let (model, upload) = self.model()?;
        let namespace = Namespace::new(&self.ros.namespace, &self.topic_prefix);
        namespace.as_ros_name().clone_into(&mut self.ros.namespace);
        let settings = self.settings(&model)?;
        let (command_sender, commands) = mpsc::unbounded_channel();
        let (announcements, _) = watch::channel(None);
        Ok(Run {
            shutdown,
            model,
            upload,
            namespace,
            settings,
            command_sender,
            commands,
            page: PageCommands::default(),
            announcements,
        })
    }

    /// Starts the ROS node with its services.
    async fn start_ros(
        &self,
        run: &Run,
        log: mpsc::Receiver<Log>,
    ) -> Result<RosParts, BridgeError> {
        let ros = RosNode::start(self.ros.clone()).await?;
        rosout::publish(Arc::clone(&ros.node), log);
        let streams = run.settings.streams;
        if streams.contains(Streams::PACKED) {
            ros.subscribe_rate(run.command_sender.clone());
        }
        let places_events =
            streams.contains(Streams::EVENTS) && run.settings.event_stamps == EventStamps::Recorder;
        let recorders = places_events.then(|| Arc::new(Recorders::default()));
        ros.serve(
            &run.namespace,
            self.get_info,
            run.announcements.subscribe(),
            recorders.clone(),
            run.command_sender.clone(),
        );
        run.shutdown.watch_node(Arc::clone(&ros.node));
        Ok(RosParts { ros, recorders })
    }

    /// Streams from `feed` to all given outlets until a shutdown.
    async fn stream<F: Feed>(
        self,
        mut run: Run,
        feed: F,
        parts: Parts,
    ) -> Result<FinalCounts, BridgeError> {
        let Parts { ros, ros2, lines, view, lsl } = parts;
        let has_ros = ros.is_some() || ros2.is_some();
        let announcements = has_ros.then_some(run.announcements);
        let (ros, recorders) = ros.map(|parts| (parts.ros, parts.recorders)).unzip();
        let recorders = recorders.flatten();
        let destinations = Destinations {
            ros: ros.as_ref().map(|node| RosOutlet { node, recorders }),
            ros2,
            lines: lines.as_ref(),
            view,
            lsl,
        };
        let predictions = self.classifying.as_ref().map(|of| of.topic.as_str());
        let sinks = Sinks::new(destinations, run.settings, &run.namespace, predictions).await?;
        let recording = LiveRecording::new(self.record_dir.clone(), run.settings);
        let model = Arc::clone(&run.model);
        let outlets = Outlets::new(sinks, run.settings, model, announcements, recording);
        schedule(self.realtime);
        let core = self.core(run.settings, &run.model, run.upload);
        let commands = (run.commands, run.page);
        let bridge = Bridge::new(core, feed, commands, outlets, self.exit_at_end);
        let (counts, has_ended, outcome) = bridge.run_to_end(&mut run.shutdown).await;
        let timeout = if has_ended { END_TIMEOUT } else { DRAIN_TIMEOUT };
        let written = lines.map_or(Ok(()), |lines| lines.finish(timeout));
        if let Some(ros) = ros {
            ros.shutdown().await;
        }
        // A sink reports only that the writing thread has ended; `written` holds the reason.
        let outcome = match outcome {
            Ok(()) | Err(BridgeError::Sink(SinkError::Closed)) => {
                written.map_err(BridgeError::Sink)
            }
            error => error,
        };
        match outcome {
            // The process that reads the JSON lines has closed the pipe, which is a normal end.
            Ok(()) | Err(BridgeError::Sink(SinkError::Closed)) => Ok(counts),
            Err(error) => Err(error),
        }
    }
}

/// The started outlets, which the user has chosen.
#[derive(Default)]
struct Parts {
    ros: Option<RosParts>,
    ros2: Option<Arc<Ros2Outlet>>,
    lines: Option<NdjsonWriter>,
    view: Option<Arc<View>>,
    lsl: Option<Lsl>,
}

/// Everything that a run needs before its outlets start.
struct Run {
    shutdown: Shutdown,
    model: Arc<Model>,
    upload: Option<Upload>,
    namespace: Namespace,
    settings: Settings,
    /// Keeps the channel of `commands` open in a run without ROS.
    command_sender: mpsc::UnboundedSender<NodeCommand>,
    commands: mpsc::UnboundedReceiver<NodeCommand>,
    page: PageCommands,
    /// Channel to the service `get_info`, which returns the newest value to recorders.
    announcements: watch::Sender<Option<AcquisitionInfo>>,
}

/// The ROS node, and the recorders of its frames.
struct RosParts {
    ros: RosNode,
    recorders: Option<Arc<Recorders>>,
}

/// Counts of a whole run. Its display form is the program's last line.
#[derive(Clone, Debug)]
pub struct FinalCounts {
    summary: Summary,
    outlets: Vec<OutletCount>,
}

impl fmt::Display for FinalCounts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}; outlets: ", self.summary)?;
        for (index, outlet) in self.outlets.iter().enumerate() {
            let separator = if index > 0 { ", " } else { "" };
            write!(formatter, "{separator}{outlet}")?;
        }
        Ok(())
    }
}

/// Asks the operating system for real-time scheduling of this thread, if `realtime` is set, and
/// logs whether it is granted. The decoder's thread, started earlier, keeps its ordinary priority.
fn schedule(realtime: bool) {
    if !realtime {
        return;
    }
    match realtime::request() {
        Ok(()) => tracing::info!("real-time priority, and memory locked"),
        Err(refusal) => tracing::warn!("no real-time priority: {refusal}; {}", realtime::REMEDY),
    }
}

/// Runs the bridge until it is ended by a signal (such as SIGTERM), a call of `~quit`, `rosnode
/// kill`, or a reader of the JSON lines that closes the pipe. Then stops the device, unregisters
/// the node and closes the port.
///
/// # Errors
///
/// [`BridgeError`] if the bridge cannot run. An absent device or ROS master is not an error; the
/// bridge waits.
pub(super) async fn stream(
    options: Options,
    mut ros: NodeOptions,
    log: mpsc::Receiver<Log>,
) -> Result<FinalCounts, BridgeError> {
    options.asked.warn_about_unused();
    let settings = options.settings();
    if let Some(uri) = options.ros.ros_master_uri {
        ros.master_uri = uri;
    }
    let upload_model = options.person.folder()?;
    let classifier = options.asked.classifying.read()?;
    let connection = Connection::new(options.at.port, options.at.baud);
    let publication = Publication {
        settings,
        model: options.model,
        upload_model,
        ros,
        topic_prefix: options.ros.topic_prefix,
        get_info: GET_INFO_SERVICE,
        exclusions: options.asked.exclusion.exclusions(),
        impedance: options.asked.contacts.impedance(),
        classifying: classifier.map(|classifier| options.predicting.classifying(classifier)),
        exit_at_end: options.exit_at_end,
        realtime: options.realtime.realtime,
        record_dir: options.viewing.record_dir.clone(),
    };
    let has = |kind| options.ros.sink.contains(&kind);
    let mut publication = publication;
    let run = publication.prepare()?;
    let lsl = if has(SinkKind::Lsl) {
        let library = Library::load(options.lsl.liblsl.as_deref())?;
        tracing::info!("{}", library.description());
        let named = lsl::LslOptions { name: options.lsl.lsl_name, stamp: settings.stamp };
        Some(Lsl::start(library, named)?)
    } else {
        None
    };
    let page = has(SinkKind::View).then(|| LivePage::new("corticode-bridge", options.viewing));
    let view = page.map(|page| page.start(&run)).transpose()?;
    let [log, log2] = rosout::split(log);
    let ros = if has(SinkKind::Ros) { Some(publication.start_ros(&run, log).await?) } else { None };
    let ros2 = if has(SinkKind::Ros2) {
        let commands = run.command_sender.clone();
        let outlet = Ros2Outlet::start(&publication.ros, &options.ros2, &run.namespace, commands)?;
        outlet.announce(run.announcements.subscribe())?;
        outlet.publish_log(log2)?;
        Some(outlet)
    } else {
        None
    };
    let lines =
        if has(SinkKind::Ndjson) { Some(NdjsonWriter::start(WholeLines::stdout()?)) } else { None };
    let parts = Parts { ros, ros2, lines, view, lsl };
    publication.stream(run, connection, parts).await
}

/// A live page to start, and the name of the program that prints its address.
#[derive(Clone, Debug)]
pub struct LivePage {
    program: &'static str,
    options: ViewOptions,
}

impl LivePage {
    /// Creates the page of a program, with the options that its user has chosen.
    pub fn new(program: &'static str, options: ViewOptions) -> LivePage {
        LivePage { program, options }
    }

    /// Starts the page, passes its commands to the bridge, and prints its address.
    fn start(self, run: &Run) -> Result<Arc<View>, BridgeError> {
        let address = self.options.view_address;
        let commands = run.page.sender();
        let view = View::start(address, self.options.view_token, move |command, reply| {
            commands.send(command, reply);
        });
        let view = view.map_err(|error| BridgeError::ViewAddress(address, error))?;
        // Keep the address out of the log, which also goes to `/rosout`: it can hold the token.
        new_file::message!("{}: live page at {}", self.program, view.url());
        if self.options.open_browser
            && let Err(error) = browser::open(view.url())
        {
            tracing::warn!("no browser opens ({error}); open the address above yourself");
        }
        Ok(Arc::new(view))
    }
}

/// A running bridge: the core at its port, the commands from ROS, and the outlets that execute the
/// core's effects.
struct Bridge<F> {
    driver: Driver<F>,
    commands: mpsc::UnboundedReceiver<NodeCommand>,
    page: PageCommands,
    outlets: Outlets,
    exit_at_end: bool,
    /// Whether the bridge ends because the device has disconnected.
    has_ended: bool,
}

impl<F: Feed> Bridge<F> {
    /// With `exit_at_end`, the bridge ends when a device that has sent frames disconnects.
    fn new(
        core: Core,
        connection: F,
        (commands, page): (mpsc::UnboundedReceiver<NodeCommand>, PageCommands),
        outlets: Outlets,
        exit_at_end: bool,
    ) -> Bridge<F> {
        Bridge {
            driver: Driver::new(core, connection),
            commands,
            page,
            outlets,
            exit_at_end,
            has_ended: false,
        }
    }

    /// Runs until a shutdown, then lets the decoder finish. Returns the counts even after an error,
    /// and whether the bridge ended because the device disconnected.
    async fn run_to_end(
        mut self,
        shutdown: &mut Shutdown,
    ) -> (FinalCounts, bool, Result<(), BridgeError>) {
        let outcome = self.run(shutdown).await;
        let has_ended = self.has_ended;
        let mut summary = self.driver.core.summary();
        let outlets = self.outlets;
        // Wait for the decoder in another thread: the tasks that write the sockets need this one.
        let finished = tokio::task::spawn_blocking(move || outlets.finish()).await;
        let (decoder, outlets) = finished.unwrap_or_default();
        summary.decoder = decoder;
        (FinalCounts { summary, outlets }, has_ended, outcome)
    }

    async fn run(&mut self, shutdown: &mut Shutdown) -> Result<(), BridgeError> {
        let mut until_report = Core::TICKS_PER_REPORT;
        let mut failure = None;
        loop {
            // Pause reading the port while the decoder lags behind a fast replay.
            let paused = self.outlets.must_pause();
            tokio::select! {
                event = self.driver.next(&mut self.outlets, paused) => match event? {
                    Some(Event::Closed) => {
                        let has_sent = self.driver.core.wire_counters().frames > 0;
                        if self.exit_at_end && has_sent {
                            self.has_ended = true;
                            shutdown.request("the port has closed, and --exit-at-end is set");
                        }
                    }
                    Some(_) => {}
                    None => {
                        until_report -= 1;
                        if until_report == 0 {
                            until_report = Core::TICKS_PER_REPORT;
                            self.report();
                        }
                    }
                },
                Some(command) = self.commands.recv() => {
                    let core = &mut self.driver.core;
                    match command {
                        NodeCommand::Acquisition(AcquisitionCommand::Start) => core.set_streaming(true),
                        NodeCommand::Acquisition(AcquisitionCommand::Stop) => core.set_streaming(false),
                        NodeCommand::Acquisition(AcquisitionCommand::Quit) => shutdown.request("~quit was called"),
                        NodeCommand::PackedRate(rate) => core.set_packed_rate(rate),
                    }
                }
                asked = self.page.next() => {
                    self.page.perform(asked, &mut self.driver.core, &mut self.outlets);
                }
                reason = shutdown.requested(), if !self.driver.is_ending() => {
                    tracing::info!("shutting down: {reason}");
                    self.driver.end(&mut self.outlets);
                }
            }
            self.outlets.start_decoding().await;
            self.outlets.recording.write();
            self.page.answer(&mut self.driver.core);
            if let Some(error) = self.outlets.sink_error.take()
                && failure.is_none()
            {
                shutdown.request("frames cannot be published any more");
                failure = Some(BridgeError::Sink(error));
            }
            if self.driver.has_ended() {
                self.report();
                return failure.map_or(Ok(()), Err);
            }
        }
    }

    /// Publishes the state of core, connection and outlets on `/diagnostics`.
    fn report(&mut self) {
        let mut report = self.driver.core.diagnostics(HostTime::now());
        report.status.extend(self.driver.connection.status());
        self.outlets.publish_diagnostics(report);
    }
}
