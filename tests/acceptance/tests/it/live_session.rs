//! The live page's panel for recordings, markers, self-tests and exclusions, in a browser.

mod testing_board;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use acceptance::browser::Browser;
use acceptance::port::free_port;
use acceptance::printing::{board, bridge, messages};
use acceptance::process::{Process, SLACK, wait_for};
use acceptance::workspace;
use link::{ChannelFault, ChannelTest, ChipTest, SelfTest};
use rustix::process::Signal;
use serde_json::Value;

use self::testing_board::TestingBoard;

const TOKEN: &str = "a-token-of-the-test";
/// Event code of a marker on `/events/bus` and in files.
const MARKER: u64 = 0x7f05;

/// Result of a self-test of 64 channels, of which the sixth is too noisy.
fn result() -> SelfTest {
    let chip = ChipTest { id: 0x3E, ..ChipTest::default() };
    let mut channels = [ChannelTest {
        gain_error: 0.002,
        offset_uv: 41.5,
        noise_uv: 0.14,
        shorted_noise_uv: 0.13,
        fault: ChannelFault::None,
    }; 64];
    channels[5].noise_uv = 3.5;
    channels[5].fault = ChannelFault::Noisy;
    SelfTest {
        drdy_millihertz: 512_000,
        expected_millihertz: 512_000,
        chips: [chip; 8].into_iter().collect(),
        channels: channels.into_iter().collect(),
        ..SelfTest::default()
    }
}

/// Presses a button as a user without a mouse does.
fn press(browser: &Browser, id: &str) {
    browser.type_keys(&format!("#{id}"), "\n");
}

fn choose(browser: &Browser, id: &str, value: &str) {
    let script = format!(
        "const list = document.getElementById({id:?});
        list.value = {value:?};
        list.dispatchEvent(new Event('change'));"
    );
    browser.run(&script);
}

/// Returns the lines of the browser's console, without reports of refused requests.
fn faults(browser: &Browser) -> Vec<String> {
    let mut lines = browser.console();
    lines.retain(|line| !line.contains("the server responded with a status of 4"));
    lines
}

fn only_file(folder: &Path) -> PathBuf {
    let mut files = fs::read_dir(folder).expect("a folder");
    let file = files.next().expect("a recording").expect("a file");
    assert!(files.next().is_none(), "another file");
    file.path()
}

#[test]
fn a_session_is_recorded_marked_and_tested_from_the_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(browser) = Browser::start("the live page's session", folder.path()) else {
        return;
    };
    let records = folder.path().join("records");
    fs::create_dir(&records).expect("a folder for recordings");
    let port = free_port().expect("a free port");
    let _board = board(folder.path(), 600, &format!("tcp:127.0.0.1:{port}"));
    let cable = TestingBoard::new(port, result()).expect("a cable");
    let page = free_port().expect("a free port");
    let bridge = bridge(
        folder.path(),
        "bridge",
        &[
            "--port",
            &cable.port,
            "--sink=view,ndjson",
            "--streams=codes,packed,raw,filtered,events",
            &format!("--view-address=127.0.0.1:{page}"),
            &format!("--view-token={TOKEN}"),
            &format!("--record-dir={}", records.display()),
        ],
    );
    wait_for("codes", || bridge.output().contains("/encoded"));
    browser.prefer_dark(false);

    // Without the token, all controls are visible but disabled, and the page says what is missing.
    browser.open(&format!("http://127.0.0.1:{page}/"));
    browser.wait_for_text("#state", "streaming");
    browser.wait_for_text("#needs", "Commands need the token");
    let disabled = "return document.getElementById('session-controls').disabled";
    assert_eq!(browser.run(disabled), true);
    browser.type_keys("#token", "a-wrong-token-of-a-test\n");
    browser.wait_for_text("#needs", "This token is wrong");
    browser.type_keys("#token", &format!("\u{e009}a\u{e000}{TOKEN}\n"));
    browser.wait_for_text("#state", "streaming");
    wait_for("the controls", || browser.run(disabled) == false);
    assert_eq!(browser.text("#needs"), "");

    // While the bridge records, the file must grow.
    press(&browser, "record");
    browser.wait_for_text("#record", "Stop recording");
    browser.wait_for_text("#answer", "recording to ");
    let file = only_file(&records);
    let length = || fs::metadata(&file).expect("the recording").len();
    wait_for("a growing file", || length() > 1_000_000);
    wait_for("the disk", || browser.text("#left").contains(" left in "));
    let name = file.file_name().expect("a name").to_string_lossy();
    wait_for("name and size", || {
        browser.text("#recording").contains(" MB") && browser.text("#left").contains(&*name)
    });

    // A marker must appear in the page's list, among the events and in the recording.
    browser.type_keys("#marker-text", "eyes closed\n");
    browser.wait_for_text("#answer", "marked in the recording and among the events");
    browser.wait_for_text("#markers li span", "eyes closed");
    let has_marker =
        |event: Value| event["event"] == MARKER && event["description"] == "eyes closed";
    wait_for("the event", || messages(&bridge.output(), "/events/bus").any(has_marker));

    browser.type_keys("#marker-text", "eyes open, relaxed\n");
    browser.wait_for_text("#markers li span", "eyes open, relaxed");
    draw(&browser, false, "record", "session.webp");

    // Exclude an electrode by the page's controls, and change the rate of the packed code.
    choose(&browser, "electrode", "Cz");
    press(&browser, "exclude-always");
    browser.wait_for_text("#device-answer", "Cz is excluded from the codes");
    let substituted = "return document.querySelectorAll('circle.substituted').length";
    wait_for("the head", || browser.run(substituted) == 1);
    press(&browser, "exclude-never");
    browser.wait_for_text("#device-answer", "Cz is never excluded");
    wait_for("the head", || browser.run(substituted) == 0);
    choose(&browser, "rate", "7");
    press(&browser, "set-rate");
    browser.wait_for_text("#device-answer", "the packed code has rate 7");
    browser.wait_for_text("#present-rate", "now 7");

    // A self-test needs a stopped device.
    press(&browser, "self-test");
    browser.wait_for_text("#device-answer", "self-test is refused: the device streams");
    press(&browser, "stop");
    browser.wait_for_text("#answer", "the device is stopped");
    press(&browser, "self-test");
    browser.wait_for_text("#verdict", "NOT IN ORDER: 1 of 64 channels");
    let rows =
        "return [...document.querySelectorAll('#channels tr')].map((row) => row.textContent)";
    let rows = browser.run(rows);
    let rows = rows.as_array().expect("rows");
    assert_eq!(rows.len(), 64);
    assert!(rows[5].as_str().is_some_and(|row| row.contains("3.50") && row.contains("too loud")));
    press(&browser, "start");
    browser.wait_for_text("#answer", "the device streams");
    browser.wait_for_text("#state", "streaming");

    // Show raw samples, which need no time for filters to settle.
    choose(&browser, "stream", "4");
    draw(&browser, true, "verdict", "device.webp");
    press(&browser, "record");
    browser.wait_for_text("#record", "Record");
    browser.wait_for_text("#answer", &file.display().to_string());
    assert!(browser.text("#answer").contains("2 markers, 0 bytes lost"));
    assert_eq!(faults(&browser), Vec::<String>::new());
    let log = bridge.errors();
    assert!(bridge.stop(Signal::TERM, SLACK).success(), "{log}");
    marker_is_converted(folder.path(), &file);
}

/// Draws the page, scrolled to the element `shown`, in light or dark.
fn draw(browser: &Browser, is_dark: bool, shown: &str, name: &str) {
    let folder = workspace::root().join("target/view");
    fs::create_dir_all(&folder).expect("a folder for pictures");
    browser.prefer_dark(is_dark);
    let scroll = "scrollIntoView({block: 'center'})";
    browser.run(&format!("document.getElementById({shown:?}).{scroll}"));
    std::thread::sleep(Duration::from_secs(3));
    browser.draw(&folder.join(name));
    browser.prefer_dark(false);
}

/// Converts the recording. Checks that each table has each of the two markers once, and does not
/// begin with fillers for the time before the recording.
fn marker_is_converted(folder: &Path, file: &Path) {
    let name = file.display().to_string();
    let mut converting: Process = bridge(folder, "converting", &["convert", &name, "--to=csv"]);
    assert!(converting.wait(SLACK).success(), "{}", converting.log());
    for stream in ["codes", "reconstructed", "raw", "filtered"] {
        let table = file.with_extension(format!("{stream}.csv"));
        let text = fs::read_to_string(table).expect("a table");
        let rows: Vec<Vec<&str>> =
            text.lines().skip(1).map(|row| row.split(',').collect()).collect();
        let marker = MARKER.to_string();
        let marked = rows.iter().filter(|row| row[3].split(';').any(|code| code == marker));
        assert_eq!(marked.count(), 2, "rows with markers in {stream}");
        let is_filler =
            |row: &&Vec<&str>| row[4].parse::<u32>().is_ok_and(|flags| flags & 0x8000 != 0);
        let before = rows.iter().take(rows.len() / 4).filter(is_filler).count();
        assert_eq!(before, 0, "fillers at the beginning of {stream}");
    }
}
