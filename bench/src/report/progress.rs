//! What a benchmark prints on the standard error while it runs.

use indicatif::{ProgressBar, ProgressStyle};

/// Returns a progress bar that is full after `ticks` increments.
pub(crate) fn bar(ticks: usize) -> ProgressBar {
    let bar = ProgressBar::new(ticks.try_into().unwrap_or(u64::MAX));
    match ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}") {
        Ok(style) => bar.with_style(style),
        // The template is malformed; the default style shows the same numbers.
        Err(_) => bar,
    }
}

/// Prints why parts of a benchmark are left out.
pub(crate) fn skipped<'s>(reasons: impl IntoIterator<Item = &'s String>) {
    for reason in reasons {
        eprintln!("SKIPPED: {reason}");
    }
}
