//! The live page in a browser: what it shows is what was received, and who it shows it to.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use acceptance::browser::{Browser, SIZE};
use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::printing::{board, bridge, messages};
use acceptance::process::Process;
use acceptance::workspace;
use rustix::process::Signal;
use serde_json::Value;

const TOKEN: &str = "a-token-of-the-test";
const TIMEOUT: Duration = Duration::from_mins(1);
/// Keys as WebDriver names them.
const LEFT: char = '\u{e012}';
const DOWN: char = '\u{e015}';
/// Flag of a sample that replaces a lost one.
const FILLER: u64 = 0x8000;

/// A board whose cable loses frames, and the bridge that serves the page and prints JSON.
struct Shown {
    folder: tempfile::TempDir,
    _board: Process,
    cable: LossyCable,
    bridge: Option<Process>,
    port: u16,
}

impl Shown {
    fn start() -> Shown {
        let folder = tempfile::tempdir().expect("a folder");
        let port = free_port().expect("a free port");
        let output = format!("tcp:127.0.0.1:{port}");
        let board = board(folder.path(), 600, &output);
        let mut shown = Shown {
            cable: LossyCable::new(port, 3).expect("a cable"),
            folder,
            _board: board,
            bridge: None,
            port: free_port().expect("a free port"),
        };
        shown.start_bridge(Some(TOKEN));
        shown
    }

    /// Starts a bridge with a token, or with a random one.
    fn start_bridge(&mut self, token: Option<&str>) {
        let address = format!("--view-address=127.0.0.1:{}", self.port);
        let arguments = [
            "--port",
            &self.cable.port,
            "--sink=view,ndjson",
            "--streams=codes,raw,filtered,events",
            "--exclude=Cz",
            &address,
        ];
        let token = token.map(|token| ["--view-token", token]);
        let arguments = [&arguments[..], token.as_slice().as_flattened()].concat();
        self.bridge = Some(bridge(self.folder.path(), "bridge", &arguments));
    }

    fn stop_bridge(&mut self) -> String {
        let bridge = self.bridge.take().expect("a bridge");
        let (log, lines) = (bridge.errors(), self.lines());
        assert!(bridge.stop(Signal::TERM, TIMEOUT).success(), "{log}");
        lines
    }

    fn lines(&self) -> String {
        self.bridge
            .as_ref()
            .map(Process::output)
            .unwrap_or_default()
    }

    fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Returns the newest value of `key` in the status `outlets`.
    fn figure(&self, key: &str) -> Option<u64> {
        let report = messages(&self.lines(), "/diagnostics").last()?;
        let status = report["status"].as_array()?.iter();
        let mut values =
            status.flat_map(|status| status["values"].as_array().into_iter().flatten());
        let value = values.find(|value| value["key"] == key)?;
        value["value"].as_str()?.parse().ok()
    }

    fn wait_for(&self, what: &str, holds: impl Fn(&Shown) -> bool) {
        let end = Instant::now() + TIMEOUT;
        while !holds(self) {
            assert!(Instant::now() < end, "{what}: not within {TIMEOUT:?}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

/// Steps from the first step of a reconstructed frame to the last one of its window, whose device
/// time all of the frame's steps have on the wire: 16 steps a window. The page shows that of each.
const LOOKBACK_STEPS: u64 = 15;

/// Returns value and flags of the sample at a device time, as in the JSON lines.
fn on_the_wire(lines: &str, topic: &str, label: &str, time: &str) -> Option<(f64, u64)> {
    messages(lines, topic).find_map(|frame| {
        let (block, labels, channel) = ["eeg", "exg"].iter().find_map(|name| {
            let labels = frame[name]["info"]["labels"].as_array()?;
            let channel = labels.iter().position(|one| one == label)?;
            Some((&frame[name], labels, channel))
        })?;
        let tri: Vec<u64> = frame["tri"]["data"]
            .as_array()?
            .iter()
            .filter_map(Value::as_u64)
            .collect();
        let sample = tri.chunks(8).enumerate().position(|(step, words)| {
            let mut us = words[3] | words[4] << 16 | words[5] << 32;
            if topic == "/neurodata_reconstructed" {
                us -= (LOOKBACK_STEPS - step as u64) * 1_000_000 / 128;
            }
            format!("{}.{:06}", us / 1_000_000, us % 1_000_000) == time
        })?;
        let value = block["data"][sample * labels.len() + channel].as_f64()?;
        Some((value, tri[8 * sample]))
    })
}

/// Draws one spike in 10 s of zeros, at many places, and returns those at which no pixel shows it.
/// The plot has fewer columns than the store has samples.
const HIDDEN_SPIKES: &str = r"
return Promise.all([import('/store.js'), import('/traces.js')]).then(async ([{Store}, {Traces}]) => {
  const canvas = document.createElement('canvas');
  canvas.style.cssText = 'position: fixed; width: 646px; height: 118px; left: 0; top: 0';
  document.body.append(canvas);
  await new Promise((done) => setTimeout(done, 200));
  const rate = 512, count = 10 * rate, hidden = [];
  const info = {nsamples: 1, nchannels: 1, unit: 'uV', transducer: '', labels: ['Cz']};
  const none = {...info, nchannels: 0, labels: []};
  for (let spike = 600; spike < count - 600; spike += 37) {
    const frame = (i) => {
      const us = Math.round(i * 1e6 / rate), tri = new Int32Array(8);
      tri[3] = us % 65536;
      tri[4] = Math.floor(us / 65536);
      return {seq: i, rate, eeg: info, eegData: Float32Array.of(i === spike ? 40 : 0), exg: none,
        exgData: new Float32Array(0), tri};
    };
    const store = new Store(frame(0));
    for (let i = 0; i < count; i += 1) store.append(frame(i));
    const traces = new Traces(canvas, () => {});
    traces.resize();
    traces.show(store, []);
    traces.draw(performance.now());
    const {left, width, height} = traces.geometry();
    const y = Math.round(traces.y(0, 20));
    const row = traces.context.getImageData(left, y, width, 1).data;
    const ground = row.slice(0, 4);
    let seen = 0;
    for (let x = 0; x < width; x += 1) if (row[4 * x] !== ground[0] || row[4 * x + 1] !== ground[1]) seen += 1;
    if (seen === 0) hidden.push(spike);
  }
  canvas.remove();
  return hidden;
});
";

/// Names of all controls without a name for a screen reader.
const NAMELESS: &str = r"
const named = (e) => e.labels?.length || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby') ||
  (e.tagName === 'BUTTON' && e.textContent.trim());
return [...document.querySelectorAll('select, input, button, canvas, svg, section, circle.electrode')]
  .filter((e) => !named(e)).map((e) => e.outerHTML.slice(0, 80));";

fn choose_stream(browser: &Browser, name: &str) {
    let script = format!(
        "const list = document.getElementById('stream');
        const option = [...list.options].find((one) => one.text === {name:?});
        if (!option) return false;
        list.value = option.value;
        list.dispatchEvent(new Event('change'));
        return true;"
    );
    let end = Instant::now() + TIMEOUT;
    while browser.run(&script) != true {
        assert!(Instant::now() < end, "no stream {name}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Returns the folder for pictures, of which docs/view.md shows copies.
fn pictures() -> PathBuf {
    let folder = workspace::root().join("target/view");
    fs::create_dir_all(&folder).expect("a folder for pictures");
    folder
}

#[test]
fn the_page_shows_what_was_received_to_those_who_may_see_it() {
    let mut shown = Shown::start();
    let test = "the live page in a browser";
    let Some(browser) = Browser::start(test, shown.folder.path()) else {
        return;
    };
    shown.wait_for("codes", |shown| shown.lines().contains("/encoded"));
    browser.prefer_dark(false);
    browser.open(&format!("{}#token={TOKEN}", shown.url()));
    browser.wait_for_text("#state", "streaming");
    values_equal_those_on_the_wire(&browser, &shown);
    assert_eq!(browser.console(), Vec::<String>::new());
    let hidden = browser.run(HIDDEN_SPIKES);
    assert_eq!(hidden, Value::Array(Vec::new()), "spikes");
    // The browser advises against reading pixels, which only this test does.
    browser.console();
    looks_right(&browser, &pictures());

    // A reload, and a second viewer at the same time.
    browser.reload();
    browser.wait_for_text("#state", "streaming");
    let [second, first] = browser.new_tab();
    browser.switch_to(&second);
    browser.open(&shown.url());
    browser.wait_for_text("#state", "streaming");
    shown.wait_for("two viewers", |shown| shown.figure("viewers") == Some(2));
    assert_eq!(browser.console(), Vec::<String>::new());

    // A wrong token, and then the right one.
    browser.open("about:blank");
    browser.open(&format!("{}#token=another-token-of-a-test", shown.url()));
    browser.wait_for_text("#state", "the token is missing or wrong");
    browser.type_keys("#token", &format!("{TOKEN}\n"));
    browser.wait_for_text("#state", "streaming");

    // A page of another origin can neither read the stream nor stop the device.
    browser.open("data:text/html,<p>foreign");
    let foreign = format!(
        "const get = fetch('{0}stream').then(() => 'read', () => 'refused');
        const post = fetch('{0}stop', {{method: 'POST', mode: 'no-cors'}}).catch(() => {{}});
        return post.then(() => get);",
        shown.url()
    );
    assert_eq!(browser.run(&foreign), "refused");

    // The bridge ends and starts again.
    browser.switch_to(&first);
    browser.wait_for_text("#state", "streaming");
    shown.stop_bridge();
    browser.wait_for_text("#state", "the bridge is lost");
    shown.start_bridge(Some(TOKEN));
    browser.wait_for_text("#state", "streaming");
    let hidden = "return document.getElementById('commands').hidden";
    assert_eq!(browser.run(hidden), false);

    // The bridge starts again with a random token, without which the page may look.
    shown.stop_bridge();
    browser.wait_for_text("#state", "the bridge is lost");
    shown.start_bridge(None);
    browser.wait_for_text("#state", "streaming");
    assert_eq!(browser.run(hidden), true);
    println!(
        "number, mean and longest time of drawings, ms: {}",
        browser.run("return document.body.dataset.drawn")
    );
}

/// Moves the cursor by keys, and compares what it shows with the JSON lines.
fn values_equal_those_on_the_wire(browser: &Browser, shown: &Shown) {
    for (stream, topic) in [
        ("reconstructed", "/neurodata_reconstructed"),
        ("filtered", "/neurodata_corticode"),
        ("raw", "/neurodata"),
    ] {
        choose_stream(browser, stream);
        std::thread::sleep(Duration::from_secs(3));
        browser.type_keys("#plot", " ");
        let mut seen = Vec::new();
        for _ in 0..12 {
            browser.type_keys(
                "#plot",
                &format!("{LEFT}{LEFT}{LEFT}{LEFT}{LEFT}{LEFT}{LEFT}{DOWN}{DOWN}{DOWN}"),
            );
            seen.push(browser.text("#cursor"));
        }
        browser.type_keys("#plot", " ");
        let lines = shown.lines();
        for text in &seen {
            let mut parts = text.split([' ', ';']);
            let mut part = |count| parts.nth(count).unwrap_or_default();
            let (label, value, unit, time) = (part(0), part(0), part(0), part(1));
            let wire = on_the_wire(&lines, topic, label, time);
            let (expected, flags) = wire.unwrap_or_else(|| panic!("{text} is not on {topic}"));
            assert_eq!(
                (value, unit),
                (format!("{expected:.3}").as_str(), "uV"),
                "{text}"
            );
            assert_eq!(
                text.contains("replaced, was lost"),
                flags & FILLER != 0,
                "{text}"
            );
            let excluded = if stream == "reconstructed" {
                "electrode filled from the others"
            } else {
                "electrode excluded from the codes"
            };
            assert_eq!(text.contains(excluded), label == "Cz", "{text}");
        }
        seen.dedup();
        assert_eq!(seen.len(), 12, "the cursor stands still: {seen:?}");
    }
}

/// Checks size and names, and draws the page in light and dark.
fn looks_right(browser: &Browser, folder: &Path) {
    assert_eq!(
        browser.run(NAMELESS),
        Value::Array(Vec::new()),
        "without a name"
    );
    let size =
        "return [document.documentElement.scrollWidth, document.documentElement.scrollHeight]";
    assert_eq!(browser.run(size), serde_json::json!(SIZE));
    let label = "return document.querySelectorAll('circle.electrode').length";
    assert_eq!(browser.run(label), 61);
    choose_stream(browser, "reconstructed");
    std::thread::sleep(Duration::from_secs(10));
    browser.draw(&folder.join("light.webp"));
    browser.prefer_dark(true);
    choose_stream(browser, "raw");
    std::thread::sleep(Duration::from_secs(2));
    browser.draw(&folder.join("dark.webp"));
    browser.prefer_dark(false);
    for name in ["light.webp", "dark.webp"] {
        let bytes = fs::metadata(folder.join(name)).expect("a picture").len();
        assert!(bytes > 20_000, "{name} has {bytes} bytes");
    }
}
