//! Tests that every chart is drawn with its title, its axes and its data.
#![forbid(unsafe_code)]

use std::ops::RangeBounds;
use std::path::Path;

use picture::canvas::PictureError;
use picture::heat_map::HeatMap;
use picture::histogram::Histogram;
use picture::intervals::{Intervals, Series};
use picture::scalp_map::{Place, ScalpMap};
use picture::traces::{Trace, Traces};

const SUBTITLE: &str = "synthetic data";

/// Asserts that the SVG of a picture contains its subtitle and all `words`, and that the text
/// `shape`, such as `<circle`, occurs in it a number of times that is in `counts`.
fn assert_drawn(
    draw: impl FnOnce(&Path) -> Result<(), PictureError>,
    words: &[&str],
    shape: &str,
    counts: impl RangeBounds<usize>,
) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("picture.svg");
    draw(&file).expect("drawn");
    let text = std::fs::read_to_string(file).expect("written");
    for words in [&[SUBTITLE], words].concat() {
        assert!(text.contains(words), "{words}");
    }
    let count = text.matches(shape).count();
    assert!(counts.contains(&count), "{count} {shape}");
}

/// Returns a test signal: a sine of 20 uV times `gain`, with a different phase for each electrode.
fn wave(electrode: u8, gain: f32) -> Vec<f32> {
    let times = (0..512_u16).map(f32::from);
    let value = |time: f32| 20.0 * (0.5 * time + f32::from(electrode)).sin();
    times.map(|time| gain * value(time)).collect()
}

#[test]
fn traces_are_drawn() {
    let trace = |electrode: u8| Trace {
        label: format!("E{electrode}"),
        source_uv: wave(electrode, 1.0),
        result_uv: wave(electrode, 0.9),
    };
    let traces = Traces {
        rows: (0..6).map(trace).collect(),
        rate_hz: 128.0,
        start_s: 3.0,
        since: "the device's start".to_owned(),
        result: "decoded from 128 int8".to_owned(),
        subtitle: SUBTITLE.to_owned(),
    };
    let words = ["time since the device", "E5", "µV", "128 Hz", "128 int8"];
    assert_drawn(|path| traces.draw(path), &words, "<polyline", 12..);
}

#[test]
fn codes_are_drawn() {
    let code = |time: u8| (time != 77).then(|| wave(time, 1.0)[..128].to_vec());
    let map = HeatMap {
        codes: (0..240).map(code).collect(),
        start_s: 0.1,
        settling: 40,
        interval_s: 0.0625,
        subtitle: SUBTITLE.to_owned(),
    };
    let words = ["component of the code", "filters settle", "lost"];
    assert_drawn(|path| map.draw(path), &words, "<rect", 128..);
}

#[test]
fn intervals_are_drawn() {
    let jitter = |index: u16| 62.5 + 0.4 * (f64::from(index) * 1.7).sin();
    let series = |name: &str, ms| Series { name: name.to_owned(), ms };
    let wider = |index: u16| 62.5 + 2.0 * (jitter(index) - 62.5);
    let intervals = Intervals {
        arrival: series("ours", (0..240).map(jitter).collect()),
        source: series("source", vec![62.5; 240]),
        rival: Some(series("theirs", (0..240).map(wider).collect())),
        subtitle: SUBTITLE.to_owned(),
    };
    let words =
        ["interval (ms)", "62.499 ± 0.227 ms", "ours: 62.5", "source: 62.500", "theirs: 62.5"];
    assert_drawn(|path| intervals.draw(path), &words, "<rect", 10..);
}

#[test]
fn a_scalp_map_is_drawn() {
    let place = |electrode: u8| Place {
        label: format!("E{electrode}"),
        at: [f64::from(electrode) / 5.0 - 0.5, 0.3],
        value: f64::from(electrode),
        is_measured: electrode > 1,
    };
    let map = ScalpMap {
        places: (0..6).map(place).collect(),
        title: "error".to_owned(),
        subtitle: SUBTITLE.to_owned(),
        unit: "%".to_owned(),
    };
    let words = ["E5", "5.00 %", "hollow"];
    // Two circles for each of the six electrodes, and one for the head.
    assert_drawn(|path| map.draw(path), &words, "<circle", 13..=13);
    assert_drawn(|path| map.draw(path), &words, "<rect", 200..);
}

#[test]
fn a_histogram_is_drawn() {
    let histogram = Histogram {
        range: [-128.0, 128.0],
        counts: vec![0, 10, 30, 0],
        title: "levels".to_owned(),
        subtitle: SUBTITLE.to_owned(),
        x: "level".to_owned(),
    };
    // One rectangle is the page's background, two are the bins that are not empty.
    assert_drawn(|path| histogram.draw(path), &["level", "share"], "<rect", 3..=3);
}
