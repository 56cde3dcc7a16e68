//! The streaming bridge: connects the core to the port, to ROS and to the clock.

use std::sync::Arc;
use std::time::Duration;

use neuro_ros::ros1::NodeOptions;
use neuro_ros::{AcquisitionCommand, Log, NdjsonWriter, SinkError};
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, MissedTickBehavior, interval};

use crate::app::command_line::Options;
use crate::app::namespace::Namespace;
use crate::app::outlets::Outlets;
use crate::app::ros_node::RosNode;
use crate::app::rosout;
use crate::app::shutdown::Shutdown;
use crate::app::silence_log::SilenceLog;
use crate::app::sink_kind::SinkKind;
use crate::app::sinks::Sinks;
use crate::app::whole_lines::WholeLines;
use crate::core::Core;
use crate::decoder::model::Model;
use crate::diagnostics::summary::Summary;
use crate::error::BridgeError;
use crate::time::host_time::HostTime;
use crate::wire::connection::{Connection, Event};

/// Time between two calls of [`Core::tick`].
const TICK: Duration = Duration::from_millis(100);
/// Silence of the device that is logged.
const SILENCE: Duration = Duration::from_secs(5);
/// Number of ticks per report to `/diagnostics`: one report per second.
const TICKS_PER_REPORT: u32 = 10;
/// Timeout of each of the two waits at shutdown: until the device has stopped, and until queued
/// JSON lines are written.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(1);

/// Runs the bridge until it is ended by a signal (such as SIGTERM), by `~quit`, by `rosnode kill`,
/// or because the reader of the JSON lines closes the pipe. Then stops the device, unregisters the
/// node and closes the port.
///
/// # Errors
///
/// [`BridgeError`] if the bridge cannot run. An absent device or ROS master is not an error; the
/// bridge waits.
pub(super) async fn stream(
    options: Options,
    mut ros_options: NodeOptions,
    log: mpsc::Receiver<Log>,
) -> Result<Summary, BridgeError> {
    let mut shutdown = Shutdown::new()?;
    let model = match &options.model {
        Some(folder) => Model::read(folder),
        None => Model::embedded(),
    };
    let model = Arc::new(model.map_err(BridgeError::Model)?);
    if let Some(uri) = &options.ros_master_uri {
        ros_options.master_uri.clone_from(uri);
    }
    let namespace = Namespace::new(&ros_options.namespace, &options.topic_prefix);
    namespace
        .as_ros_name()
        .clone_into(&mut ros_options.namespace);
    let settings = options.settings();
    if !settings.streams.contains(settings.announced.needs()) {
        return Err(BridgeError::AnnouncedNotStreamed);
    }
    let (command_sender, commands) = mpsc::unbounded_channel();
    let mut outlets;
    let (mut ros, mut writer) = (None, None);
    match options.sink {
        SinkKind::Ros => {
            let node = RosNode::start(ros_options).await?;
            rosout::publish(Arc::clone(&node.node), log);
            let (announcement_sender, announced) = watch::channel(None);
            node.serve(&namespace, announced, command_sender);
            let sinks = Sinks::ros(&node, &options, &namespace).await?;
            let model = Arc::clone(&model);
            outlets = Outlets::new(sinks, settings, model, Some(announcement_sender))?;
            shutdown.watch_node(Arc::clone(&node.node));
            ros = Some(node);
        }
        SinkKind::Ndjson => {
            let lines = NdjsonWriter::start(WholeLines::stdout()?);
            let sinks = Sinks::ndjson(&lines, &options, &namespace);
            outlets = Outlets::new(sinks, settings, Arc::clone(&model), None)?;
            writer = Some(lines);
        }
    }
    let mut bridge = Bridge {
        core: Core::new(settings, Some(model)),
        connection: Connection::new(options.at.port.clone(), options.at.baud),
        commands,
        silence_log: SilenceLog::default(),
        outlets: &mut outlets,
    };
    let outcome = bridge.run(&mut shutdown).await;
    let mut summary = bridge.core.summary();
    // In a thread of its own, because the tasks that write the sockets must go on meanwhile.
    let finished = tokio::task::spawn_blocking(move || outlets.finish()).await;
    summary.decoder = finished.unwrap_or_default();
    if let Some(ros) = ros {
        ros.shutdown().await;
    }
    let written = writer.map_or(Ok(()), |writer| writer.finish(DRAIN_TIMEOUT));
    // A sink reports only that the writer has ended; the writer knows why.
    let outcome = match outcome {
        Ok(()) | Err(BridgeError::Sink(SinkError::Closed)) => written.map_err(BridgeError::Sink),
        Err(error) => Err(error),
    };
    match outcome {
        // The process that reads the JSON lines has closed the pipe, which is a normal end.
        Ok(()) | Err(BridgeError::Sink(SinkError::Closed)) => Ok(summary),
        Err(error) => Err(error),
    }
}

/// The core with its port, the commands from ROS services, and the outlets for its effects.
struct Bridge<'a> {
    core: Core,
    connection: Connection,
    commands: mpsc::UnboundedReceiver<AcquisitionCommand>,
    silence_log: SilenceLog,
    outlets: &'a mut Outlets,
}

impl Bridge<'_> {
    async fn run(&mut self, shutdown: &mut Shutdown) -> Result<(), BridgeError> {
        let mut buffer = vec![0; 4096];
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let mut until_report = TICKS_PER_REPORT;
        let mut deadline: Option<Instant> = None;
        let mut failure = None;
        loop {
            // Every tick asks again. In a pause the source waits, and its data stays in the port.
            let paused = self.outlets.must_pause();
            tokio::select! {
                event = self.connection.next_event(&mut buffer, &mut self.outlets.outgoing), if !paused => self.handle_connection(event?, &buffer),
                Some(command) = self.commands.recv() => match command {
                    AcquisitionCommand::Start => self.core.set_streaming(true),
                    AcquisitionCommand::Stop => self.core.set_streaming(false),
                    AcquisitionCommand::Quit => shutdown.request("~quit was called"),
                },
                reason = shutdown.requested(), if deadline.is_none() => {
                    tracing::info!("shutting down: {reason}");
                    self.core.set_streaming(false);
                    self.core.tick(HostTime::now(), self.outlets);
                    deadline = Some(Instant::now() + DRAIN_TIMEOUT);
                }
                _ = ticks.tick() => {
                    let now = HostTime::now();
                    self.core.tick(now, self.outlets);
                    until_report -= 1;
                    if until_report == 0 {
                        until_report = TICKS_PER_REPORT;
                        let report = self.core.diagnostics(now);
                        self.outlets.publish_diagnostics(report);
                    }
                    let limit = self.connection.silence_limit();
                    let is_read = self.connection.is_open() && !paused;
                    if is_read && self.core.is_unresponsive(now, SILENCE) {
                        self.silence_log.log(&self.connection.name(), self.core.wire_counters());
                    }
                    if is_read && self.core.is_unresponsive(now, limit) {
                        self.close();
                    }
                }
            }
            self.outlets.start_decoding().await;
            if let Some(error) = self.outlets.sink_error.take()
                && failure.is_none()
            {
                shutdown.request("frames cannot be published any more");
                failure = Some(BridgeError::Sink(error));
            }
            let is_done = !self.connection.is_open() || self.core.is_stopped();
            if deadline.is_some_and(|deadline| is_done || Instant::now() >= deadline) {
                let report = self.core.diagnostics(HostTime::now());
                self.outlets.publish_diagnostics(report);
                return failure.map_or(Ok(()), Err);
            }
        }
    }

    fn handle_connection(&mut self, event: Event, buffer: &[u8]) {
        // Read the time directly after the bytes, because the fit of the device's clock needs the
        // time at which the bytes arrived.
        let now = HostTime::now();
        match event {
            Event::Opened => self.core.connected(now, self.outlets),
            Event::Bytes(count) => {
                self.core.receive(&buffer[..count], now, self.outlets);
                self.connection.is_stranger = self.core.wire_counters().frames == 0;
            }
            Event::Closed => {
                if self.connection.is_stranger {
                    self.silence_log
                        .log(&self.connection.name(), self.core.wire_counters());
                }
                self.core.disconnected();
                self.outlets.outgoing.clear();
            }
        }
    }

    fn close(&mut self) {
        self.connection.close_silently();
        self.core.disconnected();
        self.outlets.outgoing.clear();
    }
}
