//! Checks of the memory that the page's history takes, and of the duration of a drawing.

use acceptance::browser::Browser;
use serde_json::Value;

/// Time between two frames of a screen, milliseconds.
const FRAME_MS: f64 = 1000.0 / 60.0;
const MIB: f64 = 1_048_576.0;

/// Checks that the page draws a plot in less time than a frame of the screen lasts. The checked
/// time is the smallest of ten medians, each over a second of drawings. The other times that the
/// script measures depend on the machine's load and are only printed. Chromium draws in software
/// here, without a graphics card.
pub(super) fn a_drawing_takes_less_than_a_frame(browser: &Browser) {
    let results = browser.run(include_str!("frame_time.js"));
    let results = results.as_array().expect("results");
    assert_eq!(results.len(), 4);
    for result in results {
        let [name, times @ ..] = &result.as_array().expect("a result")[..] else {
            panic!("{result}");
        };
        let times: Vec<f64> = times.iter().filter_map(Value::as_f64).collect();
        println!(
            "{}: drawing {:.2} ms in the median, p99 {:.2} ms, longest {:.2} ms",
            name.as_str().unwrap_or_default(),
            times[0],
            times[1],
            times[2]
        );
        assert!(times[3] < FRAME_MS, "{result}");
    }
}

/// Checks that the page stores an hour of samples, that it loses none, and that its memory grows
/// only with the number of stored samples.
pub(super) fn an_hour_is_kept_in_bounded_memory(browser: &Browser) {
    let result = browser.run(include_str!("an_hour.js"));
    assert_eq!(result["mistakes"], Value::Array(Vec::new()));
    let numbers = |of: &str, key: &str| -> Vec<f64> {
        let list = result[of][key].as_array().into_iter().flatten();
        list.filter_map(Value::as_f64).collect()
    };
    let (steps, tablet) = (numbers("steps", "bytes"), numbers("tablet", "bytes"));
    let drawings = numbers("steps", "drawings");
    println!(
        "61 traces at 128 Hz: {:.1} MiB after a minute, {:.1} after 10, {:.1} after 60, {:.1} after 65; \
         whole drawings {:.1} ms after a minute, {:.1} ms after 65",
        steps[0] / MIB,
        steps[9] / MIB,
        steps[59] / MIB,
        steps[64] / MIB,
        drawings[0],
        drawings[64]
    );
    // A sample takes 61 values of 4 bytes, and 11 bytes for time, flags and trigger. The page
    // allocates memory in chunks of 4096 samples.
    let (sample, chunk) = (255.0, 4096.0);
    for (minute, bytes) in (1_u32..=60).zip(&steps) {
        let samples = f64::from(minute) * 60.0 * 128.0;
        assert!(
            *bytes >= sample * samples && *bytes < sample * (samples + chunk),
            "{minute}: {bytes}"
        );
    }
    assert!(steps[64] < sample * (3600.0 * 128.0 + 2.0 * chunk), "{}", steps[64]);
    let seconds = result["steps"]["seconds"].as_f64().expect("seconds");
    assert!((3599.9..3664.0).contains(&seconds), "{seconds} s");
    // 64 MiB are eight minutes of 64 channels at 512 Hz.
    assert!(tablet.iter().all(|bytes| *bytes <= 64.0 * MIB), "{tablet:?}");
    let seconds = result["tablet"]["seconds"].as_f64().expect("seconds");
    assert!((464.0..500.0).contains(&seconds), "{seconds} s");
}
