//! A browser without a window, which a test controls through WebDriver.

use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{Ipv4Addr, TcpStream};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD as BASE64;
use emulator::skip::skip_unless_required;
use serde_json::{Value, json};

use crate::port::free_port;
use crate::process::Process;

/// Longest wait for a condition, enough on a busy machine.
const TIMEOUT: Duration = Duration::from_mins(1);
/// Time limit for a script; some scripts draw thousands of pictures on a busy machine.
const SCRIPT_TIMEOUT: Duration = Duration::from_mins(5);
/// Time between two checks of a condition.
const POLL: Duration = Duration::from_millis(50);
/// Size of the page, CSS pixels.
pub const SIZE: [u32; 2] = [1280, 720];

/// Debian's Chromium, with one session of `chromedriver`.
#[derive(Debug)]
pub struct Browser {
    port: u16,
    session: String,
    _driver: Process,
}

impl Browser {
    /// Starts a browser. Returns `None`, and reports `test` as skipped, if none is installed.
    ///
    /// # Panics
    /// When the browser does not start, or is missing and `CORTICODE_REQUIRE_ROS=1`.
    pub fn start(test: &str, folder: &Path) -> Option<Browser> {
        let version = Command::new("chromedriver").arg("--version").output();
        if version.is_err() {
            let why = "no chromedriver; `cargo xtask install` installs chromium-driver";
            skip_unless_required(test, why);
            return None;
        }
        let port = free_port().expect("a free port");
        let mut driver = Command::new("chromedriver");
        driver.arg(format!("--port={port}"));
        let driver = Process::start("driver", &mut driver, folder).expect("chromedriver starts");
        let end = Instant::now() + TIMEOUT;
        while exchange(port, "GET", "/status", None).is_err() {
            assert!(Instant::now() < end, "{}", driver.log());
            std::thread::sleep(POLL);
        }
        // Run without sandbox, because root cannot use it; the only page shown is the project's.
        let arguments =
            ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars"];
        let wanted = json!({"capabilities": {"alwaysMatch": {
            "timeouts": {"script": SCRIPT_TIMEOUT.as_millis()},
            "goog:loggingPrefs": {"browser": "ALL"},
            "goog:chromeOptions": {"args": arguments},
        }}});
        let session = exchange(port, "POST", "/session", Some(&wanted)).expect("a session");
        let session = session["sessionId"].as_str().expect("its id").to_owned();
        let browser = Browser { port, session, _driver: driver };
        browser.resize(SIZE);
        Some(browser)
    }

    /// Sets width and height of the page, CSS pixels.
    pub fn resize(&self, [width, height]: [u32; 2]) {
        let metrics =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.tell("Emulation.setDeviceMetricsOverride", &metrics);
    }

    /// Opens `url` in the current tab, and returns once the page has loaded.
    pub fn open(&self, url: &str) {
        self.post("url", &json!({"url": url}));
    }

    /// Loads the page again.
    pub fn reload(&self) {
        self.post("refresh", &json!({}));
    }

    /// Opens an empty tab in the background. Returns the handles of the new and of the current tab.
    pub fn new_tab(&self) -> [Value; 2] {
        let present = self.command("GET", "window", None);
        let new = self.post("window/new", &json!({"type": "tab"}))["handle"].take();
        [new, present]
    }

    /// Makes `tab` the current tab.
    pub fn switch_to(&self, tab: &Value) {
        self.post("window", &json!({"handle": tab}));
    }

    /// Runs a function's body in the page. Returns its result, or the value of a returned promise.
    pub fn run(&self, script: &str) -> Value {
        self.post("execute/sync", &json!({"script": script, "args": []}))
    }

    /// Returns the text of the first element that matches the selector.
    pub fn text(&self, selector: &str) -> String {
        let script = format!("return document.querySelector({selector:?}).textContent");
        self.run(&script).as_str().unwrap_or_default().to_owned()
    }

    /// Types keys into an element, as a user does.
    ///
    /// # Panics
    /// When the page has no such element.
    pub fn type_keys(&self, selector: &str, keys: &str) {
        let using = json!({"using": "css selector", "value": selector});
        let element = self.post("element", &using);
        let id = element.as_object().and_then(|element| element.values().next());
        let id = id.and_then(Value::as_str).expect("an element");
        self.post(&format!("element/{id}/value"), &json!({"text": keys}));
    }

    /// Waits until the text of an element starts with `text`.
    ///
    /// # Panics
    /// When it does not within a minute.
    pub fn wait_for_text(&self, selector: &str, text: &str) {
        let end = Instant::now() + TIMEOUT;
        loop {
            let found = self.text(selector);
            if found.starts_with(text) {
                return;
            }
            assert!(Instant::now() < end, "{selector}: {found:?} instead of {text:?}");
            std::thread::sleep(POLL);
        }
    }

    /// Makes the browser prefer dark or light pages, as a user's desktop does.
    pub fn prefer_dark(&self, dark: bool) {
        let value = if dark { "dark" } else { "light" };
        let feature = json!({"name": "prefers-color-scheme", "value": value});
        self.tell("Emulation.setEmulatedMedia", &json!({"features": [feature]}));
    }

    /// Writes a picture of the page to a WebP file, which takes a sixth of a PNG's bytes.
    ///
    /// # Panics
    /// When the file cannot be written.
    pub fn draw(&self, path: &Path) {
        let format = json!({"format": "webp", "quality": 40});
        let picture = self.tell("Page.captureScreenshot", &format)["data"].take();
        let bytes = BASE64.decode(picture.as_str().expect("a picture"));
        std::fs::write(path, bytes.expect("base64")).expect("a picture is written");
    }

    /// Returns the lines of the console since the last call.
    pub fn console(&self) -> Vec<String> {
        let lines = self.post("se/log", &json!({"type": "browser"}));
        let lines = lines.as_array().into_iter().flatten();
        lines.map(|line| line["message"].to_string()).collect()
    }

    fn tell(&self, command: &str, parameters: &Value) -> Value {
        let command = json!({"cmd": command, "params": parameters});
        self.post("goog/cdp/execute", &command)
    }

    fn post(&self, path: &str, body: &Value) -> Value {
        self.command("POST", path, Some(body))
    }

    fn command(&self, method: &str, path: &str, body: Option<&Value>) -> Value {
        let path = format!("/session/{}/{path}", self.session);
        exchange(self.port, method, &path, body).unwrap_or_else(|error| panic!("{path}: {error}"))
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // This request ends the browser; the driver is killed when its process is dropped.
        let _ = exchange(self.port, "DELETE", &format!("/session/{}", self.session), None);
    }
}

/// Sends a request to `chromedriver` and returns the value of its answer.
fn exchange(port: u16, method: &str, path: &str, body: Option<&Value>) -> io::Result<Value> {
    let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, port))?;
    stream.set_read_timeout(Some(SCRIPT_TIMEOUT + TIMEOUT))?;
    let body = body.map(Value::to_string).unwrap_or_default();
    let length = body.len();
    write!(
        stream,
        "{method} {path} HTTP/1.1\r\nHost: localhost:{port}\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n{body}"
    )?;
    let mut answer = BufReader::new(stream);
    let (mut head, mut length) = (String::new(), 0);
    while !head.ends_with("\r\n\r\n") && answer.read_line(&mut head)? > 0 {
        let line = head.lines().next_back().unwrap_or_default().to_ascii_lowercase();
        if let Some(number) = line.strip_prefix("content-length:") {
            length = number.trim().parse().map_err(io::Error::other)?;
        }
    }
    let mut body = vec![0; length];
    answer.read_exact(&mut body)?;
    let mut value = serde_json::from_slice::<Value>(&body)?["value"].take();
    if head.starts_with("HTTP/1.1 200") {
        Ok(value)
    } else {
        Err(io::Error::other(value["message"].take().to_string()))
    }
}
