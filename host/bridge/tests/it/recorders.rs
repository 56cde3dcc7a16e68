//! Events for recorders: stamps place the events at their rows in each recorder's own file.

use neuro_ros::{GET_INFO_SERVICE, NeuroEvent, RosMessage, Stamp, Wire};
use tokio::time::timeout;

use crate::graph::{Graph, announcement, frame, node, subscribe};
use crate::process::TIMEOUT;

/// Number of an event, counted from 1, and its stamp, nanoseconds since 1970.
type Stamped = (i64, i64);

/// Calls `get_info` as a recorder if `asks` is true, then receives a frame and three events.
/// Returns the index of the frame's first row, the earliest and the latest time at which the frame
/// can have been published, and the events.
async fn record(graph: &Graph, name: &str, asks: bool) -> (i64, [i64; 2], [Stamped; 3]) {
    let node = node(name, graph.master.uri()).await;
    let events = node.subscribe("/events/bus", NeuroEvent::TYPE, 64).await;
    let (mut events, mut frames) = (events.unwrap(), subscribe(&node, "/neurodata").await);
    frame(&mut frames).await;
    while events.publishers() == 0 {
        tokio::task::yield_now().await;
    }
    let (called_ns, first) = loop {
        let called_ns = Stamp::now().nanoseconds();
        if asks {
            announcement(&node, GET_INFO_SERVICE).await;
        }
        let answered_ns = Stamp::now().nanoseconds();
        // If a frame was read close to the time of the call, it is not known whether the recording
        // starts with this frame: retry.
        let mut is_clear = true;
        let first = loop {
            let frame = frame(&mut frames).await;
            let read_ns = frame.header.stamp.nanoseconds();
            if read_ns > answered_ns {
                break i64::from(frame.neuroheader.seq - 1) * 32;
            }
            is_clear &= read_ns < called_ns - 5_000_000;
        };
        if is_clear {
            break (called_ns, first);
        }
    };
    let arrival_ns = Stamp::now().nanoseconds();
    let mut stamped = [(0, 0); 3];
    for event in &mut stamped {
        let body = timeout(TIMEOUT, events.recv()).await.unwrap().unwrap();
        let message = NeuroEvent::from_bytes(&body).unwrap();
        *event = (message.neuroheader.seq.into(), message.header.stamp.nanoseconds());
    }
    (first, [called_ns, arrival_ns], stamped)
}

#[tokio::test]
async fn each_recorder_gets_an_event_at_its_own_place_and_others_at_its_time() {
    let graph = Graph::new().await;
    let streams = ["--streams=codes,raw,events", "--announce=raw", "--stamp=arrival"];
    let _bridge = graph.bridge_with(&streams);
    // Every 20 ms, the board makes 32 samples, which are 62.5 ms at the stated rate. Edge n is at
    // sample 32 (10 n - 1); the row of an edge is the number of its sample.
    let row = |number: i64| 32 * (10 * number - 1);
    for name in ["recorder1", "recorder2"] {
        let (first, [earliest_ns, latest_ns], events) = record(&graph, name, true).await;
        for (number, stamp_ns) in events {
            // The stamp is 1.5 rows later than the row: one row because the recorder counts rows
            // from 0 and readers of its file from 1, and half a row because the recorder rounds
            // down.
            let since_ns = (2 * (row(number) - first) + 3) * 1_000_000_000 / 1024;
            let published_ns = stamp_ns - since_ns + 62_500_000;
            let earliest_ns = earliest_ns - 1;
            assert!(
                (earliest_ns..=latest_ns).contains(&published_ns),
                "{name}: edge {number} {} ms too early",
                (earliest_ns - published_ns) / 1_000_000
            );
        }
    }
    let (_, _, events) = record(&graph, "viewer", false).await;
    let apart_ns = events[2].1 - events[0].1;
    // Events 0 and 2 are 20 codes apart, which take 0.4 s.
    assert!((300_000_000..500_000_000).contains(&apart_ns), "{apart_ns} ns");
}
