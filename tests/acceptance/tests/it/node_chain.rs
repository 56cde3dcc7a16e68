//! `corticode-node` with a real roscore: it turns the frames of a rospy acquisition into the same
//! codes, bit for bit, as host-sim does from the same samples; its services answer, and it
//! continues after a restart of roscore or of the acquisition.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use acceptance::files::write_gdf;
use acceptance::process::Process;
use acceptance::programs::programs;
use acceptance::ros::{Ros, TIMEOUT};
use acceptance::{real_data, ros, workspace};
use artifact::reconstruction::dequantise;
use link::{Decoder, Flags, MAX_FRAME, ToHost};
use neuro_ros::ros1::{Node, NodeOptions, Subscriber};
use neuro_ros::{NeuroFrame, RosMessage, Wire};
use recordings::{Block, Recording};
use rustix::process::Signal;

use crate::inputs::synthetic;

/// Duration of the EEG in each test, in seconds.
const SECONDS: usize = 12;
/// Number of samples that each frame of the acquisition carries, 62.5 ms as in the paper.
pub(crate) const SAMPLES: usize = 32;
/// Time limit for a program to exit after a Unix signal.
pub(crate) const EXIT_TIMEOUT: Duration = Duration::from_mins(1);

/// EEG that a test publishes in place of an acquisition system; the values are in uV, sample by
/// sample.
#[derive(Clone)]
pub(crate) struct Eeg {
    pub(crate) rate_hz: usize,
    pub(crate) labels: Vec<String>,
    pub(crate) values: Vec<f32>,
}

impl Eeg {
    pub(crate) fn synthetic() -> Eeg {
        let labels: Vec<String> = model::LABELS.split(' ').map(str::to_owned).collect();
        let rate_hz = usize::from(model::ADC_RATE_HZ);
        let rows = synthetic(7).take(SECONDS * rate_hz);
        let values = rows.flat_map(|row| {
            let uv = row.counts.map(|count| f64::from(count) * f64::from(model::LSB_NV) / 1000.0);
            #[expect(
                clippy::cast_possible_truncation,
                reason = "rounded to a NeuroFrame's float32"
            )]
            let uv = uv.map(|uv| uv as f32);
            uv.into_iter().take(labels.len()).collect::<Vec<_>>()
        });
        let values = values.collect();
        Eeg { rate_hz, labels, values }
    }

    /// Reads the samples of a recording's first [`SECONDS`] seconds.
    fn read(path: &Path) -> Eeg {
        let mut recording = Recording::open(path).expect("a recording");
        let rate = recording.signals()[0].rate.expect("samples").value();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole rate")]
        let rate_hz = rate.round() as usize;
        let labels = recording.labels().iter().map(ToString::to_string).collect();
        let mut columns = vec![Vec::new(); recording.signals().len()];
        let mut block = Block::default();
        while columns[0].len() < SECONDS * rate_hz
            && recording.read_block(&mut block).expect("data")
        {
            for (column, part) in columns.iter_mut().zip(&block.samples) {
                column.extend_from_slice(part);
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "rounded to a NeuroFrame's float32")]
        let value = |(row, column): (usize, &Vec<f64>)| column[row] as f32;
        let rows = (0..SECONDS * rate_hz).flat_map(|row| columns.iter().map(move |c| (row, c)));
        let values = rows.map(value).collect();
        Eeg { rate_hz, labels, values }
    }

    /// Returns the dequantised codes that host-sim computes from a recording of the samples.
    pub(crate) fn codes_of_host_sim(&self, folder: &Path) -> Vec<Vec<f32>> {
        let recording = folder.join("eeg.gdf");
        let rate_hz = u32::try_from(self.rate_hz).expect("a small rate");
        let values = self.values.iter().copied();
        write_gdf(&recording, &self.labels, rate_hz, values, &[]);
        let codes = folder.join("codes.bin");
        let mut host_sim = Command::new(&programs().host_sim);
        host_sim.args(["run", "--fast", "--input"]).arg(&recording);
        host_sim.arg(format!("--output=file:{}", codes.display()));
        let made = host_sim.output().expect("host-sim starts");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        dequantised_codes(&fs::read(codes).expect("the codes"))
    }

    /// Writes the values to a file, as little-endian float32, and returns the file's path.
    pub(crate) fn write_values(&self, folder: &Path) -> PathBuf {
        let path = folder.join("values.f32");
        let bytes: Vec<u8> = self.values.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(&path, bytes).expect("a file");
        path
    }

    /// Starts a rospy node that publishes the samples as NeuroFrames in real time.
    fn publish(&self, ros: &Ros<'_>, folder: &Path, number: u32) -> Process {
        let path = self.write_values(folder);
        let mut python = ros.command("python3");
        python.arg(script()).arg("/neurodata").arg(path).args([
            &self.rate_hz.to_string(),
            &SAMPLES.to_string(),
            &self.labels.join(","),
            "1",
        ]);
        let name = format!("amplifier{number}");
        Process::start(&name, &mut python, folder).expect("python3 starts")
    }
}

fn script() -> PathBuf {
    let script = workspace::root().join("tests/acceptance/ros/publish.py");
    script.canonicalize().expect("the script exists")
}

fn dequantised_codes(mut bytes: &[u8]) -> Vec<Vec<f32>> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut codes = Vec::new();
    while let Some(frame) = decoder.next::<ToHost>(&mut bytes) {
        if let ToHost::Code(code) = frame.expect("a whole frame").message {
            let scales = model::CODE_SCALE.iter().zip(&model::CODE_ZERO_POINT);
            let levels = code.values.levels().zip(scales);
            let values = levels.map(|(level, (scale, zero))| dequantise(level, *scale, *zero));
            codes.push(values.collect());
        }
    }
    codes
}

pub(crate) fn start_node(ros: &Ros<'_>, folder: &Path, options: &[&str]) -> Process {
    let mut node = Command::new(&programs().node);
    node.args(options)
        .env("ROS_MASTER_URI", ros.master_uri())
        .env("ROS_HOSTNAME", "127.0.0.1")
        .env_remove("ROS_IP");
    Process::start("corticode-node", &mut node, folder).expect("corticode-node starts")
}

/// Subscribes to a topic of `node`, and waits until the subscription is connected.
pub(crate) async fn subscribe<M: RosMessage>(
    ros: &Ros<'_>,
    topic: &str,
    node: &Process,
) -> (Node, Subscriber) {
    let listener = Node::start(NodeOptions {
        host: Some("127.0.0.1".to_owned()),
        ..NodeOptions::new("listener", &ros.master_uri())
    });
    let listener = listener.await.expect("a node");
    let subscriber = listener.subscribe(topic, M::TYPE, 4096).await;
    let subscriber = subscriber.expect("subscribed");
    let deadline = Instant::now() + TIMEOUT;
    while subscriber.publishers() == 0 {
        assert!(Instant::now() < deadline, "{}", node.log());
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    (listener, subscriber)
}

async fn next_frame(subscriber: &mut Subscriber, node: &Process) -> NeuroFrame {
    let body = tokio::time::timeout(TIMEOUT, subscriber.recv()).await;
    let body = body.unwrap_or_else(|_| panic!("no frame came: {}", node.log()));
    NeuroFrame::from_bytes(&body.expect("the node runs")).expect("a NeuroFrame")
}

pub(crate) fn is_filler(frame: &NeuroFrame) -> bool {
    frame.tri.data[0] & i32::from(Flags::FILLER.bits()) != 0
}

/// Checks that corticode-node publishes the codes that host-sim computes from `eeg`.
async fn passes(eeg: &Eeg) {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let expected = eeg.codes_of_host_sim(folder);
    assert!(expected.len() > 100, "only {} codes", expected.len());
    let ros = Ros::start(folder).expect("roscore starts");
    let node = start_node(&ros, folder, &[]);
    let (_listener, mut encoded) = subscribe::<NeuroFrame>(&ros, "/encoded", &node).await;
    let _amplifier = eeg.publish(&ros, folder, 0);
    for (window, code) in expected.iter().enumerate() {
        let frame = next_frame(&mut encoded, &node).await;
        assert!(!is_filler(&frame), "window {window}: {}", node.log());
        assert_eq!(&frame.eeg.data, code, "window {window}");
    }
    let info = ros.tool("rosservice", &["call", "/corticode/get_info"]);
    assert!(info.contains("corticode-node") && info.contains("nchannels: 128"), "{info}");
    let log = node.errors();
    let exit = node.stop(Signal::INT, EXIT_TIMEOUT);
    assert!(exit.success(), "{exit}: {log}");
}

pub(crate) fn block_on(test: impl Future<Output = ()>) {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    runtime.expect("a runtime").block_on(test);
}

#[test]
fn codes_of_a_rospy_acquisition_are_those_of_host_sim_bit_for_bit() {
    if ros::available("synthetic EEG from rospy") {
        block_on(passes(&Eeg::synthetic()));
    }
}

#[test]
fn codes_of_a_real_recording_from_rospy_are_those_of_host_sim_bit_for_bit() {
    let test = "a recording from rospy";
    if !ros::available(test) {
        return;
    }
    if let Some(path) = real_data::path(test, real_data::GDF_F32) {
        block_on(passes(&Eeg::read(&path)));
    }
}

#[test]
fn roscore_and_the_acquisition_can_start_again_and_the_services_stop_and_start() {
    if !ros::available("restarts around corticode-node") {
        return;
    }
    block_on(async {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        let eeg = Eeg::synthetic();
        let mut ros = Ros::start(folder).expect("roscore starts");
        let mut node = start_node(&ros, folder, &["_mains:=60", "--verbose"]);
        let (_listener, mut encoded) = subscribe::<NeuroFrame>(&ros, "/encoded", &node).await;
        let mut amplifier = eeg.publish(&ros, folder, 0);
        let first = next_frame(&mut encoded, &node).await;
        assert!(first.eeg.info.prefiltering.contains("60 Hz"), "{first:?}");
        ros.tool("rosservice", &["call", "/corticode/stop"]);
        tokio::time::sleep(Duration::from_secs(1)).await;
        while tokio::time::timeout(Duration::from_millis(500), encoded.recv()).await.is_ok() {}
        assert!(amplifier.is_running(), "frames still come");
        ros.tool("rosservice", &["call", "/corticode/start"]);
        next_frame(&mut encoded, &node).await;

        amplifier.kill();
        ros.restart_core().expect("roscore starts");
        let _amplifier = eeg.publish(&ros, folder, 1);
        let again = "the acquisition started again";
        node.wait_until(again, TIMEOUT, |node| node.errors().contains(again));
        while encoded
            .recv()
            .await
            .is_some_and(|body| NeuroFrame::from_bytes(&body).is_ok_and(|frame| is_filler(&frame)))
        {
        }
        let topics = ros.tool("rosnode", &["info", "/corticode"]);
        for topic in ["/neurodata ", "/encoded ", "/diagnostics ", "/corticode/get_info"] {
            assert!(topics.contains(topic), "{topic}: {topics}");
        }
        let exit = node.stop(Signal::TERM, EXIT_TIMEOUT);
        assert!(exit.success(), "{exit}");
    });
}
