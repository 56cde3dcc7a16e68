//! Checks the page's layout at several sizes and the names of its controls, and draws pictures of
//! the page in light and dark.

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use acceptance::browser::{Browser, SIZE};
use acceptance::workspace;
use serde_json::Value;

use super::choose;

/// Sizes of the page in CSS pixels: a screen, a tablet on its side, and an upright tablet.
const SIZES: [[u32; 2]; 3] = [SIZE, [1024, 768], [820, 1180]];

/// Script that returns all controls without a name for a screen reader.
const NAMELESS: &str = r"
const named = (e) => e.labels?.length || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby') ||
  (e.tagName === 'BUTTON' && e.textContent.trim());
return [...document.querySelectorAll('select, input, button, canvas, svg, section, circle.electrode')]
  .filter((e) => !named(e)).map((e) => e.outerHTML.slice(0, 80));";

/// Returns the folder for pictures, of which docs/view.md shows copies.
fn pictures() -> PathBuf {
    let folder = workspace::root().join("target/view");
    fs::create_dir_all(&folder).expect("a folder for pictures");
    folder
}

/// Checks the names of the controls, and the layout at all sizes; draws the page in light and dark.
pub(super) fn the_page_looks_right(browser: &Browser) {
    let none = Value::Array(Vec::new());
    assert_eq!(browser.run(NAMELESS), none, "without a name");
    let electrodes = "return document.querySelectorAll('circle.electrode').length";
    assert_eq!(browser.run(electrodes), 61);
    for size in SIZES {
        browser.resize(size);
        std::thread::sleep(Duration::from_millis(500));
        let layout = browser.run(include_str!("layout.js"));
        assert_eq!(layout[0], none, "at {size:?}");
        assert!(layout[1].as_u64() >= Some(4), "{layout} panels");
    }
    choose(browser, "stream", "reconstructed");
    choose(browser, "which", "all shown");
    std::thread::sleep(Duration::from_secs(5));
    draw(browser, "upright.webp");
    browser.resize(SIZE);
    choose(browser, "stream", "filtered");
    choose(browser, "over", "reconstructed");
    choose(browser, "time", "5 s");
    show(browser, "Fp1 F3 Fz F4 C3 Cz C4 P3 Pz P4 O1 Oz O2");
    std::thread::sleep(Duration::from_secs(2));
    let chosen = "return document.querySelector('circle.chosen + text').textContent";
    assert_eq!(browser.run(chosen), "Fp1", "the first of the shown electrodes");
    draw(browser, "light.webp");
    browser.prefer_dark(true);
    choose(browser, "over", "none");
    choose(browser, "stream", "raw");
    choose(browser, "time", "10 s");
    show(browser, "");
    browser.run("document.getElementById('numbers').scrollIntoView()");
    std::thread::sleep(Duration::from_secs(2));
    draw(browser, "dark.webp");
    browser.prefer_dark(false);
    browser.run("document.querySelector('aside').scrollTop = 0");
    choose(browser, "which", "the electrode");
}

/// Shows the electrodes with these labels; with an empty text, all electrodes.
fn show(browser: &Browser, labels: &str) {
    browser.run(&format!(
        "const field = document.getElementById('shown');
        field.value = {labels:?};
        field.dispatchEvent(new Event('change'));"
    ));
}

fn draw(browser: &Browser, name: &str) {
    browser.run("document.activeElement.blur()");
    let path = pictures().join(name);
    browser.draw(&path);
    let bytes = fs::metadata(path).expect("a picture").len();
    assert!(bytes > 20_000, "{name} has {bytes} bytes");
}
