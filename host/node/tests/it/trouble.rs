//! What `corticode-node` reports about frames that are lost or cannot be encoded.

use std::time::Duration;

use neuro_ros::{DiagnosticLevel, DiagnosticStatus, NeuroFrame, RosMessage, Wire};
use tokio::time::sleep;

use crate::graph::{Graph, frame};

#[tokio::test]
async fn each_kind_of_refusal_is_one_line_of_the_log_and_counted_in_diagnostics() {
    let mut graph = Graph::start(&["--quiet"]).await;
    for number in 1..=20 {
        let mut slow = frame(number);
        slow.sr = 100;
        graph.acquisition.publish(&slow.to_bytes());
        let mut short = frame(number);
        short.eeg.data.pop();
        graph.acquisition.publish(&short.to_bytes());
        graph.acquisition.publish(&[1, 2, 3]);
    }
    let is_refused = |status: &DiagnosticStatus| status.message.contains("refused");
    let status = graph.status("corticode: source", is_refused).await;
    assert_eq!(status.level, DiagnosticLevel::Error);
    let log = graph.log();
    for part in ["the rate is 100 Hz", "eeg has", "a message is no NeuroFrame"] {
        assert_eq!(log.matches(part).count(), 1, "{part}: {log}");
    }
    assert_eq!(log.lines().count(), 3, "{log}");
    // After refused frames, valid frames are encoded.
    graph.publish(1..=8).await;
    graph.next_code().await;
    let mut infinite = frame(9);
    infinite.eeg.data[0] = f32::NEG_INFINITY;
    graph.acquisition.publish(&infinite.to_bytes());
    let is_named = |status: &DiagnosticStatus| status.message.contains("-inf");
    graph.status("corticode: source", is_named).await;
}

#[tokio::test]
async fn lost_frames_show_in_diagnostics_and_as_fillers() {
    let mut graph = Graph::start(&["--filler=zeros"]).await;
    graph.publish(1..=24).await;
    graph.publish(28..=40).await;
    let is_warning = |status: &DiagnosticStatus| status.message.contains("3 frames lost");
    let status = graph.status("corticode: source", is_warning).await;
    assert_eq!(status.level, DiagnosticLevel::Warn);
    let lost = status.values.iter().find(|value| value.key == "frames lost");
    assert_eq!(lost.unwrap().value, "3");
    let mut zeros = 0;
    let mut next = graph.next_code().await;
    while next.neuroheader.seq < 36 {
        zeros += u32::from(next.eeg.data.iter().all(|value| *value == 0.0));
        next = graph.next_code().await;
    }
    // Three hops are lost: their windows, and one window before and one after them, are fillers.
    assert_eq!(zeros, 5);
}

#[tokio::test]
async fn a_silent_acquisition_and_a_second_one_are_errors_in_diagnostics() {
    let mut graph = Graph::start(&[]).await;
    graph.publish(1..=24).await;
    let is_silent = |status: &DiagnosticStatus| status.message.contains("no frames come");
    let status = graph.status("corticode: source", is_silent).await;
    assert_eq!(status.level, DiagnosticLevel::Error);
    sleep(Duration::from_secs(3)).await;
    let log = graph.log();
    // The core repeats `Start` if a device is silent, which must not start the streams anew.
    assert_eq!(log.matches("streaming codes").count(), 1, "{log}");
    let (node, publisher) = graph.another_acquisition().await;
    let is_mixed = |status: &DiagnosticStatus| status.message.starts_with("2 nodes");
    graph.status("corticode: source", is_mixed).await;
    // If the frames were not refused, each change of publisher would look like a restart.
    for number in 25..=40 {
        graph.publish([number]).await;
        publisher.publish(&frame(number + 500).to_bytes());
    }
    let is_counted = |status: &DiagnosticStatus| {
        let mut values = status.values.iter();
        values.any(|value| value.key == "frames refused" && value.value == "32")
    };
    graph.status("corticode: source", is_counted).await;
    let log = graph.log();
    assert_eq!(log.matches("2 nodes publish the topic").count(), 1, "{log}");
    assert!(!log.contains("started again"), "{log}");
    // When the second acquisition has ended, frames of the first are encoded again.
    node.shutdown().await;
    let is_alone = |status: &DiagnosticStatus| !status.message.starts_with("2 nodes");
    graph.status("corticode: source", is_alone).await;
    let before = graph.next_code().await.neuroheader.seq;
    graph.publish(41..=56).await;
    while graph.next_code().await.neuroheader.seq < before + 24 {}
}

#[tokio::test]
async fn a_publisher_that_cannot_be_reached_is_named_with_the_reason_until_it_is_gone() {
    let mut graph = Graph::start(&["--quiet"]).await;
    let (node, publisher) = graph.another_acquisition().await;
    // Ends the first acquisition, then the second.
    graph.acquisition = publisher;
    node.shutdown().await;
    let is_absent = |status: &DiagnosticStatus| status.message == "no node publishes /neurodata";
    graph.status("corticode: source", is_absent).await;
    // RFC 6761 reserves `.invalid` for names that never resolve.
    let uri = "http://no-such-host.invalid:4321/";
    graph.call_master("registerPublisher", &["/neurodata", NeuroFrame::TYPE.name, uri]).await;
    let reason = format!("{uri}: requestTopic failed: {uri} cannot be reached: the host name");
    let is_named = |status: &DiagnosticStatus| status.message.contains(&reason);
    let status = graph.status("corticode: source", is_named).await;
    assert_eq!(status.level, DiagnosticLevel::Error);
    let status = graph.status("corticode: ros", is_named).await;
    assert_eq!(status.level, DiagnosticLevel::Warn);
    sleep(Duration::from_secs(2)).await;
    let log = graph.log();
    assert_eq!(log.matches(&reason).count(), 1, "{log}");
    graph.call_master("unregisterPublisher", &["/neurodata", uri]).await;
    graph.status("corticode: source", is_absent).await;
    let is_calm = |status: &DiagnosticStatus| status.level == DiagnosticLevel::Ok;
    graph.status("corticode: ros", is_calm).await;
}

#[tokio::test]
async fn a_resampled_acquisition_starts_once_and_names_its_interpolated_electrodes() {
    let mut graph = Graph::start(&[]).await;
    for number in 1..=8 {
        let mut slow = frame(number);
        slow.sr = 250;
        slow.eeg.info.labels[3] = "EMG".to_owned();
        graph.acquisition.publish(&slow.to_bytes());
        sleep(Duration::from_millis(1000 * u64::from(slow.eeg.info.nsamples) / 250)).await;
    }
    let first = graph.next_code().await;
    assert_eq!(first.neuroheader.seq, 1);
    let log = graph.log();
    let missing = model::LABELS.split(' ').nth(3).unwrap();
    assert!(log.contains(&format!("interpolated: {missing}")), "{log}");
    assert!(log.contains("250 Hz is resampled to 512 Hz: codes come 32 ms later"), "{log}");
    assert_eq!(log.matches("streaming codes").count(), 1, "{log}");
}
