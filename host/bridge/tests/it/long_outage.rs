//! The queues of subscribers after an outage that is longer than the bridge fills.

use std::sync::atomic::Ordering::Relaxed;

use neuro_ros::{NeuroFrame, RosMessage};
use rustix::process::Signal;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::graph::{ended, frame, master, node};
use crate::process::Bridge;

#[tokio::test]
async fn fillers_of_an_hour_push_no_code_out_of_a_queue_and_the_indices_show_the_gap() {
    let master = master().await;
    let device = Device::tcp(Board::new());
    let bridge = Bridge::start(&["--port", &device.port, "--ros-master-uri", master.uri()]);
    let node = node("recorder", master.uri()).await;
    let type_ = NeuroFrame::TYPE;
    let mut encoded = node.subscribe("/encoded", type_, 70_000).await.unwrap();
    let mut next = frame(&mut encoded).await.tri.data[1] + 1;
    let lost = 60_000;
    device.controls.jump.store(lost, Relaxed);
    let (mut fillers, mut gaps, mut codes) = (0, Vec::new(), 0);
    while codes < 50 || fillers == 0 {
        let words = frame(&mut encoded).await.tri.data;
        let window = words[1] | words[2] << 16;
        if window != next {
            gaps.push(window - next);
        }
        next = window + 1;
        fillers += u32::from(words[0] & 0x8000 != 0);
        codes += u32::from(words[0] & 0x8000 == 0);
    }
    assert_eq!((fillers, gaps), (4096, vec![60_000 - 4096]));
    bridge.signal(Signal::TERM);
    let log = ended(bridge).await;
    assert_has(&log, ["lost 60000 (bursts 1, longest 60000) fillers 4096"]);
    assert!(log.contains("the outage was too long to fill"), "{log}");
    assert!(!log.contains("dropped for slow subscribers"), "{log}");
}
