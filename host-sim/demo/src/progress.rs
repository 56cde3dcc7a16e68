//! Draws the progress bar of the demo, with the counts and the newest code.

use indicatif::{ProgressBar, ProgressStyle};

use crate::run::Run;

/// Number of components of a code that the bar shows, so that a line of 80 characters holds them
/// and the counts.
const SHOWN: usize = 24;
/// Number of codes from one printed line to the next, if no terminal can show a bar: one line every
/// 5 s.
const LINE_EVERY: usize = 80;

/// Returns a progress bar that is full after `codes` codes. Dropping the bar clears it from the
/// terminal.
pub(crate) fn bar(codes: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{elapsed_precise} {bar:16} {msg}");
    ProgressBar::new(codes).with_style(style.unwrap_or(ProgressStyle::default_bar()))
}

/// Shows the sequence number of the newest frame, the number of lost codes, and the values of the
/// newest code.
pub(crate) fn show(bar: &ProgressBar, run: &Run) {
    let Some(latest) = run.codes.last() else {
        return;
    };
    let fillers = run.codes.len() - run.received();
    let counts = format!("frame {:4}  lost {fillers}", latest.frame.neuroheader.seq);
    let code = blocks(&latest.frame.eeg.data);
    bar.inc(1);
    bar.set_message(format!("{counts}  {code}"));
    if bar.is_hidden() && run.codes.len().is_multiple_of(LINE_EVERY) {
        new_file::message!("{counts}");
    }
}

/// Formats the first components of a code as blocks of eight heights, scaled to the largest
/// magnitude.
fn blocks(code: &[f32]) -> String {
    const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let shown = &code[..code.len().min(SHOWN)];
    let sizes = shown.iter().map(|x| x.abs());
    let largest = sizes.fold(f32::MIN_POSITIVE, f32::max);
    let height = |x: &f32| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0..=7: x / largest is within -1..=1; NaN becomes 0"
        )]
        let height = ((x / largest + 1.0) * 3.5).round() as usize;
        HEIGHTS[height.min(7)]
    };
    shown.iter().map(height).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_rise_with_the_value() {
        assert_eq!(blocks(&[-2.0, 0.0, 2.0]), "▁▅█");
        assert_eq!(blocks(&[f32::NAN, 1.0]), "▁█");
        assert_eq!(blocks(&[]), "");
    }
}
