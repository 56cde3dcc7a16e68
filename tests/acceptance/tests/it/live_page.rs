//! Tests the live page in a browser: the page shows what the bridge has received, and only to those
//! who may see it.

mod looks;
mod measured;
mod panels;
mod reading;
mod shown;
mod traces;
mod wire;

use acceptance::browser::Browser;
use acceptance::process::wait_for;
use serde_json::Value;

use shown::{Shown, TOKEN};

/// Chooses the entry `name` of a list, as soon as the list has it.
fn choose(browser: &Browser, list: &str, name: &str) {
    let script = format!(
        "const list = document.getElementById({list:?});
        const option = [...list.options].find((one) => one.text === {name:?});
        if (!option) return false;
        list.value = option.value;
        list.dispatchEvent(new Event('change'));
        return true;"
    );
    wait_for(&format!("{list} {name}"), || browser.run(&script) == true);
}

#[test]
fn the_page_shows_what_was_received_to_those_who_may_see_it() {
    let mut shown = Shown::start();
    let test = "the live page in a browser";
    let Some(browser) = Browser::start(test, shown.folder.path()) else {
        return;
    };
    wait_for("codes", || shown.lines().contains("/encoded"));
    browser.prefer_dark(false);
    browser.open(&format!("{}#token={TOKEN}", shown.url()));
    browser.wait_for_text("#state", "streaming");
    let opened = wire::Wire::read(&shown.lines(), "/neurodata_corticode").newest();
    traces::values_equal_those_on_the_wire(&browser, &shown);
    traces::events_are_at_their_samples(&browser, &shown);
    panels::codes_equal_the_lines(&browser, &shown);
    panels::an_old_impedance_is_forgotten(&browser);
    panels::the_spectrum_is_that_of_numpy(&browser, &shown);
    traces::the_history_reaches_back_to_the_opening_of_the_page(&browser, &shown, opened);
    assert_eq!(browser.console(), Vec::<String>::new());
    traces::two_streams_and_the_average_are_those_on_the_wire(&browser, &shown);
    for script in [
        include_str!("live_page/hidden_spikes.js"),
        include_str!("live_page/unbroken.js"),
        include_str!("live_page/incremental.js"),
        include_str!("live_page/restart.js"),
    ] {
        let found = browser.run(script);
        assert_eq!(found, Value::Array(Vec::new()), "{script}");
    }
    measured::a_drawing_takes_less_than_a_frame(&browser);
    measured::an_hour_is_kept_in_bounded_memory(&browser);
    // Discard the browser's advice against reading pixels from a canvas: only this test does that.
    browser.console();
    looks::the_page_looks_right(&browser);
    assert_eq!(browser.console(), Vec::<String>::new());

    // Reload the page, and open it in a second tab at the same time.
    browser.reload();
    browser.wait_for_text("#state", "streaming");
    let [second, first] = browser.new_tab();
    browser.switch_to(&second);
    browser.open(&shown.url());
    browser.wait_for_text("#state", "streaming");
    wait_for("two viewers", || shown.figure("viewers") == Some(2));
    assert_eq!(browser.console(), Vec::<String>::new());

    // Try a wrong token, and then the right one.
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
    shown.start_bridge(Some(TOKEN), "codes,raw,filtered,events");
    browser.wait_for_text("#state", "streaming");
    let hidden = "return document.getElementById('commands').hidden";
    assert_eq!(browser.run(hidden), false);

    // The bridge starts again with a random token, which the page does not have: it shows the
    // streams, but no commands.
    shown.stop_bridge();
    browser.wait_for_text("#state", "the bridge is lost");
    shown.start_bridge(None, "codes,packed,audit");
    browser.wait_for_text("#state", "streaming");
    assert_eq!(browser.run(hidden), true);
    panels::packed_figures_equal_the_reports(&browser, &shown);
    println!(
        "number, median, 99th percentile and longest time of drawings, ms: {}",
        browser.run("return document.body.dataset.drawn")
    );
}
