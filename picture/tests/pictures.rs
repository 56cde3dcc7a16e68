//! Every chart is drawn with its title, its axes and its data.
#![forbid(unsafe_code)]

use std::path::Path;

use picture::canvas::{PictureError, RESULT, SOURCE};
use picture::curves::{Curve, Curves, Mark};
use picture::heat_map::HeatMap;
use picture::intervals::Intervals;
use picture::traces::{Trace, Traces};

const SUBTITLE: &str = "synthetic data";

/// Draws a picture to a temporary file and returns the SVG text.
fn drawn(draw: impl FnOnce(&Path) -> Result<(), PictureError>) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("picture.svg");
    draw(&file).expect("drawn");
    std::fs::read_to_string(file).expect("written")
}

/// Asserts that a picture contains `words` and at least `shapes` lines, rectangles and circles.
fn assert_picture(text: &str, words: &str, shapes: usize) {
    assert!(text.contains(words) && text.contains(SUBTITLE), "{words}");
    let found = ["<polyline", "<rect", "<circle"].map(|shape| text.matches(shape).count());
    let found: usize = found.iter().sum();
    assert!(found >= shapes, "{words}: {found} shapes");
}

/// Returns a synthetic signal shaped like EEG after the filters, uV.
fn wave(electrode: f32, time: f32) -> f32 {
    20.0 * (0.5 * time + electrode).sin() + 5.0 * (0.11 * time).cos()
}

#[test]
fn traces_are_drawn() {
    let signal = |electrode: u8, gain: f32| {
        let times = 0..512_u16;
        let values = times.map(|time| gain * wave(electrode.into(), time.into()));
        values.collect()
    };
    let trace = |electrode: u8| Trace {
        label: format!("E{electrode}"),
        source_uv: signal(electrode, 1.0),
        result_uv: signal(electrode, 0.9),
    };
    let traces = Traces {
        rows: (0..6).map(trace).collect(),
        rate_hz: 128.0,
        start_s: 3.0,
        subtitle: SUBTITLE.to_owned(),
    };
    assert_picture(
        &drawn(|path| traces.draw(path)),
        "time since the device",
        12,
    );
}

#[test]
fn codes_are_drawn() {
    let value = |time: u16, component: u16| {
        wave(component.into(), f32::from(time) * 0.6) * f32::from(component)
    };
    let code = |time: u16| {
        (time != 77).then(|| (0..128).map(|component| value(time, component)).collect())
    };
    let map = HeatMap {
        codes: (0..240).map(code).collect(),
        start_s: 0.1,
        settling: 40,
        interval_s: 0.0625,
        subtitle: SUBTITLE.to_owned(),
    };
    assert_picture(&drawn(|path| map.draw(path)), "component of the code", 128);
}

#[test]
fn intervals_are_drawn() {
    let jitter = |index: u16| 62.5 + 0.4 * (f64::from(index) * 1.7).sin();
    let intervals = Intervals {
        arrival_ms: (0..240).map(jitter).collect(),
        device_ms: vec![62.5; 240],
        subtitle: SUBTITLE.to_owned(),
    };
    assert_picture(&drawn(|path| intervals.draw(path)), "interval (ms)", 10);
}

#[test]
fn lines_and_circles_are_drawn_within_the_axes() {
    let curve = |mark, color, label: &str| Curve {
        label: label.to_owned(),
        color,
        mark,
        points: (1..=60)
            .map(|hz| (hz.into(), 1.0 / f64::from(hz)))
            .collect(),
    };
    let curves = Curves {
        title: "a title",
        subtitle: SUBTITLE.to_owned(),
        x_hz: [1.0, 60.0],
        y: [0.0, 0.5],
        y_label: "a quantity",
        band_hz: [0.5, 40.0],
        mains_hz: 50.0,
        curves: vec![
            curve(Mark::Line, SOURCE, "a line"),
            curve(Mark::Circles, RESULT, "some circles"),
        ],
    };
    let text = drawn(|path| curves.draw(path));
    for words in [
        "a title",
        SUBTITLE,
        "a quantity",
        "a line",
        "some circles",
        "40 Hz",
        "50 Hz",
    ] {
        assert!(text.contains(words), "{words}");
    }
    assert!(!text.contains("0.5 Hz"), "a mark beyond the axis");
    // The first of 60, at 1, is above the axis.
    assert_eq!(text.matches("<circle").count(), 59);
}
