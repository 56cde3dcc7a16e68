//! What the page shows about the sample at its cursor.

use acceptance::browser::Browser;

/// Characters that stand for keys in WebDriver.
pub(super) const LEFT: char = '\u{e012}';
pub(super) const RIGHT: char = '\u{e014}';
pub(super) const DOWN: char = '\u{e015}';
pub(super) const HOME: char = '\u{e011}';
pub(super) const END: char = '\u{e010}';

/// What the page shows for a sample: a line such as `Fz 1.234 uV at 5.000000 s; replaced, was
/// lost`, and its parts.
pub(super) struct Reading {
    pub(super) text: String,
    pub(super) label: String,
    pub(super) value: String,
    /// Device time, microseconds.
    pub(super) us: u64,
    /// Parts of the line after the first semicolon, split at semicolons.
    pub(super) notes: Vec<String>,
}

impl Reading {
    /// Reads the line in the element `selector`.
    ///
    /// # Panics
    /// When the element does not contain such a line.
    pub(super) fn of(browser: &Browser, selector: &str) -> Reading {
        let text = browser.text(selector);
        let mut parts = text.split("; ").map(str::to_owned);
        let first = parts.next().unwrap_or_default();
        let notes = parts.collect();
        let words: Vec<&str> = first.split(' ').collect();
        let &[label, value, .., time, "s"] = &words[..] else {
            panic!("{text:?} has no value");
        };
        Reading {
            label: label.to_owned(),
            value: value.to_owned(),
            us: microseconds(time),
            notes,
            text,
        }
    }

    pub(super) fn has(&self, note: &str) -> bool {
        self.notes.iter().any(|one| one == note)
    }
}

/// Converts a time in seconds with six decimal places to microseconds.
pub(super) fn microseconds(seconds: &str) -> u64 {
    let digits = seconds.replace('.', "");
    digits.parse().unwrap_or_else(|_| panic!("{seconds:?} is no time"))
}
