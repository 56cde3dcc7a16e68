//! Draws the progress bar of the demo, with the newest sequence number and the number of lost
//! codes.

use indicatif::{ProgressBar, ProgressStyle};

use crate::run::Run;

/// Number of codes from one printed line to the next, if no terminal can show a bar: one line every
/// 5 s.
const LINE_EVERY: usize = 80;

/// Returns a progress bar that is full after `codes` codes. Dropping the bar clears it from the
/// terminal.
pub(crate) fn bar(codes: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{elapsed_precise} {bar:16} {msg}");
    ProgressBar::new(codes).with_style(style.unwrap_or(ProgressStyle::default_bar()))
}

/// Shows the sequence number of the newest frame and the number of lost codes.
pub(crate) fn show(bar: &ProgressBar, run: &Run) {
    let Some(latest) = run.codes.last() else {
        return;
    };
    let fillers = run.codes.len() - run.received();
    let counts = format!("frame {:4}  lost {fillers}", latest.frame.neuroheader.seq);
    bar.inc(1);
    if bar.is_hidden() && run.codes.len().is_multiple_of(LINE_EVERY) {
        new_file::message!("{counts}");
    }
    bar.set_message(counts);
}
