//! Checks of the live page's panels Spectrum, Code and Head.

use std::fs;
use std::time::Duration;

use acceptance::browser::Browser;
use acceptance::numpy_reference;
use acceptance::printing;
use acceptance::process::wait_for;
use serde_json::{Value, json};

use super::choose;
use super::reading::{DOWN, RIGHT, Reading, microseconds};
use super::shown::Shown;
use super::wire::Wire;

/// Bands on the panel: name, lower limit (included) and upper limit (excluded) in Hz.
const BANDS: [(&str, f64, f64); 5] = [
    ("delta", 1.0, 4.0),
    ("theta", 4.0, 8.0),
    ("alpha", 8.0, 13.0),
    ("beta", 13.0, 30.0),
    ("gamma", 30.0, 45.0),
];
/// Largest relative error of a value with five digits.
const ROUNDING: f64 = 6e-5;

/// Compares the spectrum with numpy's: for filtered samples as received, and for raw samples minus
/// the average of all electrodes but the excluded Cz.
pub(super) fn the_spectrum_is_that_of_numpy(browser: &Browser, shown: &Shown) {
    if !numpy_reference::available("the spectrum on the live page") {
        return;
    }
    for (stream, topic, rate, length) in
        [("filtered", "/neurodata_corticode", 128, 256), ("raw", "/neurodata", 512, 1024)]
    {
        let is_average = stream == "raw";
        choose(browser, "stream", stream);
        if is_average {
            browser.type_keys("#plot", "a");
        }
        let average = if is_average { ", to the average" } else { "" };
        let start = format!("{stream}{average}: ");
        browser.wait_for_text("#spectrum-note", &start);
        browser.type_keys("#plot", " ");
        browser.type_keys("#plot", &DOWN.to_string().repeat(7));
        let label = Reading::of(browser, "#cursor").label;
        browser.wait_for_text("#spectrum-cursor", &format!("{label} "));
        // The panel computes the spectrum of the paused plot within a few refreshes of the screen.
        std::thread::sleep(Duration::from_secs(2));
        let mut seen = Vec::new();
        for keys in [0, 1, 3, 10, 16] {
            browser.type_keys("#density", &RIGHT.to_string().repeat(keys));
            seen.push(browser.text("#spectrum-cursor"));
        }
        let (note, bands) = (browser.text("#spectrum-note"), browser.run(BAND_TEXTS));
        browser.type_keys("#plot", if is_average { "a " } else { " " });

        // The note reads, for example, `filtered: 15 segments of 2.00 s, 84.507813 to 100.500000 s;
        // 7 with ...`
        let words: Vec<&str> = note[start.len()..].split(' ').collect();
        let (used, [from, to]) = (words[0], [words[5], words[7]].map(microseconds));
        let wire = Wire::read(&shown.lines(), topic);
        let [from, to] = [from, to].map(|us| wire.at(us));
        let samples = from..=to;
        let value = |index| {
            if is_average {
                wire.to_average(index, &label)
            } else {
                wire.float32(index, wire.channel(&label))
            }
        };
        let fillers = samples.clone().map(|index| u8::from(wire.samples[index].is_filler));
        let given = json!({
            "rate": rate,
            "length": length,
            "values": samples.clone().map(value).collect::<Vec<f64>>(),
            "fillers": fillers.collect::<Vec<u8>>(),
        });
        let folder = shown.folder.path();
        fs::write(folder.join("samples.json"), given.to_string()).expect("samples");
        numpy_reference::run("live_page/welch.py", folder).expect("numpy's spectrum");
        let computed = fs::read_to_string(folder.join("spectrum.json")).expect("a spectrum");
        let computed: Value = serde_json::from_str(&computed).expect("JSON");
        assert_eq!(computed["used"].to_string(), used, "{note}");
        let density: Vec<f64> =
            serde_json::from_value(computed["density"].clone()).expect("numbers");
        let step = f64::from(rate) / f64::from(length);
        for text in &seen {
            let words: Vec<&str> = text.split(' ').collect();
            let [shown, hertz] =
                [words[1], words[4]].map(|word| word.parse::<f64>().expect("a number"));
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a bin")]
            let expected = density[(hertz / step).round() as usize];
            assert!((shown / expected - 1.0).abs() < ROUNDING, "{text}: {expected}");
        }
        assert!(seen.iter().skip(1).all(|text| *text != seen[0]), "{seen:?}");
        for ((name, low, high), shown) in BANDS.iter().zip(bands.as_array().expect("bands")) {
            let bins = (0_u32..).zip(&density).filter(|(bin, _)| {
                let hertz = f64::from(*bin) * step;
                (*low..*high).contains(&hertz)
            });
            let expected: f64 = bins.map(|(_, density)| density * step).sum();
            assert_eq!(shown[0], *name);
            let shown: f64 = shown[1].as_str().and_then(|text| text.parse().ok()).expect("a power");
            assert!((shown / expected - 1.0).abs() < ROUNDING, "{name}: {shown}, {expected}");
        }
    }
}

const BAND_TEXTS: &str = "return [...document.querySelectorAll('#bands tr')]
    .map((row) => [row.cells[0].textContent, row.cells[2].textContent])";

/// Compares the values of codes that the page shows with the JSON lines, and the bits per second
/// that it shows with the size of a code.
pub(super) fn codes_equal_the_lines(browser: &Browser, shown: &Shown) {
    let mut seen = Vec::new();
    for steps in 0..10 {
        browser.type_keys("#numbers", &RIGHT.to_string().repeat(steps));
        // The page draws a code at the next refresh of the screen.
        std::thread::sleep(Duration::from_millis(150));
        seen.push(Reading::of(browser, "#code-cursor"));
    }
    let wire = Wire::read(&shown.lines(), "/encoded");
    assert_eq!(wire.labels.len(), 128);
    for reading in &seen {
        let sample = &wire.samples[wire.at(reading.us)];
        let Reading { text, value, .. } = reading;
        let value: f64 = value.parse().expect("a number");
        let expected = sample.values[wire.channel(&reading.label)];
        assert!(value.total_cmp(&expected).is_eq(), "{text}: {expected}");
        assert_eq!(reading.has("replaced, was lost"), sample.is_filler, "{text}");
    }
    let mut labels: Vec<&String> = seen.iter().map(|reading| &reading.label).collect();
    labels.dedup();
    assert_eq!(labels.len(), 10, "{labels:?}");
    // 16 codes per second, each of 128 bytes and an exponent byte, less those that the cable loses.
    let bits = figure(browser, "codes, 128 numbers, bits/s").expect("bits per second");
    assert!((0.9..=1.001).contains(&(bits / 16512.0)), "{bits}");
    let audited = || figure(browser, "audit: RMS error, levels").is_some();
    wait_for("an audit", audited);
}

/// Compares the values that the page shows for the packed code with the reports in the JSON lines.
pub(super) fn packed_figures_equal_the_reports(browser: &Browser, shown: &Shown) {
    let audited = || figure(browser, "audit: packed error, uV RMS").is_some();
    wait_for("an audit of packed blocks", audited);
    let [bits, misfits] = ["packed code, bits/s", "blocks that do not fit (misfits)"]
        .map(|name| figure(browser, name).unwrap_or_else(|| panic!("no {name}")));
    let lines = shown.lines();
    let reports = printing::statuses(&lines, "packed code").filter_map(|status| {
        let value = |key| printing::figure(&status, key)?.parse::<f64>().ok();
        Some([value("bits per second")?, value("misfits")?])
    });
    let reports: Vec<[f64; 2]> = reports.collect();
    assert!(reports.contains(&[bits, misfits]), "{bits}, {misfits}: {reports:?}");
}

/// Returns the number at the beginning of the value that the panel Code shows for `name`; `None` if
/// it shows none.
fn figure(browser: &Browser, name: &str) -> Option<f64> {
    let script = format!(
        "const names = [...document.querySelectorAll('#code-figures dt')];
        return names.find((one) => one.textContent === {name:?})?.nextSibling.textContent ?? null;"
    );
    let text = browser.run(&script);
    text.as_str()?.split(' ').next()?.parse().ok()
}

/// Checks that the page stops showing an impedance when it is no longer measured.
pub(super) fn an_old_impedance_is_forgotten(browser: &Browser) {
    let says = browser.run(include_str!("stale_impedance.js"));
    let fresh = "Cz; 4.9 kOhm";
    assert_eq!(says, json!([fresh, fresh, fresh, fresh, "Cz"]));
}
