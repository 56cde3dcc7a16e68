//! Checks of the page's traces: their values, a second stream, the average reference, events and
//! the history.

use std::time::Duration;

use acceptance::browser::Browser;
use acceptance::process::wait_for;

use super::choose;
use super::reading::{DOWN, END, HOME, LEFT, Reading};
use super::shown::{EDGE_US, Shown};
use super::wire::Wire;

/// Streams on the page: name, topic, and sampling rate in Hz.
const STREAMS: [(&str, &str, u64); 3] = [
    ("reconstructed", "/neurodata_reconstructed", 128),
    ("filtered", "/neurodata_corticode", 128),
    ("raw", "/neurodata", 512),
];

/// Moves the cursor by keys, and compares what the page shows for it with the JSON lines.
pub(super) fn values_equal_those_on_the_wire(browser: &Browser, shown: &Shown) {
    for (stream, topic, _) in STREAMS {
        choose(browser, "stream", stream);
        std::thread::sleep(Duration::from_secs(3));
        browser.type_keys("#plot", " ");
        let readings: Vec<Reading> = (0..12).map(|_| moved(browser)).collect();
        browser.type_keys("#plot", " ");
        let wire = Wire::read(&shown.lines(), topic);
        for reading in &readings {
            let sample = &wire.samples[wire.at(reading.us)];
            let expected = sample.values[wire.channel(&reading.label)];
            let Reading { text, value, .. } = reading;
            assert_eq!(*value, format!("{expected:.3}"), "{text}");
            assert!(text.contains(" uV at "), "{text}");
            assert_eq!(reading.has("replaced, was lost"), sample.is_filler, "{text}");
            let excluded = if stream == "reconstructed" {
                "electrode filled from the others"
            } else {
                "electrode excluded from the codes"
            };
            assert_eq!(reading.has(excluded), reading.label == "Cz", "{text}");
        }
        let mut texts: Vec<&String> = readings.iter().map(|reading| &reading.text).collect();
        texts.dedup();
        assert_eq!(texts.len(), 12, "the cursor stands still: {texts:?}");
    }
}

/// Moves the cursor seven samples to the left and three electrodes down. Returns what the page then
/// shows for the cursor.
fn moved(browser: &Browser) -> Reading {
    let keys = [vec![LEFT; 7], vec![DOWN; 3]].concat();
    browser.type_keys("#plot", &keys.iter().collect::<String>());
    Reading::of(browser, "#cursor")
}

/// Shows decoded signals over filtered ones, and compares both with the JSON lines: first the
/// signals as received, then the signals minus the average of all electrodes but Cz, which is
/// excluded.
pub(super) fn two_streams_and_the_average_are_those_on_the_wire(browser: &Browser, shown: &Shown) {
    choose(browser, "stream", "filtered");
    choose(browser, "over", "reconstructed");
    std::thread::sleep(Duration::from_secs(2));
    browser.type_keys("#plot", " ");
    let plain: Vec<Reading> = (0..4).map(|_| moved(browser)).collect();
    browser.type_keys("#plot", "a");
    let average: Vec<Reading> = (0..4).map(|_| moved(browser)).collect();
    let pixels = "const {width, height} = document.getElementById('plot');
        const {data} = document.getElementById('plot').getContext('2d').getImageData(0, 0, width, height);
        const colour = getComputedStyle(document.documentElement).getPropertyValue('--over').trim();
        const [r, g, b] = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (data[i] === r && data[i + 1] === g && data[i + 2] === b) count += 1;
        return count;";
    let pixels = browser.run(pixels).as_u64().expect("a number");
    assert!(pixels > 5000, "{pixels} pixels of the second stream");
    browser.type_keys("#plot", "a ");
    choose(browser, "over", "none");
    let lines = shown.lines();
    let [filtered, decoded] =
        ["/neurodata_corticode", "/neurodata_reconstructed"].map(|topic| Wire::read(&lines, topic));
    for (readings, is_average) in [(plain, false), (average, true)] {
        for reading in readings {
            let Reading { text, label, value, us, .. } = &reading;
            let (at, other) = (filtered.at(*us), decoded.near(*us));
            assert!(decoded.samples[other].us.abs_diff(*us) <= 1, "{text}");
            let expected = [(&filtered, at), (&decoded, other)].map(|(wire, index)| {
                if is_average {
                    wire.to_average(index, label)
                } else {
                    wire.samples[index].values[wire.channel(label)]
                }
            });
            let second = reading.notes[0].strip_prefix("reconstructed ");
            let second = second.and_then(|rest| rest.split_once(" uV"));
            let (second, lost) = second.unwrap_or_else(|| panic!("{text}"));
            for (shown, expected) in [value.as_str(), second].into_iter().zip(expected) {
                let shown: f64 = shown.parse().expect("a value");
                assert!((shown - expected).abs() < 0.000_501, "{text}: {expected}");
            }
            assert_eq!(lost == " (was lost)", decoded.samples[other].is_filler, "{text}");
            let to = " to the average of 60 electrodes at ";
            assert_eq!(text.contains(to), is_average, "{text}");
        }
    }
}

/// Moves the cursor through eight events. Each edge must be at the sample where the level of the
/// trigger changes in the JSON lines, which is the first sample at or after the time of the edge.
/// For decoded signals, only the time of the edge is checked.
pub(super) fn events_are_at_their_samples(browser: &Browser, shown: &Shown) {
    for (stream, topic, rate) in STREAMS {
        choose(browser, "stream", stream);
        std::thread::sleep(Duration::from_secs(1));
        browser.type_keys("#plot", " ");
        let mut readings = Vec::new();
        for _ in 0..8 {
            browser.type_keys("#plot", "p");
            readings.push(Reading::of(browser, "#cursor"));
        }
        browser.type_keys("#plot", &END.to_string());
        let wire = Wire::read(&shown.lines(), topic);
        let mut edges = 0;
        for reading in &readings {
            let level = match (reading.has("trigger high"), reading.has("trigger low")) {
                (true, false) => 1,
                (false, true) => 0,
                _ => continue,
            };
            edges += 1;
            let Reading { text, us, .. } = reading;
            // Device times are rounded to a microsecond.
            let edge = (us + 1) / EDGE_US;
            assert_eq!(edge % 2, level, "{text}");
            assert!((us + 1) % EDGE_US <= 1_000_000 / rate + 2, "{text}: late");
            if stream != "reconstructed" {
                let at = wire.at(*us);
                let around = [at - 1, at].map(|index| wire.samples[index].trigger);
                // The previous edge was lost on the cable, and with it a change of the level.
                let lost = text.contains("trigger edges lost: 1");
                let before = if lost { level } else { 1 - level };
                assert_eq!(around, [before, level], "{text}");
            }
        }
        assert!(edges >= 4, "{edges} edges on {stream}");
    }
}

/// Shows the oldest samples that the page has stored, and checks that the first of them dates from
/// the opening of the page. At that moment, the newest received sample had the device time
/// `opened`, in microseconds.
pub(super) fn the_history_reaches_back_to_the_opening_of_the_page(
    browser: &Browser,
    shown: &Shown,
    opened: u64,
) {
    /// Length of the plot's time axis, microseconds. After the key Home, the plot starts at the
    /// oldest sample, and the cursor is at the end of the axis.
    const PLOT_US: u64 = 10_000_000;
    /// Longest permitted device time from `opened` to the page's oldest sample, microseconds.
    const LATE_US: u64 = 1_000_000;
    choose(browser, "stream", "filtered");
    let wire = Wire::read(&shown.lines(), "/neurodata_corticode");
    assert!(wire.newest() > opened + PLOT_US + LATE_US, "the history is all on the plot");
    browser.type_keys("#plot", &HOME.to_string());
    let reading = moved(browser);
    assert!(reading.us < opened + PLOT_US + LATE_US, "{}", reading.text);
    // The page writes what is kept when it draws.
    let kept = || browser.text("#kept");
    wait_for("the oldest samples", || {
        kept().contains(" back; ") && kept().contains(" of at most 60 min")
    });
    browser.type_keys("#plot", &END.to_string());
    let value = wire.samples[wire.at(reading.us)].values[wire.channel(&reading.label)];
    assert_eq!(reading.value, format!("{value:.3}"));
    wait_for("the newest samples", || !kept().contains("back"));
}
